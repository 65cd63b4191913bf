# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The settings of the server, in a parameter file under ``/**/monitor`` or on the command line.

::

    /**/monitor:
      ros__parameters:
        host: 192.168.1.10
        certificate: /etc/monitor/server.pem
        key: /etc/monitor/server.key
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.schema import made
from rt_robot_os.base.schema import setting

PLAIN_PORT: Final = 8080
TLS_PORT: Final = 8443


@dataclass(frozen=True)
class MonitorSettings:
    """
    The settings of the server.

    :ivar where: path of the folder; set by :func:`load`.
    """

    host: str = setting('127.0.0.1', 'Address it listens on; any but loopback needs TLS')
    port: int = setting(-1, 'Port; -1 is 8443 with TLS and 8080 without, 0 is a free one', '', -1,
                        65535)
    database: str = setting('', 'URL of the database; when absent SQLite in the folder')
    folder: str = setting('', 'Folder of database, files and keys; when absent monitor in '
                          '$ROS_HOME or ~/.ros')
    certificate: str = setting('', 'Certificate of the server, PEM')
    key: str = setting('', 'Its private key, PEM')
    connections: int = setting(1000, 'Connections at a time; the one idle for longest without '
                               'a pending request is dropped for a new one', '', 10, 100000)
    clients: int = setting(200, 'Browsers with live data at a time', '', 1, 10000)
    robots: int = setting(200, 'Robots at a time', '', 1, 10000)
    heartbeat_s: float = setting(2.0, 'A robot that sends nothing for three times this period is '
                                 'shown as silent', 's', 0.2, 600.0)
    command_s: float = setting(8.0, 'How long a command may wait for the answer of the robot',
                               's', 0.5, 60.0)
    media_mb: float = setting(10_000.0, 'Stored pictures and clips of alarms; beyond that '
                              'the oldest of the robot with the most are deleted', 'MB', 1.0, 1e7)
    media_days: float = setting(0.0, 'How long these are stored; 0 for ever', 'd', 0.0, 36500.0)
    raw_days: float = setting(30.0, 'How long observations and places of people are stored '
                              'unmodified; 0 for ever', 'd', 0.0, 36500.0)
    minutes_days: float = setting(400.0, 'How long their lowest, mean and highest value of each '
                                  'minute are stored; those of hours are for ever', 'd', 0.0,
                                  36500.0)
    network_days: float = setting(90.0, 'How long batteries and losses of nodes are stored, and '
                                  'invalid records', 'd', 0.0, 36500.0)
    where: Path = field(default=Path())

    @property
    def has_tls(self) -> bool:
        """Return whether it uses TLS."""
        return bool(self.certificate)

    @property
    def listens_on(self) -> int:
        """Return the port; a default is chosen when none was given."""
        if self.port >= 0:
            return self.port
        return TLS_PORT if self.has_tls else PLAIN_PORT


def load(paths: Sequence[Path], overrides: Mapping[str, Any], options: Mapping[str, Any],
         home: Path, node: str = 'monitor', namespace: str = '/', *, is_needed: bool = True
         ) -> MonitorSettings:
    """
    Read the parameter files; opens nothing.

    :param overrides: of ``--ros-args -p``; they override the files.
    :param options: of the command line; they override both.
    :param home: parent of the folder when none is given.
    :param is_needed: False for files of the robot, which need no section for the monitor.
    :raises ConfigError: with one line for each problem.
    """
    # Imported late: `--help` does not need it.
    from rt_robot_os.settings.program_settings import read_values
    values = read_values(MonitorSettings, paths, {**overrides, **options}, node, namespace,
                         is_needed=is_needed)
    folder = Path(values['folder']).expanduser() if values['folder'] else home / 'monitor'
    found: MonitorSettings = made(MonitorSettings, values, where=folder)
    return found

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


"""Hand what the core says to ROS: to the console, to /rosout, and to the file of the log."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
import time
from typing import Any

from builtin_interfaces.msg import Time
from rcl_interfaces.msg import Log
import rclpy.logging
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy

from rt_robot_os.blackbox.folder import default_folder
from rt_robot_os.blackbox.folder import expanded
from rt_robot_os.link.stamps import StampMapper
from rt_robot_os.reports import Severity
from rt_robot_os.ros.log_file import line_of
from rt_robot_os.ros.log_file import LogFile
from rt_robot_os.settings import LogSettings
from rt_robot_os.units import NS_PER_S

_BYTES_PER_MB = 1_000_000
_DEPTH = 1000


def say(logger: Any, severity: int, text: str) -> None:
    """Log with rclpy, which remembers a call site by its severity: each has a line of its own."""
    if severity >= Severity.FATAL:
        logger.fatal(text)
    elif severity >= Severity.ERROR:
        logger.error(text)
    elif severity >= Severity.WARN:
        logger.warning(text)
    elif severity >= Severity.INFO:
        logger.info(text)
    else:
        logger.debug(text)


class LogRelay:
    """
    Tell people what the core says, each line once.

    On /rosout the lines have the name ``node.source`` and the moment at which they were logged in
    the core. They are published here: rclpy would stamp them with the moment of their arrival.

    :param robot: gives the file its name.
    """

    def __init__(self, node: Node, mapper: StampMapper, settings: LogSettings, robot: str) -> None:
        self.lines = 0
        self._name = node.get_logger().name
        self._own = node.get_logger()
        self._mapper = mapper
        self._loggers: dict[str, Any] = {}
        self._publisher = node.create_publisher(Log, '/rosout', QoSProfile(
            depth=_DEPTH, reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self.file: LogFile | None = None
        if settings.file:
            folder: Path = expanded(settings.folder) if settings.folder else default_folder()
            self.file = LogFile(folder / f'{robot}.log', round(settings.file_mb * _BYTES_PER_MB),
                                settings.files, self._complain)

    def relay(self, severity: int, at_ns: int, source: str, text: str) -> None:
        """Hand on one line of the core; from any one thread."""
        self.lines += 1
        logger = self._loggers.get(source) or self._logger(source)
        say(logger, severity, text)
        wall_ns = at_ns + self._mapper.offset_ns
        self._write(wall_ns, severity, source, text)
        seconds, rest_ns = divmod(wall_ns, NS_PER_S)
        with suppress(RuntimeError):  # rclpy was shut down: the core's last words
            self._publisher.publish(Log(
                stamp=Time(sec=seconds, nanosec=rest_ns), level=severity, name=logger.name,
                msg=text))

    def note(self, severity: int, text: str) -> None:
        """Say something of the node itself, and write it down as well."""
        say(self._own, severity, text)
        self._write(time.time_ns(), severity, 'node', text)

    def _write(self, wall_ns: int, severity: int, source: str, text: str) -> None:
        if self.file is not None:
            self.file.write(line_of(wall_ns, Severity(severity).name, source, text))

    def _logger(self, source: str) -> Any:
        name = source.replace('/', '.').replace(' ', '_').strip('.') or 'core'
        # A logger that is no child of the node's is not on /rosout.
        logger = rclpy.logging.get_logger(f'{self._name}.{name}')
        logger.set_level(rclpy.logging.LoggingSeverity.DEBUG)  # the core has chosen already
        self._loggers[source] = logger
        return logger

    def _complain(self, text: str) -> None:
        self._own.warning(text)

    def statistics(self) -> dict[str, int | str]:
        """Count the lines, those in the file, and those that the file lacks."""
        file = self.file
        return {'lines': self.lines, 'file': str(file.path) if file else 'off',
                'written': file.written if file else 0, 'lost': file.lost if file else 0}

    def close(self) -> None:
        """Write what waits; may be called twice."""
        if self.file is not None:
            self.file.close()

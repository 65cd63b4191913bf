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
The settings of the gateway, in the parameter file of the robot.

::

    /**/gateway:
      ros__parameters:
        server: wss://monitor.example.org:8443
        token_file: ~/.config/rt_robot_os/monitor.token
        people: [anna]
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import re
from typing import Any
from typing import Final
from urllib.parse import urlsplit

from rt_robot_os.base.schema import made
from rt_robot_os.base.schema import setting
from rt_robot_os.base.schema import STAR
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import Section

LOOPBACK: Final = ('localhost', '127.0.0.1', '::1')
_RATE: Final = re.compile(r'(\S+)\s+(\d+(?:\.\d+)?)')
_PERSON: Final = re.compile(r'[A-Za-z][A-Za-z0-9_]{0,63}', re.ASCII)
#: What is shown of a robot of this package; the first that fits counts, and 0 is never.
LIVE: Final = (
    'pose 10', 'odom 10', 'battery 1', 'plan 2', 'path 2', 'scan 2', 'stop_reason 5', 'steering 5',
    'agent/state 5', 'agent/say 2', 'trajectory/state 2', 'planner/state 2', 'alarms/list 5',
    'sound/level 5', 'wsn/nodes 1', 'wsn/*/* 2', 'health/*/imu 0', 'health/*/* 5')


@dataclass(frozen=True)
class GatewaySettings:
    """All of it."""

    server: str = setting('', 'Where the monitor is: wss://HOST:PORT, or ws://localhost:PORT on '
                          'this machine')
    token_file: str = setting('', 'File with the token that `monitor robot add` printed; readable '
                              'by this user alone', is_file=True)
    ca_file: str = setting('', 'Certificate of who signed that of the server; empty for those '
                           'that the system knows', is_file=True)
    name: str = setting('', 'What people call this robot; empty for that of its node')
    people: tuple[str, ...] = setting((), 'Whom it looks after; empty for all of whom it has '
                                      'topics')
    folder: str = setting('', 'Folder of what waits to be sent; when absent gateway-ROBOT in '
                          '$ROS_HOME or ~/.ros')
    outbox_mb: float = setting(1000.0, 'What may wait on the disk; beyond that the oldest of the '
                               'least important is evicted', 'MB', 1.0, 100_000.0)
    outbox_days: float = setting(7.0, 'How long it may wait, counted while the gateway runs; '
                                 'alarms and events wait for ever', 'd', 0.01, 3650.0)
    live: tuple[str, ...] = setting(LIVE, 'Topics that are shown, each with how often a second at '
                                    'most; * stands for one part of a name')
    idle_hz: float = setting(1.0, 'How often changes are sent while no page shows them', 'Hz',
                             0.01, 10.0)
    observation_s: float = setting(60.0, 'A vital sign that stays is recorded that often; '
                                   'one that changes immediately', 's', 1.0, 86400.0)
    signs_s: float = setting(1.0, 'The values of one vital sign are recorded at most that often',
                             's', 0.0, 3600.0)
    node_s: float = setting(300.0, 'Batteries and losses of nodes are recorded that often', 's',
                            1.0, 86400.0)
    place_s: float = setting(10.0, 'Places of people and of the robot are recorded at most that '
                             'often', 's', 0.1, 86400.0)
    nodes_file: str = setting('', 'The file that says where the nodes are, as of '
                              'sensor_network; empty when there is none', is_file=True)
    map: str = setting(  # noqa: A003
        '', 'The map that is shown until the robot has one on its topic map: a .yaml as of the '
        'planner; empty when there is none',
        is_file=True)
    cameras: tuple[str, ...] = setting((), 'Topics of compressed pictures that may be looked at; '
                                       'empty for all of the robot')
    camera_hz: float = setting(15.0, 'Pictures a second of a camera at most', 'Hz', 0.1, 30.0)
    observations_folder: str = setting('', 'Where cameras keep pictures and clips of alarms, as '
                                       'their observations_folder; empty: observations in '
                                       '$ROS_HOME or ~/.ros')
    media_mb: float = setting(1000.0, 'Pictures and clips that may wait for the server; beyond '
                              'that the oldest are dropped', 'MB', 1.0, 1e6)
    microphone: str = setting('', 'What hears for calls: a sound device, default, file:PATH of a '
                              'WAV, tone (a simulated one), none; empty: no calls unless there is '
                              'a speaker')
    speaker: str = setting('', 'What speaks in calls: a sound device, default, file:PATH, none')
    duck_db: float = setting(18.0, 'How much quieter the microphone is while the speaker plays, '
                             'against an echo', 'dB', 0.0, 60.0)
    heartbeat_s: float = setting(5.0, 'How often monitor/heartbeat is published while the server '
                                 'answers', 's', 0.1, 3600.0)
    silence_s: float = setting(3.0, 'A server that does not answer for this time is called '
                               'again', 's', 0.5, 60.0)
    command_s: float = setting(5.0, 'How long the robot may take to answer a command', 's', 0.1,
                               60.0)
    drive_linear_m_s: float = setting(0.3, 'Fastest speed of remote driving; 0: it cannot be '
                                      'driven remotely', 'm/s', 0.0, 5.0)
    drive_angular_rad_s: float = setting(0.8, 'Fastest turn of remote driving', 'rad/s', 0.0, 10.0)
    drive_hold_s: float = setting(0.1, 'How long a command to drive is active: shorter than the '
                                  'time-out of teleop in velocity_mux', 's', 0.05, 0.3)
    avoid_cpus: tuple[int, ...] = setting((), 'CPUs that it leaves to the core')

    def live_rates(self) -> tuple[tuple[str, float], ...]:
        """Return the topics that are shown, with their rates in Hz."""
        return tuple((found[1], float(found[2])) for each in self.live
                     if (found := _RATE.fullmatch(each)))


def load(paths: Sequence[Path], overrides: Mapping[str, Any], node: str = 'gateway',
         namespace: str = '/') -> GatewaySettings:
    """
    Read the parameter files; opens nothing else.

    :param overrides: by dotted name; they win over the files.
    :raises ConfigError: with one line for each problem.
    """
    # Late: `--help` needs none of it.
    from rt_robot_os.settings.program_settings import read_values
    settings: GatewaySettings = made(GatewaySettings, read_values(
        GatewaySettings, paths, overrides, node, namespace, _check))
    return settings


def _check(section: Section, problems: Problems) -> None:
    values = section.values
    if values.get('server') and (wrong := server_problem(values['server'])):
        section.reject('server', wrong, problems)
    for each in values.get('live', ()):
        if not _RATE.fullmatch(each):
            problems.value(section.where('live'), 'live', each, 'write a topic and how often a '
                           f'second, such as pose 10 or health/{STAR}/{STAR} 5')
    for each in values.get('people', ()):
        if not _PERSON.fullmatch(each):
            problems.value(section.where('people'), 'people', each, 'a person is named by '
                           'letters, digits and _, as in the topics')


def server_problem(server: str) -> str:
    """Return what is wrong with an address; empty when nothing is."""
    try:
        parts = urlsplit(server)
        port = parts.port
    except ValueError:
        parts, port = urlsplit(''), None
    if parts.scheme not in ('ws', 'wss') or not parts.hostname or port == 0:
        return 'write wss://HOST:PORT'
    if parts.username or parts.password or parts.query or parts.fragment:
        return 'no name, password or ? belongs into an address: the token is in token_file'
    if parts.scheme == 'ws' and parts.hostname not in LOOPBACK:
        return ('without TLS anybody on the way can read and change everything: write wss:// '
                '(`monitor certificate` makes what is needed)')
    return ''

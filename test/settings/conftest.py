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


"""A catalogue of made-up drivers and modules, so that settings are tested without any device."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Hashable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import LayoutError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import PartTopics
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import TopicRead
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.settings import Catalogue
from rt_robot_os.settings import load
from rt_robot_os.settings import PartKind
from rt_robot_os.settings import RobotSettings

MESSAGES = ('sensor_msgs/msg/Imu', 'sensor_msgs/msg/MagneticField', 'sensor_msgs/msg/NavSatFix',
            'sensor_msgs/msg/TimeReference', 'geometry_msgs/msg/Twist')

SERIAL = (
    Field('port', str, REQUIRED, 'serial port, or sim'),
    Field('baud', int, 9600, 'speed of the line', 'bits/s', 1200, 4_000_000),
    Field('frame_id', str, 'base_link', 'coordinate frame'),
)


@dataclass(frozen=True)
class Kinds:
    """Kinds in a dictionary."""

    kinds: Mapping[str, PartKind]

    def names(self) -> Sequence[str]:
        return tuple(self.kinds)

    def find(self, name: str) -> PartKind:
        if name not in self.kinds:
            raise ConfigError([f"no such thing, known: {', '.join(self.kinds)}"])
        return self.kinds[name]


def layout(message: str, fixed: Mapping[str, Any], tail: int | None) -> Hashable:
    if message not in MESSAGES:
        raise LayoutError(f'message type {message!r}: there is none')
    return message, tuple(sorted(fixed.items())), tail


def imu_topics(name: str, values: Mapping[str, Any]) -> PartTopics:
    fixed = {'header.frame_id': values['frame_id']}
    return PartTopics((TopicSpec(values['topic'], 'sensor_msgs/msg/Imu', fixed),
                       TopicSpec(values['mag_topic'], 'sensor_msgs/msg/MagneticField', fixed)))


def gps_topics(name: str, values: Mapping[str, Any]) -> PartTopics:
    return PartTopics((TopicSpec(values['topic'], 'sensor_msgs/msg/NavSatFix'),
                       TopicSpec(values['time_topic'], 'sensor_msgs/msg/TimeReference')))


def guard_topics(name: str, values: Mapping[str, Any]) -> PartTopics:
    return PartTopics((TopicSpec(values['safe_topic'], 'geometry_msgs/msg/Twist'),),
                      (TopicRead(values['command_topic'], message='geometry_msgs/msg/Twist'),))


def broken_topics(name: str, values: Mapping[str, Any]) -> PartTopics:
    raise ZeroDivisionError('a module of the user')


@pytest.fixture(scope='session')
def catalogue() -> Catalogue:
    imu = PartKind(SERIAL + (
        Field('topic', str, 'imu/data', 'inertial data'),
        Field('mag_topic', str, 'imu/mag', 'magnetic field'),
        Field('gains', list, (1.0, 2.0), 'three gains', item=float, minimum=0.0, maximum=5.0),
        Field('range_g', int, 4, 'range', 'g', choices=(2, 4, 8)),
    ), imu_topics)
    gps = PartKind(SERIAL + (
        Field('topic', str, 'gps/fix', 'position'),
        Field('time_topic', str, 'gps/time', 'time'),
    ), gps_topics)
    guard = PartKind((
        Field('timeout_s', float, 0.5, 'age of a command', 's', 0.01, 60.0, live=True),
        Field('safe_topic', str, 'cmd_vel_safe', 'limited command'),
        Field('command_topic', str, 'cmd_vel', 'command'),
    ), guard_topics)
    simulated = PartKind((
        Field('rate_hz', float, 100.0, 'frames a second', 'Hz', 0.1, 1000.0),
        Field('faults', list, (), 'faults, each at a time'),
    ))
    bus = PartKind((Field('port', str, REQUIRED, 'I2C bus'),
                    Field('address', int, 0x76, 'on the bus')), shares_port=True)
    return Catalogue(
        drivers=Kinds({'witmotion': imu, 'nmea': gps, 'chip': bus}),
        modules=Kinds({'twist_guard': guard, 'broken': PartKind(topics=broken_topics)}),
        simulators=Kinds({'witmotion': simulated, 'nmea': simulated}),
        layout=layout)


GOOD = """\
robot:
  ros__parameters:
    autostart: true
    core: {spawn: true, cpu: -1}
    devices: [imu, gps]
    imu:
      type: witmotion
      port: sim
      baud: 115200
      frame_id: imu_link
      rate_hz: 200.0
      priority: 80
      sim: {rate_hz: 50.0, faults: ['unplug at 5 for 2']}
    gps: {type: nmea, port: sim, rate_hz: 20, priority: 60}
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 50.0, priority: 40}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist, depth: 8, rate_hz: 20.0}
    mirrors: [imu_data, cmd_vel_in]
    imu_data: {topic: imu/data, policy: latest, max_rate_hz: 50.0}
    cmd_vel_in: {topic: cmd_vel, direction: in}
"""


@pytest.fixture
def good() -> str:
    return GOOD


Loader = Callable[..., RobotSettings]
Judge = Callable[..., tuple[str, ...]]


@pytest.fixture
def load_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, catalogue: Catalogue,
) -> Loader:
    """Load texts as robot.yaml, second.yaml, ... of the current folder."""
    monkeypatch.chdir(tmp_path)

    def run(*texts: str, overrides: Mapping[str, Any] | None = None, node: str = 'robot',
            namespace: str = '/') -> RobotSettings:
        paths = []
        for name, text in zip(('robot.yaml', 'second.yaml', 'third.yaml'), texts):
            Path(name).write_text(text, encoding='utf-8')
            paths.append(Path(name))
        return load(paths, overrides or {}, node, namespace, catalogue)

    return run


@pytest.fixture
def problems_of(load_text: Loader) -> Judge:
    """Load texts that are wrong and give the problems."""

    def run(*texts: str, **options: Any) -> tuple[str, ...]:
        with pytest.raises(ConfigError) as caught:
            load_text(*texts, **options)
        return caught.value.problems

    return run

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
A simulated StarGazer: it detects the marks of the world, or circles below its own mark.

It has the vendor's timing: a byte that arrives too soon after the previous one is lost, and all
bytes are lost while the flash memory is written.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.stargazer import wire
from rt_robot_os.devices.stargazer.landmark_files import load_landmarks
from rt_robot_os.devices.stargazer.wire import CeilingMark
from rt_robot_os.devices.stargazer.wire import StarGazerDecoder
from rt_robot_os.devices.stargazer.wire import StarGazerFrame
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.landmarks import CeilingLandmark
from rt_robot_os.motion.landmarks import landmarks_of
from rt_robot_os.motion.poses import composed
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.faults import LOCALISER_FAULTS
from rt_robot_os.sim.world import NOISE_SETTING

MULTI: Final = 'multi'
SINGLE: Final = 'single'
OLD: Final = 'old'

# Less than the vendor's 50 ms, because this process may be late, too.
_BYTE_NS: Final = 30 * NS_PER_MS
_FLASH_NS: Final = 2500 * NS_PER_MS
_PROCEDURE_NS: Final = 3 * NS_PER_S
_NOISE_M: Final = 0.01
_NOISE_RAD: Final = math.radians(1.0)
_ASTRAY_M: Final = 1.5
_LOWEST_M: Final = 0.5
_FIRST_MARK: Final = '24706: 0.0, 0.0, 0.0'
# Settings that default to those of its driver.
_OF_DRIVER: Final = ('angle_sign', 'angle_offset_rad')
_DEFAULTS: Final = {
    'MarkType': 'HLD1S', 'MarkDim': '1', 'MarkMode': 'Alone', 'MarkHeight': '2400',
    'HeightFix': 'Yes', 'IDNum': '4', 'RefID': '2', 'ThrAlg': 'Auto', 'ThrVal': '210',
    'BaudRate': '115200', 'Version': '2.0'}


class SimulatedStarGazer(SimulatedDevice):
    """A localiser below marks on the ceiling."""

    SETTINGS = common_settings(20.0, 40.0, LOCALISER_FAULTS) + (
        Field('form', str, MULTI, 'Form of its sentences: several marks, one mark, or one mark as '
              'until 2008.', choices=(MULTI, SINGLE, OLD)),
        Field('landmarks', list, (),
              'Positions of the marks, as for the driver; without any, those of the world, of the '
              'driver, or the single mark {_FIRST_MARK}.'),
        Field('landmarks_file', str, '', 'Further marks, as for the driver.', is_file=True),
        Field('angle_sign', int, -1, 'Sense of its angle, as for the driver.', choices=(-1, 1)),
        Field('angle_offset_rad', float, 0.0, 'As for the driver.', 'rad', -math.tau, math.tau),
        Field('range_m', float, 1.5, 'Largest horizontal distance of a detected mark.', 'm', 0.05,
              20.0),
        Field('height_m', float, 2.2, 'Height of the ceiling above it, without a world.', 'm',
              0.5, 7.0),
        Field('most_marks', int, 4,
              'Largest number of marks in one sentence.', minimum=1, maximum=6),
        NOISE_SETTING,
        Field('circle_m', float, 0.6, 'Radius of the circle on which it moves below its first '
              'mark, without a world.', 'm', 0.0, 100.0),
        Field('circle_s', float, 20.0, 'Period of the circle.', 's', 0.1, 1e4),
        Field('outlier_probability', float, 0.0,
              'Probability that a mark is confused with another one, or seen elsewhere if there '
              'is no other.', minimum=0.0, maximum=1.0),
        Field('moved_id', int, -1, 'A mark with a wrong position on the map.', minimum=-1,
              maximum=999_999),
        Field('moved_m', float, 0.5, 'Its error.', 'm', -100.0, 100.0),
        Field('miss_probability', float, 0.0,
              'Probability that it misses a command while it sends positions.',
              minimum=0.0, maximum=1.0),
    )
    BAUD = 115200
    KNOWN_FAULTS = LOCALISER_FAULTS

    @classmethod
    def made_for(
        cls, name: str, settings: Mapping[str, Any], place: RobotSite, device: Mapping[str, Any],
    ) -> SimulatedDevice:
        """
        Make the simulated counterpart of a device; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong, or the line is too slow for the rate.
        """
        known = {key: device[key] for key in _OF_DRIVER if key in device}
        return super().made_for(name, {**known, **settings}, place, device)

    def prepare(self) -> None:
        """
        Start in the state after power-on: it sends.

        :raises ConfigError: the landmarks cannot be read.
        """
        self._landmarks = _landmarks(self.settings, self.name)
        self._height_m: float = self.settings['height_m']
        if self.world is not None:
            self._landmarks = self._landmarks or {
                each.number: each for each in self.world.landmarks}
            self._height_m = max(
                _LOWEST_M, self.world.settings.ceiling_m - self.mounting.position_m[2])
        else:
            self._landmarks = (self._landmarks or _landmarks(self.device, self.name)
                               or landmarks_of((_FIRST_MARK,), self.name))
        self.parameters = dict(_DEFAULTS)
        self.lost_bytes = 0
        self.flash_writes = 0
        self._commands = StarGazerDecoder()
        self._sends = True
        self.mode = wire.POSITION
        self._byte_ns = -_BYTE_NS
        # When its current procedure ends and is reported; 0 without one.
        self._done_ns = 0
        self._deaf = False
        self._befalls: frozenset[str] = frozenset()

    def sample(self, time_s: float) -> bytes:
        """Return one sentence, nothing while it is stopped."""
        said = self._finished(self.start_ns + round(time_s * NS_PER_S))
        if not self._sends:
            return said
        self._befalls = self._plan.active(self._now_ns)
        marks = [] if 'blind' in self._befalls else self._marks(*self._sensor_pose(time_s))
        if not marks:
            return said + wire.sentence(wire.NOTICE, 'DeadZone')
        form = self.settings['form']
        if form == OLD:
            return said + wire.old(marks[0], self.mode)
        if form == SINGLE or self.mode != wire.POSITION:
            return said + wire.single(marks[0], self.mode)
        return said + wire.multi(marks)

    def handle_command(self, data: bytes) -> None:
        """Receive the bytes that do not arrive too fast, and execute them."""
        for byte in data:
            if self._deaf or self._now_ns - self._byte_ns < _BYTE_NS:
                self.lost_bytes += 1
                continue
            self._byte_ns = self._now_ns
            for frame in self._commands.feed(bytes((byte,))):
                self._handle_one(frame)

    def _handle_one(self, frame: StarGazerFrame) -> None:
        name, _, value = frame.content.partition('|')
        if self._sends and self.random.random() < self.settings['miss_probability']:
            return
        if frame.kind == wire.READ and name in self.parameters:
            self._acknowledge(name)
            self.reply(wire.sentence(wire.VALUE, f'{name}|{self.parameters[name]}'))
        elif frame.kind == wire.WRITE and self._does(frame.content, name, value):
            self._acknowledge(frame.content)

    def _does(self, content: str, name: str, value: str) -> bool:
        if content in (wire.STOP, wire.START):
            self._sends = content == wire.START
        elif content in (wire.BUILD_MAP, wire.HEIGHT_CALCULATION):
            self.mode = wire.MAP_BUILDING if content == wire.BUILD_MAP else wire.HEIGHT
            self._done_ns = self._now_ns + _PROCEDURE_NS
        elif content == wire.END:
            self.flash_writes += 1
            self._deaf = True
            self._done_ns = self._now_ns + _FLASH_NS
        elif name in self.parameters and value:
            self.parameters[name] = value
        else:
            return False
        return True

    def _acknowledge(self, content: str) -> None:
        self.reply(wire.sentence(wire.ACKNOWLEDGEMENT, content))

    def _finished(self, now_ns: int) -> bytes:
        if not self._done_ns or now_ns < self._done_ns:
            return b''
        self._done_ns = 0
        self._deaf = False
        self.mode = wire.POSITION
        return wire.sentence(wire.ACKNOWLEDGEMENT, wire.UPDATED)

    def base_pose(self, time_s: float) -> Pose:
        """Return where the robot is."""
        if self.world is not None:
            return self.world.base.pose
        first = next(iter(self._landmarks.values()))
        angle = math.tau * time_s / self.settings['circle_s']
        radius = self.settings['circle_m']
        return (first.x + radius * math.cos(angle), first.y + radius * math.sin(angle),
                wrapped(angle + math.pi / 2))

    def _sensor_pose(self, time_s: float) -> Pose:
        ahead, left, _ = self.mounting.position_m
        return composed(self.base_pose(time_s), (ahead, left, self.mounting.yaw_rad))

    def _marks(self, x: float, y: float, heading: float) -> list[CeilingMark]:
        """Return the measurements of the marks above it, the nearest first."""
        s = self.settings
        near = []
        for each in self._landmarks.values():
            true_x = each.x + (s['moved_m'] if each.number == s['moved_id'] else 0.0)
            distance_m = math.hypot(x - true_x, y - each.y)
            if distance_m <= s['range_m']:
                near.append((distance_m, each, x - true_x, y - each.y))
        near.sort(key=lambda found: found[0])
        return [self._mark(each, beside_x, beside_y, heading)
                for _, each, beside_x, beside_y in near[:s['most_marks']]]

    def _reference(self) -> CeilingLandmark | None:
        """Return the mark to which all positions are relative, once it has its own map."""
        if self.parameters['MarkMode'] != 'Map' or not self.parameters['RefID'].isdigit():
            return None
        return self._landmarks.get(int(self.parameters['RefID']))

    def _mark(self, landmark: CeilingLandmark, beside_x: float, beside_y: float,
              heading: float
              ) -> CeilingMark:
        s = self.settings
        gauss, noise = self.random.gauss, s['noise']
        number = landmark.number
        if (reference := self._reference()) is not None:
            beside_x += landmark.x - reference.x
            beside_y += landmark.y - reference.y
            landmark = reference
        cosine, sine = math.cos(landmark.yaw), math.sin(landmark.yaw)
        x = cosine * beside_x + sine * beside_y + gauss(0.0, _NOISE_M * noise)
        y = cosine * beside_y - sine * beside_x + gauss(0.0, _NOISE_M * noise)
        angle = heading - landmark.yaw - s['angle_offset_rad'] + gauss(0.0, _NOISE_RAD * noise)
        if 'misread' in self._befalls or self.random.random() < s['outlier_probability']:
            others = [each for each in self._landmarks if each != number]
            if others:
                number = self.random.choice(others)
            else:
                x += self.random.uniform(-_ASTRAY_M, _ASTRAY_M)
                y += self.random.uniform(-_ASTRAY_M, _ASTRAY_M)
        return CeilingMark(number, round(math.degrees(s['angle_sign'] * wrapped(angle)), 2),
                           100 * x, 100 * y, 100 * self._height_m)


def _landmarks(settings: Mapping[str, Any], name: str) -> dict[int, CeilingLandmark]:
    """
    Read the landmarks of its own settings, or of its driver.

    :raises ConfigError: they cannot be read.
    """
    found = landmarks_of(settings.get('landmarks', ()), f'{name}: landmarks')
    if settings.get('landmarks_file'):
        found.update(load_landmarks(settings['landmarks_file'], f'{name}: landmarks_file'))
    return found

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
Hagisonic StarGazer: a camera that detects marks on the ceiling and reports its pose below them.

Publishes ``geometry_msgs/msg/PoseWithCovarianceStamped``: the pose of the robot's ``base_link`` in
the map. The reported pose is transformed from the mark to the map, by ``landmarks``, then from the
sensor to ``base_link``, by the mounting.

In a dead zone, where no mark is in sight, nothing is published; that is not a fault. A mark that
is not on the map is counted and reported, and so is one that keeps disagreeing with its
neighbours.

Nothing is sent unless ``configure`` is set; ``setup.py`` contains the protocol.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.stargazer import setup
from rt_robot_os.devices.stargazer import wire
from rt_robot_os.devices.stargazer.fusion import FusedPose
from rt_robot_os.devices.stargazer.fusion import Fuser
from rt_robot_os.devices.stargazer.fusion import LandmarkSighting
from rt_robot_os.devices.stargazer.fusion import sighting
from rt_robot_os.devices.stargazer.landmark_files import load_landmarks
from rt_robot_os.devices.stargazer.setup import StarGazerSetup
from rt_robot_os.devices.stargazer.wire import CeilingMark
from rt_robot_os.devices.stargazer.wire import StarGazerDecoder
from rt_robot_os.devices.stargazer.wire import StarGazerFrame
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.landmarks import CeilingLandmark
from rt_robot_os.motion.landmarks import landmarks_of
from rt_robot_os.motion.mounting import mounting_of

# Duration with all parameters to be read and written, some of them twice.
_SETUP_S: Final = 40.0
# Limit of the unknown numbers that are kept for the diagnosis; digits may be damaged on the line.
_MOST_STRANGERS: Final = 16
_LEARN_EVERY: Final = 64
_MAP_MODE: Final = 'Map'
_AT_ORIGIN: Final = (0.0, 0.0, 0.0)
_MARK_TYPES: Final = ('', 'Home', 'Office', 'HLD1S', 'HLD1L', 'HLD2S', 'HLD2L', 'HLD3S', 'HLD3L')


class StarGazer(SerialDevice[StarGazerFrame]):
    """A localiser with marks on the ceiling."""

    SETTINGS = serial_settings(
        baud=115200, frame_id='stargazer_link', topic='stargazer/pose', rate_hz=20.0,
    ) + (
        Field('map_frame_id', str, 'map', 'Frame of the landmarks and of the pose.'),
        Field('landmarks', list, (), "Positions of the marks, such as '24706: 1.5, -2.0, 0.0': "
              'number, x and y in m, yaw in rad. Without any, and without landmarks_file, the '
              'first detected mark is the origin.'),
        Field('landmarks_file', str, '',
              'Further marks, from a CSV file (id,x_cm,y_cm,yaw_deg) or a YAML file: a path, '
              'file:// or package://.', is_file=True),
        Field('angle_sign', int, -1,
              'Sense of its angle: -1 if it counts clockwise, as all known devices, 1 if it '
              'counts counter-clockwise.', choices=(-1, 1)),
        Field('angle_offset_rad', float, 0.0, 'Added to its angle after the sign.', 'rad',
              -math.tau, math.tau),
        Field('position_stddev_m', float, 0.01,
              'Standard deviation of the position directly below a mark.', 'm', 1e-4, 10.0),
        Field('heading_stddev_rad', float, 0.0175,
              'Standard deviation of the heading directly below a mark.', 'rad', 1e-4, math.pi),
        Field('tolerance_m', float, 0.3,
              'Largest difference of the positions by two marks that agree.', 'm', 0.01, 100.0),
        Field('tolerance_rad', float, 0.25, 'Largest difference of their headings.', 'rad', 0.01,
              math.pi),
        Field('latency_s', float, 0.0,
              'Time from the picture to the arrival of the sentence, subtracted from the stamp.',
              's', 0.0, 1.0),
        Field('configure', bool, False,
              'Set it up at opening with the settings below, which takes some seconds. Off: '
              'nothing is sent.'),
        Field('mark_type', str, '', 'Kind of marks; empty: not changed.',
              choices=_MARK_TYPES),
        Field('mark_dim', int, 0, 'Size of the marks of an old firmware; 0: not changed.',
              minimum=0, maximum=3),
        Field('mark_mode', str, '',
              'Alone: positions are relative to each mark. Map: it has built its own map, and '
              'positions are relative to reference_id. Empty: not changed, should be Alone.',
              choices=('', 'Alone', _MAP_MODE)),
        Field('mark_height_m', float, 0.0, 'Height of the ceiling above it; 0: not changed.',
              'm', 0.0, 7.0),
        Field('height_mode', str, '',
              'Whether it uses the fixed height, or measures it, at half the rate; empty: not '
              'changed.', choices=('', 'fixed', 'automatic')),
        Field('mark_count', int, 0, 'Number of marks, for map mode; 0: not changed.',
              minimum=0, maximum=9999),
        Field('reference_id', int, 0,
              'The mark that is the origin in map mode; 0: not changed.',
              minimum=0, maximum=999_999),
        Field('threshold', int, 0, 'Threshold of brightness; 0: not changed.', minimum=0,
              maximum=255),
        Field('procedure', str, setup.NO_PROCEDURE,
              'Procedure that runs once, at the first opening: build a map while it is moved from '
              'mark to mark, or measure the height of the ceiling. Needs configure.',
              choices=setup.PROCEDURES),
    )
    description = 'Hagisonic StarGazer, a localiser with marks on the ceiling'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings and read the landmarks; nothing is opened.

        :raises ConfigError: the landmarks cannot be read, or settings contradict each other.
        """
        super().__init__(name, settings, StarGazerDecoder())
        self._landmarks = _landmarks(name, settings)
        self._learns_origin = not self._landmarks
        self._reference = _reference(name, settings, self._landmarks)
        if settings['procedure'] != setup.NO_PROCEDURE and not settings['configure']:
            raise ConfigError([f'{name}: procedure {settings["procedure"]} needs configure: true'])
        self._sign: int = settings['angle_sign']
        self._offset_rad: float = settings['angle_offset_rad']
        self._height_m = settings['mark_height_m'] or 2.4
        self._position_variance = settings['position_stddev_m'] ** 2
        self._heading_variance = settings['heading_stddev_rad'] ** 2
        self._latency_ns = round(settings['latency_s'] * NS_PER_S)
        mounting = mounting_of(settings)
        self._mounting = mounting.position_m[:2]
        self._mounting_yaw = mounting.yaw_rad
        self._fuser = Fuser(settings['tolerance_m'], settings['tolerance_rad'])
        self._setup = StarGazerSetup(name, (), setup.NO_PROCEDURE)
        self._procedure: str = settings['procedure']
        self._mode = ''
        self._dead_zone = False
        self._dead_zones = 0
        self._unknown = 0
        self._strangers: dict[int, int] = {}
        self._suspects: list[int] = []
        self._used = 0
        self._used_distance_m = 0.0

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: PoseWithCovarianceStamped."""
        s = self.settings
        return (TopicSpec(
            s['topic'], 'geometry_msgs/msg/PoseWithCovarianceStamped',
            {'header.frame_id': s['map_frame_id']}, s['depth'], s['output_rate_hz']),)

    def restart(self) -> None:
        """Start the set-up if it is configured."""
        self._fuser.forget()
        self._dead_zone = False
        self._mode = ''
        self._setup = StarGazerSetup(
            self.name, setup.parameters_of(self.settings), self._procedure)

    def is_set_up(self) -> bool:
        """Return whether the device was commanded to start, if configured."""
        return self._setup.done or not self.settings['configure']

    def opening_s(self) -> float:
        """Return the longest duration of the set-up."""
        return _SETUP_S if self.settings['configure'] else 0.0

    def write(self, now_ns: int) -> None:
        """
        Send the next byte of the set-up, if due.

        :raises DeviceError: the port is gone, or the device does not answer.
        """
        if self.settings['configure'] and not self._setup.done:
            data = self._setup.due(now_ns)
            if data is not None:
                self.send(data)

    def handle(self, frame: StarGazerFrame, arrival_ns: int) -> int:
        """Handle one sentence; in the loop."""
        if not self.is_set_up():
            if not self._setup.handle(frame):
                self._ignored_frames += 1
            return 0
        if frame.marks:
            self._dead_zone = False
            return self._measured(frame, arrival_ns)
        if frame.is_dead_zone:
            self._dead_zone = True
            self._dead_zones += 1
            return 0
        if frame.kind == wire.ACKNOWLEDGEMENT and frame.name == wire.UPDATED and self._procedure \
                != setup.NO_PROCEDURE:
            self.log.info('%s is finished and stored in the device', self._procedure)
            self._procedure = setup.NO_PROCEDURE
        self._ignored_frames += 1
        return 0

    def statistics(self) -> DeviceStatistics:
        """Return the current counters; contradictions are sentences whose marks disagree."""
        more: dict[str, Value] = {
            'landmarks': len(self._landmarks), 'dead_zone': str(self._dead_zone).lower(),
            'dead_zone_sentences': self._dead_zones, 'unknown_marks': self._unknown,
            'marks_used': self._used, 'mark_distance_m': round(self._used_distance_m, 3),
            'marks_left_out': self._fuser.left_out}
        if self._strangers:
            more['unknown_mark_ids'] = _listed(self._strangers)
        if self._suspects:
            more['disagreeing_mark_ids'] = _listed(self._suspects)
        if self._mode not in ('', wire.POSITION):
            more['mode'] = 'building a map' if self._mode == wire.MAP_BUILDING else (
                'measuring the height')
        return self._counters(contradicted=self._fuser.contradicted, more=more)

    def unused(self) -> str:
        """Return why no sentence gives a pose."""
        if self._dead_zone:
            return 'no mark is in sight (dead zone): drive on, or add marks'
        if self._mode == wire.MAP_BUILDING:
            return 'it builds its map: move it slowly from mark to mark, and stop below each'
        if self._mode == wire.HEIGHT:
            return 'it measures the height of the ceiling: leave it below a mark'
        if self._strangers:
            return (f'it detects the marks {_listed(self._strangers)}, which are not on the map: '
                    'add them to landmarks')
        return super().unused()

    def _measured(self, frame: StarGazerFrame, arrival_ns: int) -> int:
        self._mode = frame.mode
        if frame.mode != wire.POSITION:
            self._ignored_frames += 1
            return 0
        sightings = self._sightings(frame.marks)
        if not sightings:
            self._ignored_frames += 1
            return 0
        fix = self._fuser.fuse(sightings, arrival_ns)
        if self._decoder.frames % _LEARN_EVERY == 0:
            self._learn()
        if fix is None:
            return 0
        self._publish(fix, arrival_ns)
        return 1

    def _sightings(self, marks: Sequence[CeilingMark]) -> list[LandmarkSighting]:
        found = []
        for mark in marks:
            landmark = self._reference or self._landmarks.get(mark.number)
            if landmark is None:
                if not self._learns_origin:
                    self._count_stranger(mark.number)
                    continue
                self._learns_origin = False
                landmark = self._landmarks[mark.number] = CeilingLandmark(mark.number, *_AT_ORIGIN)
                self.log.info('mark %d is the origin of the map, as landmarks has none',
                              mark.number)
            found.append(sighting(mark, landmark, self._sign, self._offset_rad, self._height_m))
            self._used_distance_m = math.hypot(mark.x_cm, mark.y_cm) * 0.01
        return found

    def _count_stranger(self, number: int) -> None:
        self._unknown += 1
        if number in self._strangers:
            self._strangers[number] += 1
            return
        if len(self._strangers) >= _MOST_STRANGERS:
            del self._strangers[min(self._strangers, key=self._strangers.__getitem__)]
        self._strangers[number] = 1

    def _learn(self) -> None:
        suspects = self._fuser.learn()
        for number in suspects:
            if number not in self._suspects:
                self.log.warn('mark %d keeps disagreeing with its neighbours: measure its '
                              'position, and correct landmarks', number)
        self._suspects = suspects

    def _publish(self, fix: FusedPose, arrival_ns: int) -> None:
        heading = wrapped(fix.yaw - self._mounting_yaw)
        cosine, sine = math.cos(heading), math.sin(heading)
        ahead, left = self._mounting
        # The lever: by it an error of the heading becomes an error of the position of base_link.
        by_x, by_y = sine * ahead + cosine * left, sine * left - cosine * ahead
        position, turn = self._position_variance / fix.weight, self._heading_variance / fix.weight
        publisher = self._publishers[0]
        msg = publisher.msg
        pose = msg.pose.pose
        pose.position = (fix.x - cosine * ahead + sine * left,
                         fix.y - sine * ahead - cosine * left, 0.0)
        pose.orientation = (0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2))
        cross = by_x * by_y * turn
        covariance = [0.0] * 36
        covariance[0], covariance[1], covariance[5] = (
            position + by_x * by_x * turn, cross, by_x * turn)
        covariance[6], covariance[7], covariance[11] = (
            cross, position + by_y * by_y * turn, by_y * turn)
        covariance[30], covariance[31], covariance[35] = by_x * turn, by_y * turn, turn
        msg.pose.covariance[:] = covariance
        self._used = len(fix.marks)
        publisher.publish(arrival_ns - self._latency_ns)


def _landmarks(name: str, settings: Mapping[str, Any]) -> dict[int, CeilingLandmark]:
    """
    Read the landmarks of the settings.

    :raises ConfigError: they cannot be read, or one is listed twice.
    """
    found = landmarks_of(settings['landmarks'], f'{name}: landmarks')
    if settings['landmarks_file']:
        more = load_landmarks(settings['landmarks_file'], f'{name}: landmarks_file')
        twice = sorted(found.keys() & more.keys())
        if twice:
            raise ConfigError([f'{name}: landmarks and landmarks_file both contain '
                               f'{_listed(twice)}: delete one'])
        found.update(more)
    return found


def _reference(name: str, settings: Mapping[str, Any], landmarks: Mapping[int, CeilingLandmark]
               ) -> CeilingLandmark | None:
    """
    Return the mark to which all positions are relative, in map mode; otherwise None.

    :raises ConfigError: it is not on the map.
    """
    if settings['mark_mode'] != _MAP_MODE:
        return None
    number: int = settings['reference_id']
    if not landmarks:
        return CeilingLandmark(number, *_AT_ORIGIN)
    if number not in landmarks:
        raise ConfigError([f'{name}: reference_id {number} is not among landmarks: mark_mode Map '
                           'needs the position of the reference mark'])
    return landmarks[number]


def _listed(numbers: Any) -> str:
    return ', '.join(str(number) for number in sorted(numbers))

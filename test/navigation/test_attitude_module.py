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


"""The module attitude: what it takes, what it publishes, what it refuses, what it counts."""

from __future__ import annotations

import math
from pathlib import Path
import sys
from typing import Any

from attitude_motion import angle
from attitude_motion import EARTH
from attitude_motion import Motion
from attitude_motion import off
from attitude_motion import seen
from attitude_motion import swing
import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2 as G
from rt_robot_os.features.navigation.attitude import Attitude
from rt_robot_os.features.navigation.attitude.module import chosen
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.modules.registry import module_class
from rt_robot_os.motion.quaternion import from_rotation
from rt_robot_os.motion.quaternion import IDENTITY
from rt_robot_os.topics import Bus

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000
IMU, FIELD = 'sensor_msgs/msg/Imu', 'sensor_msgs/msg/MagneticField'
DEFAULTS = {field.name: field.default for field in Attitude.fields()}
ANYWHERE = math.pi ** 2 / 3


class Robot:
    """An inertial sensor whose samples the test makes, and an attitude module on it."""

    def __init__(self, start: bool = True, frame_id: str = 'imu_link', imu_type: str = IMU,
                 sensor_hz: float = 100.0, **changes: Any) -> None:
        self.kernel = Kernel(VirtualClock(start_ns=1000 * MS))
        self.bus = Bus(self.kernel)
        self.bus.declare('imu/data', imu_type, {'header.frame_id': frame_id}, rate_hz=sensor_hz)
        self.bus.declare('imu/mag', FIELD, rate_hz=sensor_hz)
        self.imu, self.mag = self.bus.publisher('imu/data'), self.bus.publisher('imu/mag')
        self.module = Attitude('attitude', {**DEFAULTS, 'filter': 'mahony', **changes})
        self.module.declare(self.bus, 400.0)
        self.module.bind(self.bus, self.kernel.add_task(
            'attitude', self.module.job, priority=10, rate_hz=400.0))
        self.out = self.bus.subscribe(self.module.topic_of('attitude'), 'test')
        self.motion = Motion()
        self.now_ns = 2000 * MS
        if start:
            self.module.configure()

    def say(self, dt_ms: float = 10.0, with_field: bool = True, at_ns: int | None = None) -> None:
        """Publish what the sensor says after a time, and let the module work."""
        sample = self.motion.step(dt_ms / 1000, with_field)
        self.now_ns += round(dt_ms * MS)
        if sample.field is not None:
            self.mag.msg.magnetic_field = sample.field
            self.mag.publish(at_ns or self.now_ns)
        self.imu.msg.angular_velocity = sample.rate
        self.imu.msg.linear_acceleration = sample.acceleration
        self.imu.publish(at_ns or self.now_ns)
        self.module.job()

    def said(self) -> list[tuple[int, tuple[float, float, float, float]]]:
        """Take what the module has published: stamps and orientations."""
        found = []
        while self.out.take():
            x, y, z, w = self.out.msg.orientation
            found.append((self.out.stamp_ns, (x, y, z, w)))
        return found

    def count(self, name: str) -> int:
        return int(self.module.statistics()[name])

    def heading_variance(self) -> float:
        self.said()
        return float(self.out.msg.orientation_covariance[8])


@pytest.mark.parametrize('name', ['mahony', 'vqf'])
def test_each_sample_is_published_again_with_its_orientation(name: str) -> None:
    if name == 'vqf':
        pytest.importorskip('vqf', reason='vqf is not installed (pip install vqf)')
    robot = Robot(filter=name)
    robot.motion = Motion(from_rotation(0.1, 0.4, 2.0), turning=swing)
    robot.imu.msg.angular_velocity_covariance[:] = np.arange(9)
    robot.imu.msg.linear_acceleration_covariance[:] = np.arange(10, 19)
    for number in range(300):
        robot.say()
        (stamp_ns, turned), = robot.said()
        assert stamp_ns == robot.now_ns
        if number > 2:
            assert angle(turned, robot.motion.truth) < 0.5
    message = robot.out.msg
    assert message.header.frame_id == 'imu_link'
    assert list(message.angular_velocity_covariance) == list(range(9))
    assert list(message.linear_acceleration_covariance) == list(range(10, 19))
    assert tuple(message.linear_acceleration) == tuple(robot.imu.msg.linear_acceleration)
    covariance = np.array(message.orientation_covariance).reshape(3, 3)
    assert covariance == pytest.approx(np.diag(np.diag(covariance)))
    assert 0 < covariance[0, 0] == covariance[1, 1] < covariance[2, 2] < math.radians(15) ** 2
    assert robot.module.statistics()['filter'] == name
    assert robot.module.statistics()['warning'] == ''


def test_samples_that_wait_are_all_taken_at_once() -> None:
    robot = Robot()
    for number in range(5):
        robot.imu.msg.linear_acceleration = (0.0, 0.0, G)
        robot.imu.publish(2000 * MS + number * 10 * MS)
    robot.module.job()
    assert [stamp // MS for stamp, _ in robot.said()] == [2000, 2010, 2020, 2030, 2040]


def test_silence_is_followed_by_silence() -> None:
    robot = Robot()
    robot.say()
    assert len(robot.said()) == 1
    for _ in range(100):
        robot.module.job()
    assert robot.said() == []


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf, 1e300, -1e6])
@pytest.mark.parametrize('part', ['angular_velocity', 'linear_acceleration'])
def test_a_number_that_cannot_be_is_dropped_and_does_no_harm(part: str, value: float) -> None:
    robot = Robot()
    for _ in range(10):
        robot.say()
    robot.said()
    for axis in 'xyz':
        robot.imu.msg.angular_velocity = (0.0, 0.0, 0.0)
        robot.imu.msg.linear_acceleration = (0.0, 0.0, G)
        setattr(getattr(robot.imu.msg, part), axis, value)
        robot.now_ns += 10 * MS
        robot.imu.publish(robot.now_ns)
    robot.module.job()
    assert robot.said() == []
    assert robot.count('not_finite') == 3
    robot.say()
    (_, turned), = robot.said()
    assert off(turned, IDENTITY).inclination < 1e-6
    assert robot.count('gaps') == 0


@pytest.mark.parametrize('field', [(math.nan, 0.0, 1e-5), (math.inf, 0.0, 0.0), (0.0, 0.0, 0.0)])
def test_a_field_that_cannot_be_is_dropped(field: Any) -> None:
    robot = Robot()
    for _ in range(10):
        robot.say()
        robot.mag.msg.magnetic_field = field
        robot.mag.publish(robot.now_ns)
    robot.say(with_field=False)
    assert robot.count('fields_not_finite') == 10
    assert robot.count('fields') == 10
    assert angle(robot.said()[-1][1], IDENTITY) < 0.01


def test_time_that_stands_still_or_runs_backwards_is_dropped_and_counted() -> None:
    robot = Robot()
    robot.say()
    robot.say(at_ns=robot.now_ns)
    robot.say(at_ns=robot.now_ns - 10 * MS - 1)
    robot.say()
    assert len(robot.said()) == 2
    assert (robot.count('duplicates'), robot.count('backwards')) == (1, 1)


@pytest.mark.parametrize('jump_ms', [5_000, 3_600_000, -5_000, -1_500])
def test_after_a_gap_or_a_new_clock_up_is_found_anew(jump_ms: int) -> None:
    robot = Robot()
    robot.now_ns += 10_000 * MS
    for _ in range(100):
        robot.say()
    settled = robot.heading_variance()
    robot.said()
    robot.now_ns += jump_ms * MS
    robot.motion.truth = from_rotation(1.0, 0.5, -1.5)  # picked up meanwhile
    robot.say()
    robot.say()
    assert robot.count('gaps') == 1
    turned = robot.said()[-1][1]
    assert angle(turned, robot.motion.truth) < 0.5
    assert robot.heading_variance() > settled


def test_a_short_gap_is_bridged() -> None:
    robot = Robot()
    robot.motion.turning = lambda _: (0.0, 0.0, 1.0)
    for _ in range(10):
        robot.say(with_field=False)
    robot.say(200.0, with_field=False)
    assert robot.count('gaps') == 0
    # Without a field the first heading is 0, and the first sample ends a turn of 10 ms.
    assert angle(robot.said()[-1][1], from_rotation(0.0, 0.0, 0.3)) < 0.7


def test_a_slow_sensor_has_no_gaps() -> None:
    robot = Robot(sensor_hz=2.0, gap_max_s=0.1)
    for _ in range(5):
        robot.say(500.0)
    assert (robot.count('gaps'), robot.count('samples')) == (0, 5)


def test_before_up_is_known_the_orientation_says_so() -> None:
    robot = Robot()
    robot.imu.msg.linear_acceleration_covariance[0] = -1.0
    robot.say()
    assert robot.said()[0][1] == IDENTITY
    assert list(robot.out.msg.orientation_covariance) == [-1.0] + [0.0] * 8
    assert robot.out.msg.linear_acceleration_covariance[0] == -1.0
    assert robot.module.statistics()['warning'] == 'no acceleration yet: up is unknown'
    assert robot.count('without_acceleration') == 1
    robot.imu.msg.linear_acceleration_covariance[0] = 0.0
    robot.say()
    robot.said()
    assert robot.out.msg.orientation_covariance[0] > 0


def test_a_sensor_without_gyroscope_is_not_used() -> None:
    robot = Robot()
    robot.imu.msg.angular_velocity_covariance[0] = -1.0
    robot.say()
    assert robot.said() == []
    assert robot.count('without_rate') == 1


def test_until_there_is_a_field_the_heading_is_anything() -> None:
    robot = Robot()
    robot.say(with_field=False)
    assert robot.heading_variance() == pytest.approx(ANYWHERE)
    assert robot.module.statistics()['warning'] == (
        'no magnetic field yet on imu/mag: north is unknown')
    robot.say()
    assert robot.heading_variance() < 0.05
    for _ in range(6000):
        robot.say()
    assert math.sqrt(robot.heading_variance()) == pytest.approx(math.radians(2.5), rel=0.02)
    assert math.sqrt(robot.out.msg.orientation_covariance[0]) == pytest.approx(
        math.radians(1.0), rel=0.02)


def test_without_fields_the_heading_is_less_certain_by_the_minute() -> None:
    robot = Robot()
    robot.motion.turning = swing
    for _ in range(2000):
        robot.say()
    settled = robot.heading_variance()
    for _ in range(2000):
        robot.say(with_field=False)
    assert robot.heading_variance() > settled


def test_with_six_axes_no_field_is_read_and_the_heading_drifts() -> None:
    robot = Robot(axes=6, declination_deg=90.0)
    assert robot.module.subscriptions() == ('imu/data',)
    robot.motion = Motion(turning=swing)
    robot.say()
    first = robot.heading_variance()
    for _ in range(1000):
        robot.say()
    assert robot.module.statistics()['warning'] == ''
    assert robot.count('fields') == 0
    assert angle(robot.said()[-1][1], robot.motion.truth) < 1.0
    robot.say()
    assert first < robot.heading_variance() < ANYWHERE


def test_the_declination_turns_the_heading_to_true_north() -> None:
    robot = Robot(declination_deg=10.0)
    for _ in range(3):
        robot.say()
    # The compass is off by 10 degrees towards east: what it calls east is south of it.
    assert angle(robot.said()[-1][1], from_rotation(0.0, 0.0, math.radians(-10))) < 0.01
    robot.module.change('declination_deg', -20)
    robot.say()
    assert angle(robot.said()[-1][1], from_rotation(0.0, 0.0, math.radians(20))) < 0.01


def test_the_bias_is_taken_off_the_angular_velocity_unless_that_is_off() -> None:
    robot = Robot()
    robot.motion.bias = (0.01, -0.02, 0.0)
    for _ in range(2000):
        robot.say()
    robot.said()
    assert tuple(robot.out.msg.angular_velocity) == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)
    assert robot.module.statistics()['bias_y_rad_s'] == pytest.approx(-0.02, abs=1e-4)
    assert robot.module.statistics()['at_rest'] is True
    robot.module.change('subtract_bias', False)
    robot.say()
    robot.said()
    assert tuple(robot.out.msg.angular_velocity) == (0.01, -0.02, 0.0)


def test_a_field_from_after_a_sample_waits_for_the_next() -> None:
    robot = Robot()
    robot.mag.msg.magnetic_field = EARTH
    robot.mag.publish(robot.now_ns + 15 * MS)
    robot.say(with_field=False)
    assert robot.count('fields') == 0
    robot.say(with_field=False)
    assert robot.count('fields') == 1


@pytest.mark.parametrize('away_ms', [-1000, 1000])
def test_a_field_of_another_time_is_dropped(away_ms: int) -> None:
    robot = Robot()
    robot.say(with_field=False)
    robot.mag.msg.magnetic_field = EARTH
    robot.mag.publish(robot.now_ns + away_ms * MS)
    robot.say(with_field=False)
    assert (robot.count('fields'), robot.count('fields_late')) == (0, 1)


def test_a_live_setting_reaches_the_filter() -> None:
    robot = Robot()
    robot.say()
    for name, value in {
            'inclination_time_s': 0.5, 'heading_time_s': 20.0, 'field_rejection': False,
            'bias_in_motion': False, 'bias_at_rest': False, 'rest_rate_rad_s': 0.1,
            'rest_acceleration_m_s2': 1.0}.items():
        robot.module.change(name, value)
    robot.module.change('heading_stddev_rad', 0.2)
    robot.say()
    now = robot.module._filter
    assert now is not None
    assert (now.tuning.inclination_time_s, now.tuning.heading_time_s) == (0.5, 20.0)
    assert (now.tuning.bias_in_motion, now.tuning.field_rejection) == (False, False)
    for _ in range(10):
        robot.say()
    assert math.sqrt(robot.heading_variance()) >= 0.17


def test_a_field_that_is_rejected_is_told() -> None:
    robot = Robot()
    robot.motion.turning = swing
    for _ in range(2000):
        robot.say()
    robot.motion.field = lambda _: (3e-5, 0.0, 1e-5)
    for _ in range(100):
        robot.say()
    assert robot.module.statistics()['field_rejected'] is True


def test_a_sensor_in_another_frame_is_refused_with_the_remedy() -> None:
    robot = Robot(start=False, frame_id='chassis')
    with pytest.raises(ConfigError, match="attitude.frame_id = 'imu_link': imu/data is in the "
                                          "frame 'chassis'.*set frame_id to it"):
        robot.module.configure()


def test_a_topic_of_another_type_is_refused() -> None:
    with pytest.raises(TopicError, match=f"'imu/data' must be a {IMU}, but .* is a {FIELD}"):
        Robot(start=False, imu_type=FIELD)


def test_without_vqf_the_name_is_refused_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'vqf', None)
    with pytest.raises(ConfigError, match=r'needs vqf \S+ or newer \(not installed\): .+; or '
                                          'choose auto or mahony'):
        Attitude('attitude', {**DEFAULTS, 'filter': 'vqf'})
    assert chosen('auto') == 'mahony'
    robot = Robot(filter='auto')
    robot.say()
    assert robot.module.statistics()['filter'] == 'mahony'


def test_a_vqf_that_cannot_be_imported_is_passed_over_unless_it_is_named(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'vqf.py').write_text('import a_library_that_is_not_there')
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, 'vqf', raising=False)
    robot = Robot(filter='auto')
    assert robot.module.statistics()['filter'] == 'mahony'
    with pytest.raises(ConfigError, match="filter = 'vqf' cannot be used .*choose auto or mahony"):
        Robot(filter='vqf')


def test_it_is_registered_and_before_configure_it_has_nothing_to_tell() -> None:
    assert module_class('attitude') is Attitude
    robot = Robot(start=False)
    assert robot.module.statistics() == {}
    robot.module.change('declination_deg', 5.0)
    robot.module.changes.clear()


def test_the_simulated_sensor_is_followed() -> None:
    from rt_robot_os.sim import world
    robot = Robot(filter='mahony')
    errors = []
    for number in range(3000):
        time_s = number / 100
        x, y, z = world.body_vector(time_s, (0.0, 0.0, G))
        robot.imu.msg.linear_acceleration = (x, y, z)
        robot.imu.msg.angular_velocity = world.angular_velocity(time_s - 0.005)
        robot.mag.msg.magnetic_field = world.body_vector(time_s, world.EARTH_FIELD_T)
        stamp_ns = 2000 * MS + number * 10 * MS
        robot.mag.publish(stamp_ns)
        robot.imu.publish(stamp_ns)
        robot.module.job()
        w, x, y, z = world.quaternion(time_s)
        errors += [angle(turned, (x, y, z, w)) for _, turned in robot.said()]
    assert len(errors) == 3000
    assert max(errors) < 0.5


def test_up_in_the_sensor_is_up_in_the_world() -> None:
    # A check of the check: half a turn about x, and gravity is along minus z.
    assert seen((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, -1.0))


@pytest.mark.parametrize(
    ('sensor_hz', 'expected_hz'), [(100.0, 100.0), (1000.0, 400.0), (0.0, 400.0)])
def test_as_many_samples_are_expected_as_the_sensor_sends(
        sensor_hz: float, expected_hz: float) -> None:
    """The module looks more often than samples come: top showed 100 of 400, like a fault."""
    bus = Bus(Kernel(VirtualClock()))
    for topic, message in (('imu/data', 'Imu'), ('imu/mag', 'MagneticField')):
        bus.declare(topic, f'sensor_msgs/msg/{message}', {'header.frame_id': 'imu_link'},
                    rate_hz=sensor_hz)
    Attitude('attitude', {**DEFAULTS, 'filter': 'mahony'}).declare(bus, 400.0)
    assert bus.topic('attitude/imu').rate_hz == expected_hz

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

"""Chips on one I2C bus with each fault: the diagnosis says which and what to do, others run on."""

from __future__ import annotations

from collections.abc import Iterator
import re

from i2c_robot import I2cRobot
from i2c_robot import MS
from i2c_robot import S
import pytest
from rt_robot_os.devices.i2c.device import I2cDevice
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.state import DeviceState

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

# driver -> samples a second, what is said of a chip that answers and measures nothing.
KINDS = {
    'bmp280': (25, 'a conversion does not end|measures nothing'),
    'bmp388': (25, 'measures nothing'),
    'ms5611': (20, 'it made no conversion'),
    'mpu6050': (100, 'measures nothing'),
}


def test_every_i2c_driver_is_here() -> None:
    assert set(KINDS) == {
        name for name in DRIVERS.names() if issubclass(DRIVERS.load(name), I2cDevice)}


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def robot(kind: str) -> Iterator[I2cRobot]:
    """Give the device ``dut`` and another one on its bus, which is to run on."""
    made = I2cRobot()
    made.add('dut', kind)
    other = 'mpu6050' if kind != 'mpu6050' else 'bmp280'
    made.add('other', other)
    made.run(2)
    for managed in made.devices.values():
        assert (managed.state, managed.faults) == (DeviceState.ACTIVE, 0)
    yield made
    assert made.devices['other'].faults == 0
    assert made.devices['other'].device.statistics().lost_samples == 0
    assert made.samples('other', 1) == pytest.approx(KINDS[other][0], abs=2)
    assert not made.kernel.failures


def recovers(robot: I2cRobot, kind: str) -> None:
    robot.run(1.5)
    assert robot.devices['dut'].state is DeviceState.ACTIVE, robot.devices['dut'].reason
    assert robot.samples('dut', 2) == pytest.approx(2 * KINDS[kind][0], abs=3)


def test_samples_come_through_the_topics(robot: I2cRobot, kind: str) -> None:
    robot.take('dut/topic')
    robot.run(0.5)
    assert robot.take('dut/topic') == pytest.approx(KINDS[kind][0] / 2, abs=2)
    assert not robot.errors('dut')


@pytest.mark.parametrize('fault', ['nack', 'unplug'])
def test_unplugged_and_plugged_in_again(robot: I2cRobot, kind: str, fault: str) -> None:
    robot.inject('dut', fault, 2.0)
    robot.run(1.9)
    texts = robot.errors('dut')
    assert len(texts) == 1
    assert re.match('I2C bus i2c-sim, address 0x..: no device answers: check its power', texts[0])
    assert robot.devices['dut'].faults > 3
    recovers(robot, kind)


def test_another_chip_in_its_place(robot: I2cRobot, kind: str) -> None:
    robot.inject('dut', 'wrong', 4.0)
    robot.run(3.9)
    assert any('it is probably a' in text and 'change type or address' in text
               for text in robot.errors('dut')), robot.errors('dut')
    recovers(robot, kind)


def test_a_chip_that_measures_no_more(robot: I2cRobot, kind: str) -> None:
    robot.inject('dut', 'silent', 3.0)
    robot.run(2.9)
    assert re.search(KINDS[kind][1], robot.errors('dut')[0]), robot.errors('dut')
    recovers(robot, kind)


def test_garbage(robot: I2cRobot, kind: str) -> None:
    robot.inject('dut', 'garbage', 5.0)
    robot.run(4.9)
    assert robot.errors('dut')
    assert all(text.startswith('I2C bus i2c-sim, address') or 'no valid frame' in text
               or 'measures nothing' in text for text in robot.errors('dut')), robot.errors('dut')
    recovers(robot, kind)


def test_a_power_dip_between_two_polls(robot: I2cRobot, kind: str) -> None:
    robot.inject('dut', 'unplug', 1e-6)
    recovers(robot, kind)
    last_ns = robot.devices['dut'].device.statistics().last_frame_ns
    assert last_ns > robot.kernel.now_ns() - 100 * MS


def test_the_same_measurement_again_and_again(robot: I2cRobot, kind: str) -> None:
    robot.inject('dut', 'stuck', 1.0)
    assert robot.samples('dut', 1) == pytest.approx(KINDS[kind][0], abs=2)


@pytest.mark.parametrize('fault, said', [
    ('hold', 'a device holds SDA or SCL low'), ('vanish', 'the bus is gone')])
def test_a_fault_of_the_bus_is_one_of_all_on_it(fault: str, said: str) -> None:
    robot = I2cRobot()
    robot.add('baro', 'bmp280')
    robot.add('imu', 'mpu6050')
    robot.run(2)
    robot.inject('baro', fault, 1.0)
    robot.run(0.9)
    for name in ('baro', 'imu'):
        assert said in robot.errors(name)[0]
        assert len(robot.errors(name)) == 1
    robot.run(2)
    assert robot.samples('baro', 1) == pytest.approx(25, abs=2)
    assert robot.samples('imu', 1) == pytest.approx(100, abs=2)


def test_many_chips_share_one_bus_and_none_loses_anything() -> None:
    robot = I2cRobot()
    robot.add('a', 'bmp280', address=0x76)
    robot.add('b', 'ms5611', address=0x77)
    robot.add('c', 'mpu6050', address=0x68)
    robot.add('d', 'mpu6050', address=0x69, output_rate_hz=200.0)
    robot.run(5)
    assert robot.buses.open_count == 1
    for name, rate in (('a', 25), ('b', 20), ('c', 100), ('d', 200)):
        assert robot.samples(name, 2) == pytest.approx(2 * rate, abs=4)
        statistics = robot.devices[name].device.statistics()
        assert statistics.lost_samples == statistics.rejected_frames == 0
    robot.manager.close()
    assert robot.buses.open_count == 0


@pytest.mark.parametrize('kind, rate', [('ms5611', 20), ('bmp280', 10)])
def test_a_slow_bus_spoils_no_conversion(kind: str, rate: int) -> None:
    # At 10 kHz a command takes 2 ms, more than a conversion is faster than its longest time.
    robot = I2cRobot()
    managed = robot.add('dut', kind, sim={'clock_hz': 10_000}, output_rate_hz=float(rate))
    robot.run(2)
    assert robot.samples('dut', 2) == pytest.approx(2 * rate, abs=2)
    assert managed.device.statistics().rejected_frames == 0 and managed.faults == 0


def test_the_same_robot_runs_the_same_each_time() -> None:
    def one() -> list[tuple[int, int]]:
        robot = I2cRobot()
        robot.add('a', 'bmp280', sim={'faults': ['unplug at 1 for 0.5', 'corrupt at 2 for 1']})
        robot.add('b', 'mpu6050', sim={'faults': ['garbage at 2 for 1']})
        seen = []
        for _ in range(20):
            robot.run(0.25)
            seen += [(d.device.statistics().samples, d.faults) for d in robot.devices.values()]
        return seen

    assert one() == one()


def test_a_live_setting_changes_between_two_polls() -> None:
    robot = I2cRobot()
    managed = robot.add('a', 'bmp280', sim={'noise_pa': 0.0, 'swing_m': 0.0, 'altitude_m': 0.0})
    robot.run(1)
    managed.device.change('sea_level_pa', 102_325.0)
    robot.run(0.5)
    reader = robot.readers['a/altitude_topic']
    heights = []
    while reader.take():
        heights.append(reader.msg.pose.pose.position.z)
    assert heights[-1] == pytest.approx(82.9, abs=0.5)
    assert managed.device.settings['sea_level_pa'] == 102_325.0
    assert reader.msg.header.frame_id == 'map'
    assert reader.stamp_ns > S

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

"""The MPU-6050: ranges and units, the FIFO when polls come late, its relatives, calibration."""

from __future__ import annotations

import math
from typing import Any

from driver_fakes import settings_of
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from i2c_bench import i2c_rig
from i2c_bench import I2cRig
from i2c_bench import MS
from i2c_bench import S
from i2c_bench import START_NS
from i2c_contract import I2cContract
import numpy as np
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.mpu6050 import wire as chip
from rt_robot_os.devices.mpu6050.driver import Mpu6050
from rt_robot_os.devices.mpu6050.simulated import SimulatedMpu6050
from rt_robot_os.sim.world import angular_velocity
from rt_robot_os.sim.world import body_vector

GRAVITY = 9.80665
QUIET = {'noise': 0.0}
WORD = st.integers(-32768, 32767)


class TestMpu6050(I2cContract):
    driver = Mpu6050
    simulator = SimulatedMpu6050
    named = 'an MPU-6050, MPU-6500 or MPU-9250 has 0x68 or 0x70 or 0x71'
    stranger = 'probably a BMP280'


def rows(rig: I2cRig, name: str) -> Any:
    return np.array([tuple(vars(getattr(s, name)).values()) for s in rig.publishers[0].samples])


# --- bytes ---------------------------------------------------------------------------------------

@given(st.lists(st.tuples(*[WORD] * 7), max_size=6), st.binary(max_size=13))
def test_frames_are_big_endian_and_whole(values: list[Any], rest: bytes) -> None:
    data = b''.join(chip.pack(v) for v in values)
    assert chip.frames(data + rest) == values


def test_a_frame_as_it_is_on_the_wire() -> None:
    data = bytes.fromhex('4000 c000 0001 f0f0 7fff 8000 ffff'.replace(' ', ''))
    assert chip.frames(data) == [(16384, -16384, 1, -3856, 32767, -32768, -1)]


# --- units ---------------------------------------------------------------------------------------

@pytest.mark.parametrize('gyro', chip.GYRO_RANGES_DEG_S)
@pytest.mark.parametrize('accel', chip.ACCEL_RANGES_G)
def test_si_units_in_every_range(gyro: int, accel: int) -> None:
    with i2c_rig(SimulatedMpu6050, Mpu6050, QUIET, gyro_range_deg_s=gyro,
                 accel_range_g=accel) as rig:
        rig.run(3000)
        # The first sample is some ms after waking; find it by the best agreement.
        linear, rate = rows(rig, 'linear_acceleration'), rows(rig, 'angular_velocity')
        times = (np.array(rig.publishers[0].stamps) - START_NS) / S
        force = np.array([body_vector(t, (0.0, 0.0, GRAVITY)) for t in times])
        turn = np.array([angular_velocity(t) for t in times])
        assert np.abs(linear - force).max() < 0.02 + accel * GRAVITY / 32768
        assert np.abs(rate - turn).max() < 0.01 + math.radians(gyro) / 32768
        sample = rig.publishers[0].samples[-1]
        assert sample.orientation_covariance[0] == -1
        assert sample.angular_velocity_covariance[[0, 4, 8]].tolist() == pytest.approx([4e-6] * 3)
        assert sample.linear_acceleration_covariance[1] == 0


@pytest.mark.parametrize('model', chip.MODELS.values(), ids=lambda m: m.name)
def test_the_relatives_are_recognised(model: chip.Model) -> None:
    with i2c_rig(SimulatedMpu6050, Mpu6050, {'model': model.name, 'temperature_c': 41.5}) as rig:
        rig.run(1000)
        assert rig.device.model is model
        assert rig.publishers[1].samples[-1].temperature == pytest.approx(41.5, abs=0.01)
        assert (rig.chip.registers[chip.ACCEL_CONFIG_2] != 0) == model.accel_filter


def test_one_count_is_what_the_data_sheet_says() -> None:
    # 16384 counts a g at 2 g, 131 counts a deg/s at 250 deg/s.
    device: Any = Mpu6050('imu', settings_of(Mpu6050, port='x', gyro_range_deg_s=250,
                                             accel_range_g=2))
    assert device._accel[1][0] * 16384 == pytest.approx(GRAVITY)
    assert math.degrees(device._gyro[1][0]) * 131 == pytest.approx(1.0, rel=1e-3)


# --- the FIFO ------------------------------------------------------------------------------------

@pytest.mark.parametrize('step_ms', [0.5, 3.0, 10.0, 37.0])
def test_no_sample_is_lost_or_doubled_however_polls_come(step_ms: float) -> None:
    with i2c_rig(SimulatedMpu6050, Mpu6050, output_rate_hz=100.0) as rig:
        rig.run(5000, step_ms=step_ms)
        published = len(rig.publishers[0].samples)
        waiting = len(rig.chip.fifo) // chip.FRAME_SIZE
        assert published + waiting == rig.chip.queued > 450
        assert rig.device.statistics().lost_samples == 0


@pytest.mark.parametrize('drift', [-0.02, 0.0, 0.02])
def test_stamps_follow_the_clock_of_the_chip(drift: float) -> None:
    with i2c_rig(SimulatedMpu6050, Mpu6050, {'drift': drift}, output_rate_hz=200.0) as rig:
        rig.run(5000, step_ms=7.0)
        stamps = np.array(rig.publishers[0].stamps)
        steps = np.diff(stamps) / MS
        assert steps.mean() == pytest.approx(5.0 / (1 + drift), rel=0.005)
        assert steps.min() > 0
        true = START_NS + np.arange(len(stamps)) * round(5 * MS / (1 + drift))
        error = stamps - true
        assert np.ptp(error) < 12 * MS


def test_a_fifo_that_ran_over_is_emptied_and_the_loss_counted() -> None:
    with i2c_rig(SimulatedMpu6050, Mpu6050, QUIET) as rig:
        rig.run(1000)
        before = len(rig.publishers[0].samples)
        rig.now_ns += 3 * S
        assert rig.device.read(rig.now_ns) == 0
        assert rig.device.statistics().lost_samples == pytest.approx(300, abs=2)
        rig.run(1000)
        assert len(rig.publishers[0].samples) - before == pytest.approx(100, abs=2)
        linear = rows(rig, 'linear_acceleration')
        assert np.abs(np.linalg.norm(linear, axis=1) - GRAVITY).max() < 0.01


def test_one_poll_fetches_no_more_than_eight_frames() -> None:
    with i2c_rig(SimulatedMpu6050, Mpu6050, output_rate_hz=200.0) as rig:
        rig.run(1000)
        rig.now_ns += 200 * MS
        before, rig.bus_ns = len(rig.publishers[0].samples), 0
        rig.device.read(rig.now_ns)
        assert len(rig.publishers[0].samples) - before == 8
        assert rig.bus_ns < 3 * MS
        rig.run(300)
        assert len(rig.publishers[0].samples) - before == pytest.approx(100, abs=2)


@pytest.mark.parametrize('cut', range(1, 14))
def test_a_fifo_out_of_step_is_noticed_by_the_temperature(cut: int) -> None:
    # 85 degrees are 16480 counts: few other words look like that by chance.
    with i2c_rig(SimulatedMpu6050, Mpu6050, QUIET) as rig:
        rig.run(1000)
        del rig.chip.fifo[:]
        rig.now_ns += 100 * MS
        rig.chip.update(rig.now_ns)
        del rig.chip.fifo[:cut]
        rig.run(2000)
        linear = rows(rig, 'linear_acceleration')[-50:]
        if cut % 2:
            assert np.abs(np.linalg.norm(linear, axis=1) - GRAVITY).max() < 50


def test_a_count_that_cannot_be_is_rejected() -> None:
    with i2c_rig(SimulatedMpu6050, Mpu6050) as rig:
        rig.run(500)
        rig.chip.read = lambda register, now: 0xFF
        with pytest.raises(DeviceError, match='its FIFO cannot hold the 65535 bytes'):
            rig.run(100)
        assert rig.device.statistics().rejected_frames == 3


def test_another_chip_in_its_place_is_noticed_within_a_second() -> None:
    with i2c_rig(SimulatedMpu6050, Mpu6050) as rig:
        rig.run(500)
        rig.chip.inject('wrong', 5.0)
        assert 'the chip id was 0x68 and is 0x00 now' in rig.run_until_error(1100)


# --- settings ------------------------------------------------------------------------------------

@given(divider=st.integers(0, 255))
def test_every_rate_that_the_chip_has_is_taken(divider: int) -> None:
    device: Any = Mpu6050('imu', settings_of(
        Mpu6050, port='x', output_rate_hz=1000 / (divider + 1)))
    assert device.divider == divider


@pytest.mark.parametrize('rate, near', [(300.0, '333.333'), (2.0, '3.90625'), (700.0, '1000')])
def test_other_rates_are_refused_with_the_nearest(rate: float, near: str) -> None:
    with pytest.raises(ConfigError, match=f'imu: output_rate_hz {rate:g} .* use {near}'):
        Mpu6050('imu', settings_of(Mpu6050, port='x', output_rate_hz=rate))


def test_calibration_and_mounting() -> None:
    plain, corrected = (
        {}, {'axes': 'y -x z', 'acceleration_offset': [0.1, -0.2, 0.3],
             'acceleration_scale': [1.01, 0.99, 1.0],
             'angular_velocity_offset': [0.01, 0.02, -0.03]})
    found = []
    for settings_ in (plain, corrected):
        with i2c_rig(SimulatedMpu6050, Mpu6050, QUIET, **settings_) as rig:
            rig.run(1000)
            found.append((rows(rig, 'linear_acceleration'), rows(rig, 'angular_velocity')))
    (raw, turn), (fixed, turned) = found
    assert fixed[:, 0] == pytest.approx(0.99 * (raw[:, 1] + 0.2))
    assert fixed[:, 1] == pytest.approx(-1.01 * (raw[:, 0] - 0.1))
    assert fixed[:, 2] == pytest.approx(raw[:, 2] - 0.3)
    assert turned[:, 0] == pytest.approx(turn[:, 1] - 0.02)
    assert turned[:, 2] == pytest.approx(turn[:, 2] + 0.03)


@settings(max_examples=20)
@given(st.sampled_from([('axes', 'x y'), ('axes', 'x y -z'), ('acceleration_offset', [1.0]),
                        ('angular_velocity_scale', [1.0] * 4)]))
def test_a_calibration_that_is_none_is_refused(change: tuple[str, Any]) -> None:
    with pytest.raises(ConfigError, match=f'imu.{change[0]} = '):
        Mpu6050('imu', settings_of(Mpu6050, port='x', **dict([change])))

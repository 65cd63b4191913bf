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

"""The BMP280: the data sheet's example, its modes, and the simulated one against the formula."""

from __future__ import annotations

from driver_fakes import settings_of
from hypothesis import given
from hypothesis import strategies as st
from i2c_bench import i2c_rig
from i2c_bench import MS
from i2c_bench import START_NS
from i2c_contract import I2cContract
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.bmp280 import wire as chip
from rt_robot_os.devices.bmp280.driver import Bmp280
from rt_robot_os.devices.bmp280.simulated import encode
from rt_robot_os.devices.bmp280.simulated import SimulatedBmp280
from rt_robot_os.devices.bmp280.simulated import TRIMMING

RAW_P, RAW_T = 415148, 519888
QUIET = {'noise_pa': 0.0, 'swing_m': 0.0}
TEMPERATURES = st.floats(-40.0, 85.0)
PRESSURES = st.floats(30_000.0, 110_000.0)


class TestBmp280(I2cContract):
    driver = Bmp280
    simulator = SimulatedBmp280
    named = 'a BMP280 has 0x58'
    stranger = 'probably a MPU-6050'


class TestBmp280Normal(I2cContract):
    """The same in the normal mode."""

    driver = Bmp280
    simulator = SimulatedBmp280
    named = 'a BMP280 has 0x58'
    stranger = 'probably a MPU-6050'

    def rig(self, sim: object = None, **more: object) -> object:
        return super().rig(sim, **{'mode': 'normal', **more})  # type: ignore[arg-type]


def test_the_example_of_the_data_sheet() -> None:
    pressure, temperature = chip.compensate(TRIMMING, RAW_P, RAW_T)
    assert (round(pressure, 2), round(temperature, 2)) == (100653.27, 25.08)
    # The data sheet prints 25767236; its own formula, in C, gives 25767233, which is 0.01 Pa less.
    assert chip.compensate_int64(TRIMMING, RAW_P, RAW_T) == (25767233, 2508, 128422)


@given(raw_p=st.integers(0, (1 << 20) - 1), raw_t=st.integers(0, (1 << 20) - 1))
def test_the_two_compensations_agree(raw_p: int, raw_t: int) -> None:
    pressure, temperature = chip.compensate(TRIMMING, raw_p, raw_t)
    exact, hundredths, _ = chip.compensate_int64(TRIMMING, raw_p, raw_t)
    # The integers keep 5120ths of a degree; pressure depends on them.
    assert temperature == pytest.approx(hundredths / 100, abs=0.011)
    if 30_000 < pressure < 110_000 and -40 <= temperature <= 85:
        assert pressure == pytest.approx(exact / 256, abs=0.6)


@given(raw_t=st.integers(RAW_T - 150_000, RAW_T + 150_000),
       raws=st.lists(st.integers(0, (1 << 20) - 1), min_size=2, max_size=8, unique=True))
def test_more_counts_are_less_pressure(raw_t: int, raws: list[int]) -> None:
    found = [chip.compensate(TRIMMING, raw, raw_t)[0] for raw in sorted(raws)]
    assert found == sorted(found, reverse=True)


@given(raws=st.lists(st.integers(0, (1 << 20) - 1), min_size=2, max_size=8, unique=True))
def test_more_counts_are_more_degrees(raws: list[int]) -> None:
    found = [chip.compensate(TRIMMING, RAW_P, raw)[1] for raw in sorted(raws)]
    assert found == sorted(found)


@given(data=st.binary(min_size=24, max_size=24), raws=st.binary(min_size=6, max_size=6))
def test_any_trimming_and_any_reading_raise_nothing(data: bytes, raws: bytes) -> None:
    trimming = chip.Bmp280Trimming.unpack(data)
    if trimming is not None:
        assert trimming.pack() == data
        chip.compensate(trimming, *chip.raw(raws))
        chip.compensate_int64(trimming, *chip.raw(raws))


@pytest.mark.parametrize('data', [bytes(24), b'\xff' * 24, bytes(6) + TRIMMING.pack()[6:]])
def test_a_blank_trimming_is_none(data: bytes) -> None:
    assert chip.Bmp280Trimming.unpack(data) is None


@given(pressure=PRESSURES, temperature=TEMPERATURES)
def test_the_twin_encodes_what_the_integer_formula_decodes(
        pressure: float, temperature: float) -> None:
    raw_p, raw_t = encode(TRIMMING, pressure, temperature)
    exact, hundredths, _ = chip.compensate_int64(TRIMMING, raw_p, raw_t)
    assert hundredths / 100 == pytest.approx(temperature, abs=0.011)
    assert exact / 256 == pytest.approx(pressure, abs=0.6)


@pytest.mark.parametrize('mode', ['forced', 'normal'])
@pytest.mark.parametrize('over', [1, 2, 4, 8, 16])
def test_what_the_twin_measures_is_published_in_si_units(mode: str, over: int) -> None:
    sim = {**QUIET, 'altitude_m': 540.3, 'temperature_c': 17.25}
    with i2c_rig(SimulatedBmp280, Bmp280, sim, mode=mode, pressure_oversampling=over,
                 temperature_oversampling=2, output_rate_hz=10.0) as rig:
        rig.run(2000)
        pressure, temperature, altitude = (p.samples[-1] for p in rig.publishers)
        # 16 bit at the least: steps of 2.6 Pa and 5 mK.
        assert pressure.fluid_pressure == pytest.approx(95_000, abs=4.0)
        assert pressure.variance == pytest.approx(1.69)
        assert temperature.temperature == pytest.approx(17.25, abs=0.01)
        assert altitude.pose.pose.position.z == pytest.approx(540.3, abs=0.4)
        assert altitude.pose.covariance[14] == pytest.approx((1.3 * 0.0885) ** 2, rel=0.05)
        assert altitude.pose.covariance[0] == altitude.pose.covariance[35] == 1e6


def test_the_altitude_follows_a_change_of_the_pressure_at_sea_level() -> None:
    with i2c_rig(SimulatedBmp280, Bmp280, {**QUIET, 'altitude_m': 100.0}) as rig:
        rig.run(500)
        assert rig.publishers[2].samples[-1].pose.pose.position.z == pytest.approx(100, abs=0.4)
        assert rig.device.change('sea_level_pa', 102_325) == 102_325.0
        before = len(rig.publishers[2].samples)
        rig.run(100)
        assert rig.publishers[2].samples[before].pose.pose.position.z == pytest.approx(
            100, abs=0.4)  # nobody has taken it over: the SensorManager does
        rig.device.apply_changes()
        rig.run(100)
        assert rig.publishers[2].samples[-1].pose.pose.position.z == pytest.approx(183, abs=1)
        with pytest.raises(ConfigError, match='dut.sea_level_pa = 10: must be a number from 8'):
            rig.device.change('sea_level_pa', 10)


def test_a_forced_sample_is_stamped_with_the_end_of_its_conversion() -> None:
    with i2c_rig(SimulatedBmp280, Bmp280, output_rate_hz=10.0) as rig:
        rig.run(2000, step_ms=7.0)
        stamps = rig.publishers[0].stamps
        # However late the poll: on the grid of the polls, 13.325 ms after one of them.
        assert {(s - START_NS - 13_325_000) % (7 * MS) for s in stamps} == {0}


def test_forced_conversions_are_exactly_those_that_are_published() -> None:
    with i2c_rig(SimulatedBmp280, Bmp280) as rig:
        rig.run(3000)
        assert 0 <= rig.chip.conversions - len(rig.publishers[0].samples) <= 1


def test_late_polls_lose_samples_and_count_them() -> None:
    with i2c_rig(SimulatedBmp280, Bmp280, output_rate_hz=50.0) as rig:
        rig.run(10_000, step_ms=50.0)
        statistics = rig.device.statistics()
        assert statistics.frames + statistics.lost_samples == pytest.approx(500, abs=10)
        assert statistics.lost_samples > 200


def test_the_filter_of_the_chip_smooths() -> None:
    def spread(coefficient: int) -> float:
        sim = {'noise_pa': 20.0, 'swing_m': 0.0}
        with i2c_rig(SimulatedBmp280, Bmp280, sim, filter=coefficient) as rig:
            rig.run(8000)
            found = [s.fluid_pressure for s in rig.publishers[0].samples[50:]]
            mean = sum(found) / len(found)
            return float((sum((f - mean) ** 2 for f in found) / len(found)) ** 0.5)

    assert spread(0) == pytest.approx(20, rel=0.3)
    assert spread(16) < 6


def test_an_oversampling_too_slow_for_the_rate_is_refused() -> None:
    with pytest.raises(ConfigError, match='baro: output_rate_hz 100 is more than the 24.4 Hz'):
        Bmp280('baro', settings_of(Bmp280, port='x', output_rate_hz=100.0,
                                   pressure_oversampling=16))

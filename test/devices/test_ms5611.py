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

"""The MS5611: examples of data sheet and note, second order, commands, simulated device."""

from __future__ import annotations

from driver_fakes import settings_of
from hypothesis import given
from hypothesis import strategies as st
from i2c_bench import i2c_rig
from i2c_bench import MS
from i2c_contract import I2cContract
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.ms5611 import wire as chip
from rt_robot_os.devices.ms5611.driver import Ms5611
from rt_robot_os.devices.ms5611.simulated import encode
from rt_robot_os.devices.ms5611.simulated import PROM
from rt_robot_os.devices.ms5611.simulated import SimulatedMs5611
from rt_robot_os.devices.ms5611.simulated import with_checksum

WORD = st.integers(0, 0xFFFF)


class TestMs5611(I2cContract):
    driver = Ms5611
    simulator = SimulatedMs5611
    named = 'it is not an MS5611'
    stranger = 'probably a BMP280'


def test_the_example_of_the_data_sheet() -> None:
    assert chip.compensate_int(PROM, 9085466, 8569150) == (100009, 2007)
    pressure, temperature = chip.compensate(PROM, 9085466, 8569150)
    assert pressure == pytest.approx(100009, abs=0.5)
    assert temperature == pytest.approx(20.07, abs=0.01)


def test_the_checksum_of_the_note() -> None:
    words = (0x3132, 0x3334, 0x3536, 0x3738, 0x3940, 0x4142, 0x4344, 0x4500)
    assert chip.crc4(words) == 0xB
    assert chip.valid((*words[:7], 0x450B)) and not chip.valid(words)


@given(words=st.tuples(*[WORD] * 8), word=st.integers(0, 7), bit=st.integers(0, 15))
def test_every_flipped_bit_is_found(words: tuple[int, ...], word: int, bit: int) -> None:
    good = with_checksum(words)
    assert good[7] & 0xF == chip.crc4(good)
    damaged = list(good)
    damaged[word] ^= 1 << bit
    # The low byte of the last word holds the checksum; its other half is not covered.
    if word < 7 or bit >= 8 or bit < 4:
        assert not chip.valid(tuple(damaged))


@pytest.mark.parametrize('blank', [(0,) * 8, (0,) * 7 + (0x5A00,)])
def test_a_blank_prom_is_not_valid(blank: tuple[int, ...]) -> None:
    assert not chip.valid(with_checksum(blank))


@given(raw_p=st.integers(3_000_000, 12_000_000), raw_t=st.integers(4_000_000, 10_000_000))
def test_the_two_compensations_agree_at_all_temperatures(raw_p: int, raw_t: int) -> None:
    pressure, temperature = chip.compensate(PROM, raw_p, raw_t)
    whole, hundredths = chip.compensate_int(PROM, raw_p, raw_t)
    assert temperature == pytest.approx(hundredths / 100, abs=0.03)
    # At the integers' steps of 0.01 degrees the second order moves by some Pa when it is cold.
    assert pressure == pytest.approx(whole, abs=2 + abs(min(temperature, 0)) * 0.5)


def test_the_second_order_counts_below_20_degrees_and_more_below_minus_15() -> None:
    def first_order(raw_p: int, raw_t: int) -> tuple[float, float]:
        _, c1, c2, c3, c4, c5, c6, _ = PROM
        d = raw_t - c5 * 256.0
        return ((raw_p * (c1 * 32768.0 + c3 * d / 256) / 2097152 - c2 * 65536.0 - c4 * d / 128)
                / 32768, 20 + d * c6 / 838860800)

    warm, cold, colder = (encode(PROM, 100_000, t) for t in (25, -10, -35))
    assert chip.compensate(PROM, *warm) == pytest.approx(first_order(*warm))
    assert chip.compensate(PROM, *cold)[1] < first_order(*cold)[1] - 0.5
    assert chip.compensate(PROM, *colder)[1] < first_order(*colder)[1] - 3


@given(pressure=st.floats(10_000, 120_000), temperature=st.floats(-40, 85))
def test_the_twin_encodes_what_the_integer_formula_decodes(
        pressure: float, temperature: float) -> None:
    raw_p, raw_t = encode(PROM, pressure, temperature)
    whole, hundredths = chip.compensate_int(PROM, raw_p, raw_t)
    assert hundredths / 100 == pytest.approx(temperature, abs=0.03)
    assert whole == pytest.approx(pressure, abs=2 + abs(min(temperature, 0)) * 0.5)


@given(raw_t=st.integers(6_000_000, 9_500_000), raws=st.lists(
    st.integers(0, (1 << 24) - 1), min_size=2, max_size=8, unique=True))
def test_more_counts_are_more_pressure(raw_t: int, raws: list[int]) -> None:
    found = [chip.compensate(PROM, raw, raw_t)[0] for raw in sorted(raws)]
    assert found == sorted(found)


@pytest.mark.parametrize('oversampling', chip.OVERSAMPLING)
@pytest.mark.parametrize('step_ms', [1.0, 10.0])
def test_si_units_at_every_oversampling(oversampling: int, step_ms: float) -> None:
    sim = {'noise_pa': 0.0, 'swing_m': 0.0, 'altitude_m': 540.3, 'temperature_c': 31.0}
    with i2c_rig(SimulatedMs5611, Ms5611, sim, oversampling=oversampling) as rig:
        rig.run(2000, step_ms=step_ms)
        pressure, temperature, altitude = (p.samples[-1] for p in rig.publishers)
        assert len(rig.publishers[0].samples) == pytest.approx(40, abs=2)
        assert pressure.fluid_pressure == pytest.approx(95_000, abs=1.5)
        assert temperature.temperature == pytest.approx(31.0, abs=0.01)
        assert altitude.pose.pose.position.z == pytest.approx(540.3, abs=0.2)


def test_a_conversion_is_fetched_no_earlier_than_it_can_be_done() -> None:
    # A chip that takes as long as the data sheet allows, and polls without end.
    with i2c_rig(SimulatedMs5611, Ms5611, output_rate_hz=50.0) as rig:
        rig.run(3000, step_ms=0.1)
        assert rig.device.statistics().rejected_frames == 0
        stamps = rig.publishers[0].stamps
        assert min(b - a for a, b in zip(stamps, stamps[1:])) >= 18 * MS


def test_a_chip_that_makes_no_conversions_is_given_up_with_the_reason() -> None:
    with i2c_rig(SimulatedMs5611, Ms5611) as rig:
        rig.chip.inject('silent', 5.0)
        assert 'it gives 0, so it made no conversion' in rig.run_until_error(1000)


def test_noise_on_the_prom_is_an_error_that_shows_both_checksums() -> None:
    with i2c_rig(SimulatedMs5611, Ms5611, {'faults': ['garbage at 0 for 9']},
                 is_open=False) as rig:
        for _ in range(40):
            try:
                rig.device.open()
            except DeviceError as error:
                assert 'the checksum of its PROM is 0x' in str(error)
                return
        pytest.fail('every PROM of noise was taken for a good one')


def test_an_oversampling_too_slow_for_the_rate_is_refused() -> None:
    with pytest.raises(ConfigError, match='baro: output_rate_hz 100 is more than the 55.3 Hz'):
        Ms5611('baro', settings_of(Ms5611, port='x', output_rate_hz=100.0))

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

"""The BMP388: its formula against exact fractions, its modes, and its simulated device."""

from __future__ import annotations

from fractions import Fraction

from driver_fakes import settings_of
from hypothesis import given
from hypothesis import strategies as st
from i2c_bench import i2c_rig
from i2c_contract import I2cContract
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.bmp388 import wire as chip
from rt_robot_os.devices.bmp388.driver import Bmp388
from rt_robot_os.devices.bmp388.simulated import encode
from rt_robot_os.devices.bmp388.simulated import SimulatedBmp388
from rt_robot_os.devices.bmp388.simulated import TRIMMING

SCALED = TRIMMING.scaled()
RAW = st.integers(0, (1 << 24) - 1)


class TestBmp388(I2cContract):
    driver = Bmp388
    simulator = SimulatedBmp388
    named = 'a BMP388 or BMP390 has 0x50 or 0x60'
    stranger = 'probably a BMP280'


def exact(trim: chip.Bmp388Trimming, raw_p: int, raw_t: int) -> tuple[Fraction, Fraction]:
    """Compute the formulas of the data sheet in fractions, term by term as they are printed."""
    def scaled(value: int, exponent: int, offset: int = 0) -> Fraction:
        return (Fraction(value) - offset) / Fraction(2) ** exponent

    t1, t2, t3 = scaled(trim.t1, -8), scaled(trim.t2, 30), scaled(trim.t3, 48)
    p1, p2 = scaled(trim.p1, 20, 1 << 14), scaled(trim.p2, 29, 1 << 14)
    p3, p4, p5 = scaled(trim.p3, 32), scaled(trim.p4, 37), scaled(trim.p5, -3)
    p6, p7, p8 = scaled(trim.p6, 6), scaled(trim.p7, 8), scaled(trim.p8, 15)
    p9, p10, p11 = scaled(trim.p9, 48), scaled(trim.p10, 48), scaled(trim.p11, 65)
    d = raw_t - t1
    t = d * t2 + d ** 2 * t3
    out1 = p5 + p6 * t + p7 * t ** 2 + p8 * t ** 3
    out2 = raw_p * (p1 + p2 * t + p3 * t ** 2 + p4 * t ** 3)
    out3 = raw_p ** 2 * (p9 + p10 * t) + raw_p ** 3 * p11
    return out1 + out2 + out3, t


@given(data=st.binary(min_size=21, max_size=21), raw_p=RAW, raw_t=RAW)
def test_the_formula_is_that_of_the_data_sheet(data: bytes, raw_p: int, raw_t: int) -> None:
    trimming = chip.Bmp388Trimming.unpack(data)
    if trimming is None:
        return
    assert trimming.pack() == data
    pressure, temperature = chip.compensate(trimming.scaled(), raw_p, raw_t)
    exact_p, exact_t = exact(trimming, raw_p, raw_t)
    assert temperature == pytest.approx(float(exact_t), rel=1e-9, abs=1e-6)
    assert pressure == pytest.approx(float(exact_p), rel=1e-6, abs=1e-2)


@pytest.mark.parametrize('data', [bytes(21), b'\xff' * 21])
def test_a_blank_trimming_is_none(data: bytes) -> None:
    assert chip.Bmp388Trimming.unpack(data) is None


def test_the_bytes_of_the_trimming_are_where_the_chip_has_them() -> None:
    data = bytes(range(21))
    found = chip.Bmp388Trimming.unpack(data)
    assert found is not None
    assert (found.t1, found.t2, found.t3) == (0x0100, 0x0302, 4)
    assert (found.p1, found.p4, found.p5, found.p6, found.p7) == (0x0605, 10, 0x0C0B, 0x0E0D, 15)
    assert (found.p9, found.p10, found.p11) == (0x1211, 19, 20)


@given(temperature=st.floats(-40, 85), raws=st.lists(
    st.integers(4_000_000, 12_000_000), min_size=2, max_size=8, unique=True))
def test_more_counts_are_less_pressure(temperature: float, raws: list[int]) -> None:
    _, raw_t = encode(SCALED, 1e5, temperature)
    found = [chip.compensate(SCALED, raw, raw_t)[0] for raw in sorted(raws)]
    assert found == sorted(found, reverse=True)


@given(pressure=st.floats(30_000, 125_000), temperature=st.floats(-40, 85))
def test_the_twin_encodes_what_the_exact_formula_decodes(
        pressure: float, temperature: float) -> None:
    raw_p, raw_t = encode(SCALED, pressure, temperature)
    exact_p, exact_t = exact(TRIMMING, raw_p, raw_t)
    assert float(exact_p) == pytest.approx(pressure, abs=0.05)
    assert float(exact_t) == pytest.approx(temperature, abs=1e-4)


@pytest.mark.parametrize('rate_hz', [200.0, 50.0, 6.25, 1.5625])
@pytest.mark.parametrize('step_ms', [0.7, 2.0])
def test_each_measurement_is_published_once(rate_hz: float, step_ms: float) -> None:
    with i2c_rig(SimulatedBmp388, Bmp388, output_rate_hz=rate_hz,
                 pressure_oversampling=1) as rig:
        rig.run(3000, step_ms=step_ms)
        published = len(rig.publishers[0].samples)
        assert rig.chip.conversions - 1 <= published <= rig.chip.conversions
        assert published == pytest.approx(3 * rate_hz, abs=2)


def test_si_units_and_the_altitude() -> None:
    sim = {'noise_pa': 0.0, 'swing_m': 0.0, 'altitude_m': 1000.0, 'temperature_c': -12.5}
    with i2c_rig(SimulatedBmp388, Bmp388, sim) as rig:
        rig.run(500)
        pressure, temperature, altitude = (p.samples[-1] for p in rig.publishers)
        assert pressure.fluid_pressure == pytest.approx(89_874.6, abs=0.1)
        assert temperature.temperature == pytest.approx(-12.5, abs=1e-3)
        assert altitude.pose.pose.position.z == pytest.approx(1000.0, abs=0.02)


def test_an_oversampling_too_slow_for_the_rate_is_refused() -> None:
    with pytest.raises(ConfigError, match='baro: output_rate_hz 50 is more than the 14.8 Hz'):
        Bmp388('baro', settings_of(Bmp388, port='x', output_rate_hz=50.0,
                                   pressure_oversampling=32))


def test_a_chip_that_refuses_the_settings_says_so() -> None:
    with i2c_rig(SimulatedBmp388, Bmp388) as rig:
        rig.device._rate = 0  # as if the check in the driver were wrong
        rig.device._oversampling = chip.OVERSAMPLING[32]
        rig.run(100)
        assert rig.device.statistics().rejected_frames == 1
        assert DeviceError

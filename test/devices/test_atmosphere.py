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

"""The standard atmosphere: known points, round trips, monotone."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.motion.atmosphere import altitude_m
from rt_robot_os.motion.atmosphere import altitude_slope_m_pa
from rt_robot_os.motion.atmosphere import pressure_pa

PRESSURE = st.floats(22_700, 125_000)
SEA_LEVEL = st.floats(80_000, 110_000)


@pytest.mark.parametrize('pressure, altitude', [
    (101_325, 0.0), (95_000, 540.3), (89_874.6, 1000.0), (54_020, 5000.0), (26_436, 10_000.0)])
def test_known_points(pressure: float, altitude: float) -> None:
    assert altitude_m(pressure) == pytest.approx(altitude, abs=0.5)


@given(st.floats(-1000, 11_000), SEA_LEVEL)
def test_round_trip(altitude: float, sea_level: float) -> None:
    assert altitude_m(pressure_pa(altitude, sea_level), sea_level) == pytest.approx(
        altitude, abs=1e-6)


@given(PRESSURE, PRESSURE, SEA_LEVEL)
def test_less_pressure_is_higher(one: float, other: float, sea_level: float) -> None:
    low, high = sorted((one, other))
    assert altitude_m(low, sea_level) >= altitude_m(high, sea_level)


@given(PRESSURE, SEA_LEVEL)
def test_the_slope_is_the_difference(pressure: float, sea_level: float) -> None:
    difference = (altitude_m(pressure + 0.5, sea_level) - altitude_m(pressure - 0.5, sea_level))
    assert altitude_slope_m_pa(pressure, sea_level) == pytest.approx(difference, rel=1e-4)

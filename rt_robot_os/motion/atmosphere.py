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

"""Pressure and altitude in the international standard atmosphere, below 11 km."""

from __future__ import annotations

from typing import Final

SEA_LEVEL_PA: Final = 101325.0
_SCALE_M: Final = 44330.77
_EXPONENT: Final = 0.1902632


def altitude_m(pressure_pa: float, sea_level_pa: float = SEA_LEVEL_PA) -> float:
    """
    Return the altitude at which the standard atmosphere has a pressure.

    :param pressure_pa: above zero.
    :param sea_level_pa: pressure at altitude 0 (QNH), above zero.
    """
    return _SCALE_M * (1.0 - float((pressure_pa / sea_level_pa) ** _EXPONENT))


def altitude_slope_m_pa(pressure_pa: float, sea_level_pa: float = SEA_LEVEL_PA) -> float:
    """Return the change of altitude with pressure, negative; for variances."""
    ratio = pressure_pa / sea_level_pa
    return -_SCALE_M * _EXPONENT * float(ratio ** _EXPONENT) / pressure_pa


def pressure_pa(altitude: float, sea_level_pa: float = SEA_LEVEL_PA) -> float:
    """
    Return the pressure at an altitude, the inverse of :func:`altitude_m`.

    :param altitude: in m, below 44 km.
    """
    return sea_level_pa * float((1.0 - altitude / _SCALE_M) ** (1.0 / _EXPONENT))

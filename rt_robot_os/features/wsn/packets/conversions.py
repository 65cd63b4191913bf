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
Conversions between raw numbers of motes and physical units, in both directions.

For Tmote Sky and TelosB, as described by Boomerang's Oscilloscope: a 12-bit converter, light
sensors of Hamamatsu over 100 kohm, a Sensirion SHT1x. The factors of the light sensors are those
in common use, not calibrated.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from typing import Final
from typing import NamedTuple

_STEPS: Final = 4096
_MOST_ADC: Final = _STEPS - 1
_REFERENCE_V: Final = 1.5
_SUPPLY_REFERENCE_V: Final = 3.0
_LIGHT_RESISTANCE_OHM: Final = 100_000
_PAR_LX_PER_A: Final = 0.625e9
_TSR_LX_PER_A: Final = 0.769e8
_SHT_MOST_TEMPERATURE: Final = (1 << 14) - 1
_KELVIN: Final = 273.15


def sht1x_temperature(raw: float) -> float:
    """Return deg C of an SHT1x, 14 bits."""
    return -39.6 + 0.01 * raw


def sht1x_humidity(raw: float, temperature_deg_c: float = 25.0) -> float:
    """
    Return the relative humidity, 1 at 100 %, of an SHT1x, 12 bits.

    :param temperature_deg_c: at the sensor, for the compensation; none at 25.
    """
    linear = -4.0 + 0.0405 * raw - 2.8e-6 * raw * raw
    return ((temperature_deg_c - 25.0) * (0.01 + 0.00008 * raw) + linear) / 100.0


def adc_volts(raw: float) -> float:
    """Return V at an input of the converter."""
    return raw / _STEPS * _REFERENCE_V


def battery_volts(raw: float) -> float:
    """Return V of the supply; the converter measures half of it."""
    return raw / _STEPS * _SUPPLY_REFERENCE_V


def par_illuminance(raw: float) -> float:
    """Return lx of the sensor for visible light (S1087)."""
    return adc_volts(raw) / _LIGHT_RESISTANCE_OHM * _PAR_LX_PER_A


def tsr_illuminance(raw: float) -> float:
    """Return lx of the sensor for visible and infrared light (S1087-01)."""
    return adc_volts(raw) / _LIGHT_RESISTANCE_OHM * _TSR_LX_PER_A


def centikelvin(raw: float) -> float:
    """Return deg C of hundredths of a kelvin."""
    return raw / 100.0 - _KELVIN


def same(raw: float) -> float:
    """Return the number unchanged."""
    return float(raw)


def _limited(raw: float, most: int) -> int:
    return min(max(round(raw), 0), most)


def sht1x_temperature_raw(deg_c: float) -> int:
    """Return the raw value of an SHT1x, 14 bits."""
    return _limited((deg_c + 39.6) / 0.01, _SHT_MOST_TEMPERATURE)


def sht1x_humidity_raw(fraction: float) -> int:
    """Return the raw value of an SHT1x at 25 deg C, 12 bits."""
    percent = fraction * 100.0
    root = 0.0405 * 0.0405 - 4 * 2.8e-6 * (4.0 + percent)
    return _limited((0.0405 - max(root, 0.0) ** 0.5) / (2 * 2.8e-6), _MOST_ADC)


def adc_raw(volts: float) -> int:
    """Return the raw value of the converter, 12 bits."""
    return _limited(volts / _REFERENCE_V * _STEPS, _MOST_ADC)


def battery_raw(volts: float) -> int:
    """Return the raw value of a supply voltage."""
    return _limited(volts / _SUPPLY_REFERENCE_V * _STEPS, _MOST_ADC)


def par_illuminance_raw(lx: float) -> int:
    """Return the raw value of the sensor for visible light."""
    return adc_raw(lx / _PAR_LX_PER_A * _LIGHT_RESISTANCE_OHM)


def tsr_illuminance_raw(lx: float) -> int:
    """Return the raw value of the sensor for visible and infrared light."""
    return adc_raw(lx / _TSR_LX_PER_A * _LIGHT_RESISTANCE_OHM)


def centikelvin_raw(deg_c: float) -> int:
    """Return hundredths of a kelvin, 16 bits."""
    return _limited((deg_c + _KELVIN) * 100.0, 0xFFFF)


def same_raw(value: float) -> int:
    """Return the nearest integer, 16 bits."""
    return _limited(value, 0xFFFF)


class Conversion(NamedTuple):
    """
    A conversion of raw numbers.

    :ivar unit: of the result.
    :ivar convert: from a raw number to the result.
    :ivar raw: from a result to the raw number, limited to the range of the sensor.
    """

    unit: str
    convert: Callable[[float], float]
    raw: Callable[[float], int]


#: By their names in payloads.
CONVERSIONS: Final[Mapping[str, Conversion]] = {
    'sht1x_temperature': Conversion('degC', sht1x_temperature, sht1x_temperature_raw),
    'sht1x_humidity': Conversion('1', sht1x_humidity, sht1x_humidity_raw),
    'adc_volts': Conversion('V', adc_volts, adc_raw),
    'battery_volts': Conversion('V', battery_volts, battery_raw),
    'par_illuminance': Conversion('lx', par_illuminance, par_illuminance_raw),
    'tsr_illuminance': Conversion('lx', tsr_illuminance, tsr_illuminance_raw),
    'centikelvin': Conversion('degC', centikelvin, centikelvin_raw),
}

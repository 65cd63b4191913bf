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

"""The sentences of a microcontroller with Sharp range finders on its converter."""

from __future__ import annotations

from typing import Final

from rt_robot_os.devices.nmea.wire import sentence

ADC_ADDRESS: Final = 'PADC'
# Of Sharp's infrared range finders: distance in m at 1 V, and exponent.
SHARP_FITS: Final = {'gp2y0a21': (0.27728, -1.2045), 'gp2y0a02': (0.60374, -1.16)}


def adc(channel: int, millivolts: int) -> bytes:
    """Encode a reading of an analogue-to-digital converter: ``$PADC,channel,millivolts*HH``."""
    return sentence(f'{ADC_ADDRESS},{channel},{millivolts}')

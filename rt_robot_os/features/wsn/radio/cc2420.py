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
The CC2420, a radio for IEEE 802.15.4 at 2.4 GHz: timing, reception and LQI.

The probability of receiving a frame and the LQI of received ones are measurements of the chip that
were published with TinyOS.
"""

from __future__ import annotations

from bisect import bisect_right
from math import erfc
from math import log
from math import sqrt
from statistics import NormalDist
from typing import Final

BYTE_NS: Final = 32_000
#: Preamble, start of frame and length go before every frame.
PHY_HEADER_BYTES: Final = 6
TURNAROUND_NS: Final = 192_000
ACK_MPDU_BYTES: Final = 5
LARGEST_MPDU_BYTES: Final = 127
#: Least signal strength of a busy channel.
CCA_THRESHOLD_DBM: Final = -77.0
SENSITIVITY_DBM: Final = -95.0
#: Added to the signed RSSI byte of the chip, it gives dBm.
RSSI_OFFSET: Final = -45
#: Transmit powers in dBm and their currents in mA; others are interpolated.
TRANSMIT_POWERS: Final = (
    (-25.0, 8.5), (-15.0, 9.9), (-10.0, 11.2), (-7.0, 12.5), (-5.0, 13.9), (-3.0, 15.2),
    (-1.0, 16.5), (0.0, 17.4))

_BYTES_OF_PRR: Final = 23
#: Above it every frame is received, below ``WEAKEST_SNR_DB`` none, with an error below 1e-6.
STRONG_SNR_DB: Final = 8.0
WEAKEST_SNR_DB: Final = 3.0
_STEPS_PER_DB: Final = 64

# SNR in dB, mean LQI, its standard deviation.
_LQI: Final = (
    (0, 76.6, 6.0), (2, 79.4, 6.8), (3, 83.7, 7.1), (5, 88.6, 7.3), (6, 91.1, 8.4),
    (7, 93.5, 7.5), (8, 97.3, 5.6), (10, 100.4, 3.9), (11, 102.7, 2.7), (12, 104.2, 2.1),
    (13, 104.9, 1.8), (14, 105.5, 1.65), (15, 105.9, 1.45), (17, 106.6, 1.3), (20, 106.9, 1.25),
    (25, 107.15, 1.1), (30, 107.3, 1.0))
_LARGEST_LQI: Final = 108
_SMALLEST_LQI: Final = 40
_QUANTILES: Final = 128
_MEAN_GUMBEL: Final = 0.5772
_SPREAD_GUMBEL: Final = 1.2825
# Up to the first SNR the distribution is symmetric; from the second on it is skewed: a few frames
# are much worse than most. It matters, because a node selects a weak link that seems good once.
_SKEWED_SNR_DB: Final = (4, 6)


def air_time_ns(mpdu_bytes: int) -> int:
    """Return the air time of a frame, the header of the physical layer included."""
    return (PHY_HEADER_BYTES + mpdu_bytes) * BYTE_NS


def reception_rate(snr_db: float) -> float:
    """Return the probability of receiving a frame at a signal-to-noise ratio."""
    symbol_error = 0.5 * erfc(0.9794 * (snr_db - 2.3851) / sqrt(2))
    return float((1 - symbol_error) ** (2 * _BYTES_OF_PRR))


_RATES: Final = tuple(
    reception_rate(WEAKEST_SNR_DB + (step + 0.5) / _STEPS_PER_DB)
    for step in range(int((STRONG_SNR_DB - WEAKEST_SNR_DB) * _STEPS_PER_DB) + 1))


def is_received(snr_db: float, chance: float) -> bool:
    """
    Decide whether a frame is received.

    :param chance: uniform from 0 to 1.
    """
    if snr_db >= STRONG_SNR_DB:
        return True
    if snr_db < WEAKEST_SNR_DB:
        return False
    return chance < _RATES[int((snr_db - WEAKEST_SNR_DB) * _STEPS_PER_DB)]


def _deviate(snr_db: int, share: float) -> float:
    """Return a quantile of the LQI, in standard deviations from the mean."""
    even = NormalDist().inv_cdf(share)
    skewed = (log(-log(1 - share)) + _MEAN_GUMBEL) / _SPREAD_GUMBEL
    first, last = _SKEWED_SNR_DB
    part = min(max((snr_db - first) / (last - first), 0.0), 1.0)
    return even + part * (skewed - even)


def _quantiles(snr_db: int) -> tuple[int, ...]:
    """Return LQIs of equal probability at an SNR."""
    place = bisect_right(_LQI, (snr_db, 999.0, 0.0))
    low, high = _LQI[max(place - 1, 0)], _LQI[min(place, len(_LQI) - 1)]
    part = 0.0 if high[0] == low[0] else (snr_db - low[0]) / (high[0] - low[0])
    mean = low[1] + part * (high[1] - low[1])
    spread = low[2] + part * (high[2] - low[2])
    shares = ((step + 0.5) / _QUANTILES for step in range(_QUANTILES))
    return tuple(
        min(max(round(mean + spread * _deviate(snr_db, share)), _SMALLEST_LQI), _LARGEST_LQI)
        for share in shares)


_LQIS: Final = tuple(_quantiles(snr_db) for snr_db in range(_LQI[-1][0] + 1))
_LAST_LQI: Final = len(_LQIS) - 1


def lqi(snr_db: float, chance: float) -> int:
    """
    Return the link quality indication of a received frame.

    :param chance: uniform, 0 included and 1 not.
    """
    step = int(snr_db + 0.5)
    return _LQIS[0 if step < 0 else min(step, _LAST_LQI)][int(chance * _QUANTILES)]


def transmit_current_ma(power_dbm: float) -> float:
    """Return the current of sending at a power."""
    (low, current) = TRANSMIT_POWERS[0]
    if power_dbm <= low:
        return current
    for high, more in TRANSMIT_POWERS[1:]:
        if power_dbm <= high:
            return current + (more - current) * (power_dbm - low) / (high - low)
        low, current = high, more
    return current

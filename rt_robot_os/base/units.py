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

"""Units: internally times are integers in nanoseconds; external interfaces use SI floats."""

from __future__ import annotations

from typing import Final

NS_PER_US: Final = 1_000
NS_PER_MS: Final = 1_000_000
NS_PER_S: Final = 1_000_000_000

STANDARD_GRAVITY_M_S2: Final = 9.80665


def period_from_rate(rate_hz: float) -> int:
    """
    Convert a rate to the nearest integer period.

    :param rate_hz: above zero.
    :return: the period in nanoseconds, at least 1.
    """
    return max(1, round(NS_PER_S / rate_hz))

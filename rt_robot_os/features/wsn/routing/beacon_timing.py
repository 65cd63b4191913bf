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

"""Period of the beacon rounds of a moving sink."""

from __future__ import annotations


class BeaconTiming:
    """
    Period of the rounds, by the speed of the sink.

    :param renew_m: distance that the sink travels between two rounds.
    :param shortest_ns: least time between two rounds.
    :param longest_ns: time between two rounds of a sink that does not move.
    """

    def __init__(self, renew_m: float = 0.6, shortest_ns: int = 1_000_000_000,
                 longest_ns: int = 16_000_000_000) -> None:
        if not (renew_m > 0 and 0 < shortest_ns <= longest_ns):
            raise ValueError(f'renew_m {renew_m}, shortest_ns {shortest_ns}, longest_ns '
                             f'{longest_ns}: must be positive, and shortest_ns at most longest_ns')
        self.renew_m = renew_m
        self.shortest_ns = shortest_ns
        self.longest_ns = longest_ns

    def period_ns(self, speed_m_s: float) -> int:
        """Return the time until the next round."""
        if speed_m_s <= 0:
            return self.longest_ns
        period_ns = self.renew_m / speed_m_s * 1e9
        return round(min(max(period_ns, self.shortest_ns), self.longest_ns))

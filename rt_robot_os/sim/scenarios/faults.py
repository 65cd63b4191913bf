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

"""Fault injection on a timeline: faults at given times, and faults that recur at random."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from rt_robot_os.sim.scenarios.timeline import Action
from rt_robot_os.sim.scenarios.timeline import seconds
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline


class FaultInjector:
    """
    Begins and ends faults.

    :param random: draws the times of what recurs.
    """

    def __init__(self, timeline: VirtualTimeline, random: Random) -> None:
        self._timeline = timeline
        self._random = random

    def once(self, at_s: float, for_s: float, begin: Action, end: Action) -> None:
        """
        Inject one fault.

        :param at_s: when it begins, on the timeline.
        :param for_s: its duration; 0: it does not end.
        """
        self._timeline.at(seconds(at_s), begin)
        if for_s:
            self._timeline.at(seconds(at_s + for_s), end)

    def recurring(self, fault: str, mean_s: float, inject: Callable[[str], None]) -> None:
        """
        Inject a fault again and again, at intervals from nothing to twice the mean.

        :param inject: is called with the name of the fault.
        """
        def fire() -> None:
            self.recurring(fault, mean_s, inject)
            inject(fault)

        self.after(0.0, 2 * mean_s, fire)

    def after(self, least_s: float, most_s: float, action: Action) -> None:
        """Run an action after a random delay."""
        self._timeline.after(seconds(self._random.uniform(least_s, most_s)), action)

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


"""A fall with more than one blow: which of them are one, and which one the fall is dated by."""

from __future__ import annotations

import pytest

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.features.health.fall_detector.detector import Evidence
from rt_robot_os.features.health.fall_detector.detector import FallDetector
from rt_robot_os.features.health.fall_detector.detector import FallEventKind
from rt_robot_os.sim.world.body_motion import body_motion
from rt_robot_os.sim.world.body_motion import IMPACT_S

STANDING_S = 8.0
RATE_HZ = 50


def fall_and_knock(after_s: float, factor: float) -> Evidence:
    """Let somebody fall, and something knock at the sensor later; return what is said."""
    detector, found = FallDetector(), []
    for number in range(round((STANDING_S + 6.0) * RATE_HZ)):
        at_s = number / RATE_HZ
        falls = at_s >= STANDING_S
        felt = body_motion('fall' if falls else 'stand', at_s - STANDING_S * falls,
                           before='stand', direction='forward')
        knocked_s = at_s - STANDING_S - IMPACT_S - after_s
        scale = (factor if 0.0 <= knocked_s < 0.08 else 1.0) / STANDARD_GRAVITY_M_S2
        x, y, z = (each * scale for each in felt.force_m_s2)
        found.append(detector.add(round(at_s * NS_PER_S), x, y, z))
    (one,) = [each for each in found if each is not None]
    assert one.kind is FallEventKind.FALL
    return one.evidence


def impact_s(evidence: Evidence) -> float:
    """Return when the impact was, counted from that of the fall."""
    return evidence.impact_ns / NS_PER_S - STANDING_S - IMPACT_S


@pytest.mark.parametrize('after_s', [0.4, 0.6, 0.8])
@pytest.mark.parametrize('factor', [6.0, 12.0])
def test_a_harder_knock_soon_after_the_fall_is_another_blow_and_does_not_date_it(
        after_s: float, factor: float) -> None:
    undisturbed, evidence = fall_and_knock(after_s, 1.0), fall_and_knock(after_s, factor)
    assert evidence.impact_ns == undisturbed.impact_ns
    assert evidence.peak_g == pytest.approx(undisturbed.peak_g)
    assert abs(impact_s(evidence)) < 0.1


@pytest.mark.parametrize('after_s', [0.1, 0.2])
def test_what_bounces_within_a_third_of_a_second_is_one_blow_as_hard_as_its_hardest(
        after_s: float) -> None:
    undisturbed, evidence = fall_and_knock(after_s, 1.0), fall_and_knock(after_s, 12.0)
    assert evidence.peak_g > 2 * undisturbed.peak_g
    assert after_s - 0.05 <= impact_s(evidence) <= after_s + 0.1

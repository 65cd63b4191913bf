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

"""The motion of the simulated worn sensor is physically possible, and its angular rate fits."""

import math

import pytest

from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.sim.world.body_motion import ACTIVITIES
from rt_robot_os.sim.world.body_motion import body_motion
from rt_robot_os.sim.world.body_motion import DIRECTIONS
from rt_robot_os.sim.world.body_motion import IMPACT_G
from rt_robot_os.sim.world.body_motion import IMPACT_S

_STEP_S = 0.01


def felt(activity, direction='forward', before='stand', until_s=6.0):
    return [body_motion(activity, _STEP_S * number, before=before, direction=direction)
            for number in range(round(until_s / _STEP_S))]


def load_g(one):
    return math.hypot(*one.force_m_s2) / STANDARD_GRAVITY_M_S2


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('activity', ACTIVITIES)
def test_the_rates_are_those_of_the_turns(activity, direction):
    motion = felt(activity, direction)
    turned = [sum(one.rate_rad_s[axis] for one in motion) * _STEP_S for axis in (0, 1)]
    assert turned[0] == pytest.approx(motion[-1].roll_rad - motion[0].roll_rad, abs=0.03)
    assert turned[1] == pytest.approx(motion[-1].pitch_rad - motion[0].pitch_rad, abs=0.03)


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_a_fall_is_a_descent_an_impact_and_lying_on_that_side(direction):
    loads = [load_g(one) for one in felt('fall', direction)]
    at = loads.index(max(loads))
    assert at * _STEP_S == pytest.approx(IMPACT_S, abs=0.1)
    assert max(loads) == pytest.approx(IMPACT_G, rel=0.1)
    assert sum(load < 0.6 for load in loads[:at]) * _STEP_S == pytest.approx(0.3, abs=0.12)
    last = body_motion('fall', 30.0, direction=direction)
    assert load_g(last) == pytest.approx(1.0, abs=0.02)
    roll, pitch = DIRECTIONS[direction]
    assert last.force_m_s2[0] == pytest.approx(-pitch * STANDARD_GRAVITY_M_S2, abs=0.3)
    assert last.force_m_s2[1] == pytest.approx(roll * STANDARD_GRAVITY_M_S2, abs=0.3)


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize(('before', 'after'), [
    ('stand', 'fall'), ('fall', 'rise'), ('rise', 'walk'), ('walk', 'sit'), ('sit', 'rise'),
    ('stand', 'lie'), ('lie', 'rise')])
def test_an_activity_begins_where_the_one_before_ended(before, after, direction):
    ended = body_motion(before, 20.0, direction=direction)
    begun = body_motion(after, 0.0, before=before, direction=direction)
    assert begun.roll_rad == pytest.approx(ended.roll_rad, abs=0.06)
    assert begun.pitch_rad == pytest.approx(ended.pitch_rad, abs=0.06)


def test_what_is_no_fall_has_no_impact():
    for activity in ACTIVITIES:
        for before in ACTIVITIES:
            if activity != 'fall':
                assert max(map(load_g, felt(activity, before=before))) < 1.6, (activity, before)

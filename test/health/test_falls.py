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

"""Falls are found however the sensor is worn and whatever its rate, and daily life is none."""

import math
from random import Random

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.features.health.fall_detector.detector import DetectorState
from rt_robot_os.features.health.fall_detector.detector import FallDetector
from rt_robot_os.features.health.fall_detector.detector import FallEventKind
from rt_robot_os.features.health.fall_detector.limits import FallLimits
from rt_robot_os.features.health.fall_detector.limits import limits_problem
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.sim.world.body_motion import body_motion
from rt_robot_os.sim.world.body_motion import DIRECTIONS
from rt_robot_os.sim.world.body_motion import IMPACT_S

_UPRIGHT = [('stand', 3.0), ('walk', 4.0), ('stand', 1.0)]
FALL = [*_UPRIGHT, ('fall', 6.0)]
DAY = [*_UPRIGHT, ('sit', 6.0), ('rise', 3.0), ('walk', 5.0), ('lie', 10.0), ('rise', 4.0),
       ('walk', 5.0)]


def motion(activities, rate_hz=50.0, direction='forward', turned=(1.0, 0.0, 0.0, 0.0)):
    """Return rows of seconds, g along three axes of the sensor, deg/s."""
    rows, before, begun, number = [], 'stand', 0.0, 0
    for activity, lasts_s in activities:
        while number / rate_hz < begun + lasts_s:
            felt = body_motion(activity, number / rate_hz - begun, before=before,
                               direction=direction)
            force = rotate(turned, felt.force_m_s2)
            rows.append((number / rate_hz, *(each / STANDARD_GRAVITY_M_S2 for each in force),
                         math.degrees(math.hypot(*felt.rate_rad_s))))
            number += 1
        before, begun = activity, begun + lasts_s
    return rows


def happened(rows, detector=None, finish=True):
    detector = detector or FallDetector()
    found = [one for at_s, x, y, z, turn in rows
             if (one := detector.add(round(at_s * NS_PER_S), x, y, z, turn)) is not None]
    last = detector.finish() if finish else None
    return found + ([last] if last else [])


def what(rows):
    return [one.kind for one in happened(rows)]


ROTATIONS = st.tuples(*4 * [st.floats(-1.0, 1.0)]).filter(
    lambda four: math.hypot(*four) > 0.2).map(
    lambda four: tuple(each / math.hypot(*four) for each in four))


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('rate_hz', [18.0, 25.0, 50.0, 100.0, 200.0])
def test_a_fall_is_found_soon_and_a_day_is_none(rate_hz, direction):
    found = happened(motion(FALL, rate_hz, direction), finish=False)
    assert [one.kind for one in found] == [FallEventKind.FALL]
    impact_s = found[0].evidence.impact_ns / NS_PER_S
    assert impact_s == pytest.approx(8.0 + IMPACT_S, abs=0.1)
    assert 0.0 < found[0].stamp_ns / NS_PER_S - impact_s < 5.0
    assert found[0].evidence.turned_deg == pytest.approx(86.0, abs=8.0)
    assert found[0].evidence.turn_deg_s > 150.0
    assert what(motion(DAY, rate_hz, direction)) == []


@settings(max_examples=15, deadline=None)
@given(ROTATIONS, st.floats(18.0, 200.0), st.sampled_from(sorted(DIRECTIONS)))
def test_neither_the_mounting_nor_the_rate_matters(turned, rate_hz, direction):
    assert what(motion(FALL, rate_hz, direction, turned)) == [FallEventKind.FALL]


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 1 << 32), st.sampled_from([4.0, 16.0]))
def test_lost_late_and_clipped_samples_do_not_hide_a_fall(seed, range_g):
    random, rows, lost = Random(seed), [], False
    for at_s, *force, turn in motion(FALL, 50.0):
        lost = not lost and random.random() < 0.25  # never two in a row: an impact is two or three
        if not lost:
            rows.append((at_s + random.uniform(0.0, 0.015),
                         *(max(-range_g, min(range_g, each + random.gauss(0.0, 0.03)))
                           for each in force), turn))
    assert what(rows) == [FallEventKind.FALL]


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_a_sensor_of_two_g_is_enough(direction):
    clipped = [(at_s, *(max(-2.0, min(2.0, each)) for each in force), turn)
               for at_s, *force, turn in motion(FALL, 50.0, direction)]
    assert what(clipped) == [FallEventKind.FALL]


@pytest.mark.parametrize('most_g', [1.7, 2.0])
def test_a_soft_floor_takes_as_much_speed_and_is_felt_less(most_g):
    """A mattress: the same impulse as the floor of the model, spread over a longer time."""
    rows = motion(FALL)
    begun_s = 8.0 + IMPACT_S
    sizes = [math.hypot(*row[1:4]) for row in rows]
    beyond = [0.02 * (size - 1.0) for row, size in zip(rows, sizes)
              if begun_s <= row[0] < begun_s + 0.3 and size > 1.0]
    lasts_s = math.pi / 2.0 * sum(beyond) / (most_g - 1.0)  # of half a sine of that height
    soft = []
    for (at_s, *force, turn), size in zip(rows, sizes):
        if begun_s <= at_s < begun_s + max(0.3, lasts_s):
            swing = math.sin(math.pi * min(1.0, (at_s - begun_s) / lasts_s))
            force = [each / size * (1.0 + (most_g - 1.0) * swing) for each in force]
        soft.append((at_s, *force, turn))
    found = happened(soft)
    assert [one.kind for one in found] == [FallEventKind.FALL]
    assert found[0].evidence.peak_g == pytest.approx(most_g, abs=0.05)
    assert found[0].evidence.stop_m_s == pytest.approx(
        happened(rows)[0].evidence.stop_m_s, rel=0.25)


@pytest.mark.parametrize('scale', [0.92, 1.08])
def test_the_scale_of_a_sensor_is_no_impact(scale):
    scaled = [(at_s, x * scale, y * scale, z * scale, turn)
              for at_s, x, y, z, turn in motion(FALL)]
    stop_m_s = happened(motion(FALL))[0].evidence.stop_m_s
    assert happened(scaled)[0].evidence.stop_m_s == pytest.approx(stop_m_s, rel=0.1)


def test_who_gets_up_has_recovered_and_may_fall_again():
    up = [('rise', 4.0), ('walk', 6.0)]
    assert what(motion([*FALL, *up])) == [FallEventKind.FALL, FallEventKind.RECOVERED]
    assert what(motion([*FALL, *up, *FALL])) == [
        FallEventKind.FALL, FallEventKind.RECOVERED, FallEventKind.FALL]


def test_who_sits_up_only_lies_on():
    detector = FallDetector()
    assert what(motion([*FALL, ('lie', 20.0)])) == [FallEventKind.FALL]
    found = happened(motion([*FALL, ('fall', 60.0)]), detector)
    assert [one.kind for one in found] == [FallEventKind.FALL]
    assert detector.state is DetectorState.FALLEN


def test_a_sensor_that_is_put_upright_on_a_table_is_nobody_who_got_up():
    rows = motion(FALL)
    still = [(rows[-1][0] + 0.02 * number, 0.0, 0.0, 1.0, 0.0) for number in range(1, 2000)]
    assert what(rows + still) == [FallEventKind.FALL]


def test_who_fell_out_of_bed_has_got_up_when_they_walk():
    lying = motion([('stand', 4.0)], turned=(math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
    begun = lying[-1][0] + 0.02
    # From the back to the side: another posture than the one in bed, and never that one again.
    fallen = [(begun + at_s, x, y, z, turn) for at_s, x, y, z, turn in
              motion([('fall', 6.0), ('rise', 4.0), ('walk', 12.0)])]
    assert what(lying + fallen) == [FallEventKind.FALL, FallEventKind.RECOVERED]


@pytest.mark.parametrize('left_s', [0.45, 0.7, 1.1, 1.5])
def test_a_recording_that_ends_soon_is_decided_on_what_there_is(left_s):
    rows = [row for row in motion(FALL) if row[0] <= 8.0 + IMPACT_S + left_s]
    found = happened(rows)
    assert [one.kind for one in found] == [FallEventKind.FALL]
    assert found[0].stamp_ns <= round(rows[-1][0] * NS_PER_S)
    assert what(rows[:-round(left_s * 50)]) == []


def test_who_crawls_after_the_fall_has_fallen_too():
    random = Random(7)
    rows = [(at_s, *(each + (random.gauss(0.0, 0.28) if at_s > 9.0 else 0.0) for each in force),
             turn) for at_s, *force, turn in motion(FALL)]
    found = happened(rows)
    assert [one.kind for one in found] == [FallEventKind.FALL]
    assert found[0].stamp_ns / NS_PER_S < 8.0 + IMPACT_S + 5.0


def test_a_blow_alone_is_no_fall_nor_is_a_turn():
    rows = motion([('stand', 10.0)])
    knocked = [(at_s, x, y, z * (8.0 if 250 <= number < 254 else 1.0), turn)
               for number, (at_s, x, y, z, turn) in enumerate(rows)]
    detector = FallDetector()
    assert happened(knocked, detector) == []
    assert detector.evidence is not None and detector.evidence.peak_g == pytest.approx(8.0, 0.05)
    turned = rows[:250] + [(at_s, z, y, x, turn) for at_s, x, y, z, turn in rows[250:]]
    assert what(turned) == []


def test_hops_with_a_bend_between_are_none():
    rows = []
    for at_s, x, y, z, turn in motion([('stand', 20.0)]):
        load = max(0.05, 1.0 + 3.5 * math.sin(2 * math.pi * 2.2 * at_s)) if at_s < 10.0 else 1.0
        bent = math.radians(70.0) * math.sin(math.pi * (at_s - 12.0)) if 12 < at_s < 13 else 0.0
        rows.append((at_s, -math.sin(bent) * load, y, math.cos(bent) * load, turn))
    assert what(rows) == []


def test_nonsense_is_counted_and_a_clock_that_was_set_begins_anew():
    detector = FallDetector()
    for nonsense in (math.nan, math.inf, -math.inf, 1e300):
        assert detector.add(NS_PER_S, nonsense, 0.0, 1.0) is None
    detector.add(5 * NS_PER_S, 0.0, 0.0, 1.0)
    detector.add(5 * NS_PER_S, 0.0, 0.0, 1.0)
    assert (detector.rejected, detector.out_of_order, detector.samples) == (4, 1, 1)
    happened(motion([('stand', 9.0)]), detector, finish=False)
    assert [one.kind for one in happened(motion(FALL), detector)] == [FallEventKind.FALL]


def test_a_sensor_that_hangs_says_nothing():
    zeros = [(0.02 * number, 0.0, 0.0, 0.0, 0.0) for number in range(3000)]
    assert what(zeros) == []
    assert what([(at_s, 16.0, 16.0, 16.0, 0.0) for at_s, *_ in zeros]) == []


def test_limits_that_do_not_fit_are_named():
    assert limits_problem(FallLimits()) == ''
    assert 'stop_from_m_s' in limits_problem(FallLimits(stop_from_m_s=4.0))
    assert 'decide_within_s' in limits_problem(FallLimits(decide_within_s=1.0))
    assert 'evidence' in limits_problem(FallLimits(evidence=3.0))


# ---- which way is up ----------------------------------------------------------------------------

def posture(pitch_deg, lasts_s, begun_s, blow_g=0.0):
    """Return rows of a trunk at rest at a pitch; with a blow of 0.25 s at the beginning."""
    pitch = math.radians(pitch_deg)
    rows = []
    for number in range(round(lasts_s * 50)):
        at_s = 0.02 * number
        load = 1.0 + (blow_g * math.sin(math.pi * at_s / 0.25) if at_s < 0.25 else 0.0)
        rows.append((begun_s + at_s, -math.sin(pitch) * load, 0.0, math.cos(pitch) * load, 0.0))
    return rows


def after(rows, *postures):
    """Return rows that go on with postures: their pitch, length and blow."""
    rows = list(rows)
    for pitch_deg, lasts_s, blow_g in postures:
        rows += posture(pitch_deg, lasts_s, rows[-1][0] + 0.02, blow_g)
    return rows


WALKED = [('stand', 2.0), ('walk', 8.0), ('stand', 2.0)]
UNTURNED = (0.0, 0.0, 0.0, 1.0)


@settings(max_examples=10, deadline=None)
@given(ROTATIONS)
def test_who_gets_up_from_lying_with_a_jolt_has_not_fallen(turned):
    """Lying for long, then up with a jolt as hard as that of a soft fall."""
    rows = after(motion(WALKED, turned=UNTURNED), (88.0, 20.0, 0.0), (0.0, 6.0, 1.4))
    rotated = [(at_s, *rotate(turned, force), turn) for at_s, *force, turn in rows]
    assert what(rotated) == []
    # The same turn and the same jolt the other way round are a fall.
    rows = after(motion(WALKED, turned=UNTURNED), (0.0, 20.0, 0.0), (88.0, 6.0, 1.4))
    assert what([(at_s, *rotate(turned, force), turn)
                 for at_s, *force, turn in rows]) == [FallEventKind.FALL]


def test_who_turns_over_in_bed_has_not_fallen_unless_the_impact_is_a_full_one():
    lying = after(motion(WALKED, turned=UNTURNED), (88.0, 20.0, 0.0))
    assert what(after(lying, (-85.0, 6.0, 0.9))) == []
    assert what(after(lying, (-85.0, 6.0, 2.5))) == [FallEventKind.FALL]


def test_before_the_first_walk_any_turn_counts():
    rows = after(motion([('stand', 3.0)], turned=UNTURNED), (88.0, 20.0, 0.0), (0.0, 6.0, 1.4))
    assert what(rows) == [FallEventKind.FALL]


def test_a_sensor_that_is_mounted_otherwise_learns_again_from_two_walks():
    turned = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
    rows = motion([*WALKED, *WALKED])
    rows += [(rows[-1][0] + 0.02 + at_s, x, y, z, turn) for at_s, x, y, z, turn in
             motion([*WALKED, ('walk', 12.0), ('fall', 6.0)], turned=turned)]
    assert FallEventKind.FALL in what(rows)
    # After half a minute without samples nothing is taken for granted.
    rows = motion(WALKED)
    rows += [(rows[-1][0] + 40.0 + at_s, x, y, z, turn) for at_s, x, y, z, turn in
             motion([('stand', 4.0), ('fall', 6.0)], turned=turned)]
    assert what(rows) == [FallEventKind.FALL]


def test_a_sensor_without_values_is_not_at_rest():
    """Samples that are all zero: nobody who is at rest feels nothing."""
    rows = motion([('stand', 3.0), ('fall', 1.0)])
    rows += [(rows[-1][0] + 0.02 * number, 0.001 * (number % 2), 0.0, 0.0, 0.0)
             for number in range(1, 300)]
    assert what(rows) == []


def test_a_sensor_on_a_table_is_taken_off_until_it_is_worn_again():
    random = Random(3)
    detector = FallDetector()
    rows = motion([('stand', 2.0), ('walk', 8.0)])
    happened(rows, detector, finish=False)
    table = [(rows[-1][0] + 0.02 * number, *(each + random.gauss(0.0, 0.003)
                                             for each in (1.0, 0.0, 0.0)), 0.0)
             for number in range(1, 15_600)]
    assert happened(table, detector, finish=False) == []
    assert detector.state is DetectorState.TAKEN_OFF
    again = [(table[-1][0] + 0.02 + at_s, *force) for at_s, *force in motion(FALL)]
    assert [one.kind for one in happened(again, detector)] == [FallEventKind.FALL]


def test_who_sleeps_still_wears_it():
    """Breath tilts the sensor by half a degree to each side."""
    detector = FallDetector()
    happened([(0.1 * number, 1.0, 0.008 * math.sin(0.1 * number * 1.3), 0.0, 0.0)
              for number in range(6000)], detector, finish=False)
    assert detector.state is DetectorState.WATCHING

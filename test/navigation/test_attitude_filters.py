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


"""Attitude filters: what holds for any motion, any start and any trouble."""

from __future__ import annotations

from collections.abc import Callable
import math
import random

from attitude_motion import angle
from attitude_motion import EARTH
from attitude_motion import feed
from attitude_motion import follow
from attitude_motion import length
from attitude_motion import Motion
from attitude_motion import off
from attitude_motion import plus
from attitude_motion import seen
from attitude_motion import STILL
from attitude_motion import swing
import pytest

from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2 as G
from rt_robot_os.features.navigation.attitude import AttitudeFilter
from rt_robot_os.features.navigation.attitude import FilterTuning
from rt_robot_os.features.navigation.attitude import MahonyFilter
from rt_robot_os.features.navigation.attitude import VqfFilter
from rt_robot_os.motion.quaternion import about_up
from rt_robot_os.motion.quaternion import conjugate
from rt_robot_os.motion.quaternion import from_rotation
from rt_robot_os.motion.quaternion import IDENTITY
from rt_robot_os.motion.quaternion import multiply
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.motion.quaternion import Vector

hypothesis = pytest.importorskip('hypothesis', reason='hypothesis is not installed')
given, settings, strategies = hypothesis.given, hypothesis.settings, hypothesis.strategies

Make = Callable[[], AttitudeFilter]


@pytest.fixture(scope='module', params=['mahony', 'vqf'])
def make(request: pytest.FixtureRequest) -> Make:
    if request.param == 'mahony':
        return lambda: MahonyFilter(FilterTuning())
    pytest.importorskip('vqf', reason='vqf is not installed (pip install vqf)')
    return lambda: VqfFilter(FilterTuning(), 0.01, 0.01)


def vectors(most: float) -> hypothesis.strategies.SearchStrategy[Vector]:
    return strategies.tuples(*3 * [strategies.floats(-most, most)])


def fields() -> hypothesis.strategies.SearchStrategy[Vector]:
    return vectors(1e-4).filter(lambda v: math.hypot(*v) > 1e-7)


@strategies.composite
def orientations(draw: hypothesis.strategies.DrawFn) -> Quaternion:
    q = draw(strategies.tuples(*4 * [strategies.floats(-1, 1)]).filter(
        lambda v: math.hypot(*v) > 0.1))
    size = math.hypot(*q)
    x, y, z, w = (v / size for v in q)
    return x, y, z, w


SAMPLES = strategies.lists(
    strategies.tuples(vectors(40.0), strategies.none() | vectors(G) | vectors(150.0),
                      strategies.none() | fields(), strategies.floats(1e-5, 0.25)),
    min_size=1, max_size=60)


@given(samples=SAMPLES)
def test_whatever_comes_the_quaternion_is_a_turn_and_the_bias_within_its_limit(
        make: Make, samples: list[tuple[Vector, Vector | None, Vector | None, float]]) -> None:
    attitude = make()
    for number, sample in enumerate(samples):
        if number == 30:
            attitude.restart()
        assert length(attitude.update(*sample)) == pytest.approx(1.0, abs=1e-9)
        assert all(abs(b) <= attitude.tuning.bias_maximum_rad_s * (1 + 1e-6)
                   for b in attitude.bias)
        assert attitude.bias_stddev >= 0


@given(truth=orientations())
@settings(max_examples=25)
def test_any_orientation_is_known_from_the_first_samples(make: Make, truth: Quaternion) -> None:
    attitude, motion = make(), Motion(truth)
    for _ in range(3):
        feed(attitude, motion.step(0.01))
    assert attitude.aligned and attitude.heading_known
    assert angle(attitude.attitude, truth) < 0.01
    # Without magnetic field only up is known.
    attitude = make()
    feed(attitude, motion.step(0.01, with_field=False))
    assert attitude.aligned and not attitude.heading_known
    assert off(attitude.attitude, truth).inclination < 0.01


@given(believed=orientations(), truth=orientations())
@settings(max_examples=12)
def test_any_wrong_belief_converges_at_rest(
        make: Make, believed: Quaternion, truth: Quaternion) -> None:
    check_convergence(make(), believed, truth)


@pytest.mark.parametrize('truth', [
    (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.6, 0.8, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)],
    ids=['about x', 'about y', 'between', 'about up'])
def test_the_opposite_of_the_truth_converges_too(make: Make, truth: Quaternion) -> None:
    check_convergence(make(), IDENTITY, truth)


def check_convergence(attitude: AttitudeFilter, believed: Quaternion, truth: Quaternion) -> None:
    """Turn the sensor without a word of the gyroscope."""
    follow(attitude, Motion(believed), 2.0, rate_hz=50.0)
    follow(attitude, Motion(truth), 90.0, rate_hz=50.0)
    assert off(attitude.attitude, truth).inclination < 0.5
    assert off(attitude.attitude, truth).heading < 2.0


@given(mounting=orientations())
@settings(max_examples=8)
def test_a_sensor_mounted_another_way_gives_the_same_turns(
        make: Make, mounting: Quaternion) -> None:
    plain, turned, motion = make(), make(), Motion(turning=swing, bias=(0.004, -0.003, 0.002))
    back = conjugate(mounting)
    for sample in motion.samples(10.0, 50.0):
        feed(plain, sample)
        turned.update(rotate(back, sample.rate), rotate(back, sample.acceleration),
                      rotate(back, sample.field or STILL), sample.dt_s)
    assert angle(turned.attitude, multiply(plain.attitude, mounting)) < 0.1
    assert turned.bias == pytest.approx(rotate(back, plain.bias), abs=1e-4)


@given(rate=vectors(6.0), seconds=strategies.floats(0.05, 3.0))
def test_a_constant_turn_is_integrated_exactly(make: Make, rate: Vector, seconds: float) -> None:
    attitude = make()
    feed(attitude, Motion().step(0.01, with_field=False))
    before, count = attitude.attitude, 40
    for _ in range(count):
        attitude.update(rate, None, None, seconds / count)
    x, y, z = (r * seconds for r in rate)
    assert angle(attitude.attitude, multiply(before, from_rotation(x, y, z))) < 1e-4


@given(steps=strategies.lists(strategies.sampled_from([0.005, 0.007, 0.01, 0.013, 0.05, 0.2]),
                              min_size=100, max_size=200))
@settings(max_examples=20)
def test_samples_at_any_times_give_the_same_heading(make: Make, steps: list[float]) -> None:
    # Constant within each step, as the gyroscope of a real sensor averages.
    attitude, motion = make(), Motion(turning=swing)
    feed(attitude, motion.step(0.01, with_field=False))
    for step in steps:
        feed(attitude, motion.step(step, with_field=False))
    # vqf learns a bias meanwhile, for which all steps are alike.
    most_deg = 0.1 if attitude.name == 'mahony' else 0.5
    assert off(attitude.attitude, motion.truth).inclination < most_deg
    assert off(attitude.attitude, motion.truth).heading < most_deg


def test_the_bias_is_learned_at_rest(make: Make) -> None:
    attitude, motion = make(), Motion(bias=(0.02, -0.015, 0.01))
    follow(attitude, motion, 20.0)
    assert attitude.at_rest
    assert attitude.bias == pytest.approx(motion.bias, abs=1e-3)
    assert attitude.bias_stddev < math.radians(0.1)
    motion.turning = swing
    assert follow(attitude, motion, 5.0, with_field=False).inclination < 0.5
    assert not attitude.at_rest


def test_the_bias_is_learned_in_motion(make: Make) -> None:
    attitude, motion = make(), Motion(bias=(0.006, -0.005, 0.004), turning=swing)
    follow(attitude, motion, 900.0, rate_hz=20.0)
    assert attitude.bias == pytest.approx(motion.bias, abs=0.0015)
    worst = follow(attitude, motion, 30.0, rate_hz=20.0)
    assert worst.inclination < 0.8
    assert worst.heading < 1.5


def test_a_bias_is_not_learned_when_that_is_off(make: Make) -> None:
    attitude = make()
    attitude.tune(FilterTuning(bias_at_rest=False, bias_in_motion=False))
    follow(attitude, Motion(bias=(0.02, 0.0, 0.0)), 20.0)
    assert attitude.bias == pytest.approx(STILL, abs=1e-12)


@pytest.mark.parametrize('disturbance', [
    (3e-5, -2e-5, 1.5e-5), (0.0, 0.0, 3e-5), (-2e-5, -4e-5, 1e-5)])
@pytest.mark.parametrize('turning', [swing, lambda _: STILL], ids=['moving', 'still'])
def test_a_magnet_does_not_move_the_heading(
        make: Make, disturbance: Vector, turning: Callable[[float], Vector]) -> None:
    attitude, motion = make(), Motion(turning=swing)
    follow(attitude, motion, 30.0)  # turned once: whoever has never moved knows no other field
    motion.turning = turning
    follow(attitude, motion, 5.0)
    motion.field = lambda _: plus(EARTH, disturbance)
    worst = follow(attitude, motion, 10.0)
    assert attitude.field_rejected
    assert worst.heading < 1.0
    assert worst.inclination < 0.2
    motion.field = lambda _: EARTH
    follow(attitude, motion, 2.0)
    assert not attitude.field_rejected


def test_a_field_moves_roll_and_pitch_not_at_all() -> None:
    with_field, without = MahonyFilter(FilterTuning(bias_in_motion=False)), MahonyFilter(
        FilterTuning(bias_in_motion=False))
    motion = Motion(turning=swing, field=lambda t: (2e-5 * math.sin(3 * t), 3e-5, 1e-5))
    for sample in motion.samples(20.0):
        feed(with_field, sample)
        without.update(sample.rate, sample.acceleration, None, sample.dt_s)
        assert off(with_field.attitude, without.attitude).inclination < 1e-9


def test_a_new_field_that_stays_is_believed_in_the_end(make: Make) -> None:
    # The robot was started beside a magnet, and has left it.
    attitude, motion = make(), Motion(field=lambda _: plus(EARTH, (3e-5, -2e-5, 1e-5)))
    follow(attitude, motion, 5.0)
    motion.field, motion.turning = lambda _: EARTH, swing
    follow(attitude, motion, 100.0, rate_hz=50.0)
    assert not attitude.field_rejected
    assert off(attitude.attitude, motion.truth).heading < 2.0


def test_a_noisy_magnetometer_is_used(make: Make) -> None:
    noise = random.Random(1)
    attitude, motion = make(), Motion(turning=swing)
    for sample in motion.samples(60.0):
        x, y, z = (v + noise.gauss(0.0, 2.5e-6) for v in sample.field or STILL)
        attitude.update(sample.rate, sample.acceleration, (x, y, z), sample.dt_s)
        if motion.time_s > 30.0:
            assert off(attitude.attitude, sample.truth).heading < 3.0
    believed = 0
    for sample in motion.samples(5.0):
        x, y, z = (v + noise.gauss(0.0, 2.5e-6) for v in sample.field or STILL)
        attitude.update(sample.rate, sample.acceleration, (x, y, z), sample.dt_s)
        believed += not attitude.field_rejected
    assert believed > 400


def test_a_field_of_another_unit_is_as_good(make: Make) -> None:
    tesla, microtesla, motion = make(), make(), Motion(turning=swing)
    for sample in motion.samples(5.0):
        feed(tesla, sample)
        x, y, z = (v * 1e6 for v in sample.field or STILL)
        microtesla.update(sample.rate, sample.acceleration, (x, y, z), sample.dt_s)
    assert angle(tesla.attitude, microtesla.attitude) < 1e-6


@pytest.mark.parametrize(('moving', 'seconds', 'most_deg'), [
    # A blow and its end, half a metre to and fro, vibration, braking.
    (lambda t: (40.0 if t % 2 < 0.05 else -40.0 if t % 2 < 0.1 else 0.0, 0.0, 0.0), 10.0, 1.0),
    (lambda t: (10.0 * math.sin(2 * math.pi * t), 0.0, 0.0), 20.0, 3.0),
    (lambda t: (0.0, 30.0 * math.sin(2 * math.pi * 33.0 * t), 20.0 * math.cos(200.0 * t)), 10.0,
     1.0),
    (lambda t: (-3.0, 0.0, 0.0), 1.5, 4.0)],
    ids=['blow', 'shaking', 'vibration', 'braking'])
def test_accelerations_tilt_little(make: Make, moving: Callable[[float], Vector], seconds: float,
                                   most_deg: float) -> None:
    attitude, motion = make(), Motion()
    follow(attitude, motion, 10.0)
    start_s = motion.time_s
    motion.moving = lambda t: moving(t - start_s)
    worst = follow(attitude, motion, seconds, with_field=False)
    assert worst.inclination < most_deg
    motion.moving = lambda _: STILL
    follow(attitude, motion, 30.0, with_field=False)
    assert off(attitude.attitude, motion.truth).inclination < 0.5


def test_a_long_acceleration_is_rejected_after_a_moment() -> None:
    attitude, motion = MahonyFilter(FilterTuning()), Motion()
    follow(attitude, motion, 10.0)
    motion.moving = lambda _: (9.0, 0.0, 0.0)
    worst = follow(attitude, motion, 8.0)
    assert attitude.acceleration_rejected
    assert worst.inclination < 12.0  # of the 43 degrees that it looks like


def test_an_accelerometer_that_is_wrong_for_ever_is_used_in_the_end() -> None:
    attitude = MahonyFilter(FilterTuning())
    truth = from_rotation(0.5, 0.3, 0.0)
    for _ in range(5000):
        x, y, z = seen(truth, (0.0, 0.0, 1.3 * G))
        attitude.update(STILL, (x, y, z), None, 0.01)
    assert not attitude.acceleration_rejected
    assert off(attitude.attitude, truth).inclination < 0.5


def test_free_fall_and_nothing_say_nothing_of_up(make: Make) -> None:
    attitude = make()
    attitude.update(STILL, STILL, None, 0.01)
    attitude.update(STILL, None, EARTH, 0.01)
    assert not attitude.aligned and not attitude.heading_known
    attitude.update(STILL, (0.0, 0.0, G), None, 0.01)
    assert attitude.aligned


@pytest.mark.parametrize('with_field', [True, False])
def test_a_restart_finds_up_at_once_and_keeps_bias_and_heading(
        make: Make, with_field: bool) -> None:
    attitude, motion = make(), Motion(from_rotation(0.2, 0.1, 0.0), bias=(0.003, 0.0, -0.003))
    follow(attitude, motion, 20.0, with_field=with_field)
    bias, before = attitude.bias, attitude.attitude
    # Turned by the shortest way while nobody looked.
    turn = from_rotation(0.4, -0.7, 0.0)
    motion.truth = multiply(turn, motion.truth)
    attitude.restart()
    assert not attitude.aligned
    feed(attitude, motion.step(0.01, with_field))
    feed(attitude, motion.step(0.01, with_field))
    assert attitude.aligned
    assert attitude.bias == pytest.approx(bias, abs=1e-4)
    assert angle(attitude.attitude, multiply(turn, before)) < 1.0


def test_heading_is_a_quarter_from_north_to_east(make: Make) -> None:
    # x of the sensor to the east is yaw 0, to the north a quarter, as REP 103 has it.
    for yaw, field in ((0.0, (0.0, 1.0, -1.0)), (math.pi / 2, (1.0, 0.0, -1.0)),
                       (math.pi, (0.0, -1.0, -1.0))):
        attitude = make()
        for _ in range(3):
            attitude.update(STILL, (0.0, 0.0, G), field, 0.01)
        assert angle(attitude.attitude, about_up(yaw)) < 1e-3

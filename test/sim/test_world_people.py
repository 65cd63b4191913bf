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

"""People of the world who fall, lie, sleep, call for help: what the sensors make of it."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path

from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.microphone.simulated import SimulatedMicrophone
from rt_robot_os.messages.signs import SIGNS as MODULES_SIGNS
from rt_robot_os.motion.walls import Walls
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.inertial import inertial
from rt_robot_os.sim.world.vitals import SIGNS
from rt_robot_os.sim.world_settings import WorldSettings

HOME = WorldSettings(
    map='open', people=('anna 1.0 0 0 9 0', 'bob 0 -5 5'),
    nodes=('kitchen 3 1 1.4 smoke water', 'wrist 8 8 1.0 on anna pulse_per_min alarm',
           'button 2 2 1.0 on bob alarm'))


def after(world: World, seconds: float) -> World:
    world.advance(round(seconds * NS_PER_S))
    return world


def begun(settings: WorldSettings = HOME) -> World:
    return after(World(settings), 0.0)


def wrist(world: World) -> tuple[float, float, float]:
    return world.wireless.nodes[1].position_m


def told(world: World, line: str) -> None:
    world.inject(line.split())


def test_who_falls_lies_where_they_were_until_they_rise_and_then_walk_on() -> None:
    world = begun(replace(HOME, events=('fall anna at 2', 'rise anna at 20')))
    anna = world.people[0]
    seen = []
    for second in (1.0, 2.4, 10.0, 21.0, 30.0):
        after(world, second)
        seen.append((anna.doing, round(anna.x, 1), round(wrist(world)[2], 1)))
    assert seen == [('walking', 1.0, 1.0), ('falling', 2.0, 0.5), ('lying', 2.0, 0.1),
                    ('rising', 2.0, 0.4), ('walking', 9.0, 1.0)]
    assert 'anna' in world.where()


def test_a_fall_may_last_and_a_second_one_changes_nothing() -> None:
    world = begun()
    told(world, 'fall anna 5')
    after(world, 3.0)
    lay = world.people[0].discs()
    told(world, 'fall anna')
    assert after(world, 4.0).people[0].discs() == lay
    assert after(world, 9.0).people[0].doing == 'walking'


def test_the_scanner_sees_the_length_of_who_lies_and_the_ultrasound_only_from_afar() -> None:
    world = begun(replace(HOME, people=('anna 0 3 0',), nodes=()))
    told(world, 'fall anna')
    after(world, 2.0)
    world.people[0].heading = math.pi / 2  # across
    ahead = np.array((0.0,))
    assert world.cast(0, 0, ahead, height_m=0.25)[0] == pytest.approx(2.83, abs=0.05)
    wide = world.cast(0, 0, np.linspace(-0.4, 0.4, 161), height_m=0.25)
    seen = np.linspace(-0.4, 0.4, 161)[np.isfinite(wide)]
    assert 3.0 * (math.tan(seen[-1]) - math.tan(seen[0])) == pytest.approx(1.75, abs=0.2)
    cone = math.tan(0.26)
    assert world.cast(0, 0, ahead, height_m=0.5)[0] == math.inf
    assert world.cast(0, 0, ahead, height_m=0.5, rise=cone)[0] < 3.0
    assert world.cast(2.3, 0, ahead, height_m=0.5, rise=cone)[0] == math.inf


def test_a_robot_does_not_drive_over_who_lies() -> None:
    world = begun(replace(HOME, people=('anna 0 2 0',), nodes=()))
    told(world, 'fall anna')
    after(world, 1.0)
    world.people[0].heading = 0.0  # with the feet towards the robot, 1.1 m away
    world.base.set_wheel_speeds(10.0, 10.0)
    after(world, 9.0)
    assert world.base.pose[0] == pytest.approx(2.0 - 0.875 - world.base.radius_m, abs=0.05)


@examples(max_examples=20, deadline=None)
@given(st.floats(0.0, 6.3), st.floats(0.5, 1.0))
def test_who_falls_in_a_corridor_lies_along_it(heading: float, y: float) -> None:
    world = corridor()
    anna = world.people[0]
    anna.x, anna.y, anna.heading = 3.0, y, heading
    told(world, 'fall anna')
    after(world, 1.0)
    assert all(0.1 < disc[1] < 1.4 for disc in anna.discs())


def corridor() -> World:
    """Make a world of 6 x 1.5 m between two walls."""
    world = begun(replace(HOME, nodes=()))
    world.walls = Walls(np.array(((-1.0, 0.0, 7.0, 0.0), (7.0, 1.5, -1.0, 1.5))))
    return world


def test_who_sleeps_lies_higher_and_who_sits_is_smaller() -> None:
    world = begun()
    told(world, 'sleep anna')
    told(world, 'sit bob')
    after(world, 6.0)
    anna, bob = world.people
    assert (anna.doing, bob.doing) == ('asleep', 'sitting')
    assert len(anna.discs()) > 1 and anna.height_m == 0.75 and wrist(world)[2] == 0.6
    assert len(bob.discs()) == 1 and 1.0 < bob.height_m < 1.5


# ---- what a body says ---------------------------------------------------------------------------

def signs(world: World, name: str = 'anna') -> dict[str, float]:
    person = world.people_model.find(name)
    assert person is not None
    return {sign: person.vitals.value(sign, person.time_s) for sign in (
        'pulse_per_min', 'respiration_per_min', 'spo2_percent', 'body_temperature',
        'systolic_mmhg', 'diastolic_mmhg', 'consciousness')}


def test_signs_of_life_are_usual_wander_slowly_and_differ_by_person_and_seed() -> None:
    def series(name: str, seed: int = 1) -> list[float]:
        world = begun(replace(HOME, seed=seed))
        return [signs(after(world, second), name)['pulse_per_min'] for second in range(0, 600, 5)]

    anna = series('anna')
    assert 62 < min(anna) < max(anna) < 82 and np.ptp(anna) > 4
    assert np.abs(np.diff(anna)).max() < 2.0
    assert anna == series('anna') and anna != series('bob') and anna != series('anna', 2)


def test_every_vital_sign_of_the_modules_is_one_of_a_body() -> None:
    assert set(SIGNS) == set(MODULES_SIGNS)


def test_whoever_looks_how_often_sees_the_same_signs() -> None:
    world, other = begun(), begun()
    for tenth in range(300):
        signs(after(world, tenth / 10))
    assert signs(after(world, 30.0)) == signs(after(other, 30.0))


def test_a_fall_raises_the_pulse_and_it_comes_down_again() -> None:
    calm, fallen = begun(), begun(replace(HOME, events=('fall anna at 10',)))
    rise = [signs(after(fallen, second))['pulse_per_min']
            - signs(after(calm, second))['pulse_per_min'] for second in (9, 20, 60, 500)]
    assert rise[0] == 0.0 and rise[1] > 20 > rise[2] * 0.9 > 10 and rise[3] < 2


def test_a_sign_that_is_told_is_so_and_is_usual_after_its_time() -> None:
    world = begun()
    usual = signs(world)
    told(world, 'vital anna spo2_percent 85 10')
    told(world, 'vital anna pulse_per_min 0')
    assert signs(after(world, 5.0)) == {**signs(world), 'spo2_percent': 85.0, 'pulse_per_min': 0.0}
    found = signs(after(world, 11.0))
    assert found['spo2_percent'] > 95 and found['pulse_per_min'] == 0.0
    assert usual['consciousness'] == 0.0


# ---- buttons, voices, dangers -------------------------------------------------------------------

def alarms(world: World) -> list[dict[str, int]]:
    return [dict(each.alarms) for each in world.wireless.nodes]


def test_a_button_says_help_or_fine_and_nodes_smoke_or_water() -> None:
    world = begun()
    told(world, 'press anna help')
    told(world, 'press button fine 3')
    told(world, 'smoke kitchen')
    assert alarms(world) == [{'smoke': 1}, {'alarm': 1}, {'alarm': 2}]
    told(world, 'water kitchen 5')
    assert alarms(after(world, 4.0)) == [{'smoke': 1, 'water': 1}, {'alarm': 1}, {}]
    assert alarms(after(world, 11.0)) == [{'smoke': 1}, {}, {}]


@pytest.mark.parametrize(('answer', 'code'), [('fine', 2), ('help', 1), ('silent', None)])
def test_some_seconds_after_a_fall_somebody_answers(answer: str, code: int | None) -> None:
    world = begun(replace(HOME, events=(f'answer anna {answer} at 0', 'fall anna at 1')))
    assert 'alarm' not in alarms(after(world, 8.0))[1]
    assert alarms(after(world, 10.0))[1].get('alarm') == code


def test_told_to_answer_while_they_lie_they_do_it_at_once() -> None:
    world = begun()
    told(world, 'answer anna help')
    after(world, 1.0)
    assert alarms(world)[1] == {}
    told(world, 'fall anna')
    after(world, 2.0)
    told(world, 'answer anna fine')
    assert alarms(after(world, 2.1))[1] == {'alarm': 2}


def test_a_microphone_hears_who_speaks_the_less_the_farther_away(tmp_path: Path) -> None:
    def level_db(x: float, walls: bool = False) -> float:
        world = corridor() if walls else begun()
        world.people[0].y = 0.7 if walls else 0.0
        world.base.teleport(x, -2.0 if walls else 0.0, 0.0)
        told(world, 'speak anna 2')
        return SimulatedMicrophone('mic', {}, tmp_path / 'mic', Site(world)).level_db()

    assert level_db(1.0) > level_db(2.0) + 5.9 > level_db(4.0) + 11.7 > -25
    assert level_db(2.0, walls=True) < level_db(3.0) - 10
    world = begun()
    mic = SimulatedMicrophone('mic', {}, tmp_path / 'mic', Site(world))
    assert mic.level_db() == pytest.approx(-60.0)


def test_it_becomes_warmer_by_and_by_and_cools_down_again() -> None:
    world = begun(replace(HOME, events=('heat kitchen 50 at 0 for 60',)))
    warm = [after(world, second).temperature_c(3.0, 1.0) for second in (1, 30, 60, 120, 600)]
    assert 21 < warm[0] < 23 < warm[1] < warm[2] < 54 and warm[2] > 48
    assert 25 < warm[3] < warm[2] and warm[4] < 21.1
    assert world.temperature_c(9.0, 9.0) == pytest.approx(21.0, abs=0.1)


def test_a_motion_detector_sees_who_moves_near_it_and_not_through_walls() -> None:
    world = after(begun(), 1.0)
    assert world.noticed(3.0, 1.0) and not world.noticed(12.0, 1.0)
    assert not world.noticed(-5.0, 4.0)  # bob stands still
    told(world, 'fall anna')
    assert after(world, 2.0).noticed(3.0, 1.0) and not after(world, 5.0).noticed(3.0, 1.0)
    hall = after(corridor(), 1.0)
    hall.people[0].y = 0.7
    assert hall.noticed(3.0, 1.5) and not hall.noticed(3.0, 4.0)


# ---- a worn inertial sensor ---------------------------------------------------------------------

def felt(world: World, on: str = 'anna', until_s: float = 8.0) -> np.ndarray:
    sensor = inertial(Site(world), {'on': on})
    forces = []
    for step in range(round(until_s * 100)):
        after(world, step / 100)
        forces.append(sensor.force(0.0))
    return np.array(forces) / 9.80665


def test_a_worn_sensor_feels_steps_a_fall_and_the_turn_of_the_body() -> None:
    forces = felt(begun(replace(HOME, events=('fall anna at 4',))))
    size = np.linalg.norm(forces, axis=1)
    assert 0.15 < size[200:390].std() < 0.6 and size[200:390].mean() == pytest.approx(1.0, abs=0.1)
    fall = size[400:500]
    assert fall.min() < 0.5 and fall.max() > 3.0 and fall.argmin() < fall.argmax()
    assert size[600:].std() < 0.05
    upright, lying = forces[200:390].mean(axis=0), forces[600:].mean(axis=0)
    assert upright[2] > 0.9 and abs(lying[2]) < 0.3 and abs(lying[0]) > 0.9


def test_a_worn_sensor_keeps_its_attitude_with_its_gravity() -> None:
    world = begun(replace(HOME, events=('fall anna at 1',)))
    sensor = inertial(Site(world, {'mounting_rad': [0.0, 0.0, 1.0]}), {'on': 'anna'})
    after(world, 5.0)
    assert sensor.gravity(0.0) == pytest.approx(sensor.force(0.0), abs=0.3)
    assert abs(sensor.attitude(0.0)[1]) < math.pi / 2 + 0.01


def test_nobody_wears_a_sensor_on_nobody() -> None:
    with pytest.raises(ConfigError, match='on: carl: there is no such person; there are anna, b'):
        inertial(Site(begun()), {'on': 'carl'})


@pytest.mark.parametrize(('line', 'text'), [
    ('fall carl', 'there is no such person'), ('vital anna pulse 90', "'pulse': must be one of"),
    ('press anna', 'must be one of help, fine'), ('press kitchen help', 'kitchen has no button'),
    ('smoke wrist', 'wrist has no sensor'), ('speak anna 0', 'it must be above 0'),
    ('answer anna maybe', 'must be one of fine, help, silent'), ('fall', 'must be one of: '),
    ('heat cellar 9', 'there is no such node'), ('vital anna spo2_percent', 'must be one of: ')])
def test_what_cannot_happen_to_people_is_refused(line: str, text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        World(HOME).inject(line.split())
    assert text in str(caught.value)


def test_the_same_happens_each_time_however_often_somebody_looks() -> None:
    busy = replace(HOME, events=('fall anna at 1', 'rise anna at 3', 'sit bob at 2 for 2',
                                 'press anna help at 2', 'heat kitchen 20 at 1'))
    often, seldom = begun(busy), begun(busy)
    for tenth in range(80):
        after(often, tenth / 10)
        often.noticed(0.0, 0.0)
    assert after(often, 8.0).where() == after(seldom, 8.0).where()

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

"""Wireless nodes in the world: they lose their power, are moved, worn, and call for help."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.wireless import WirelessNode
from rt_robot_os.sim.world_settings import WorldSettings

HOME = WorldSettings(
    map='open', people=('anna 1.0 0 0 9 0', 'bob 0 5 5'),
    nodes=('kitchen 3 1 1.4', 'wrist 8 8 1.0 id 31 on anna pulse_per_min alarm',
           'button 2 2 1.0 on bob alarm'))


def named(world: World, name: str) -> WirelessNode:
    return next(each for each in world.wireless.nodes if each.name == name)


def test_a_node_that_is_worn_goes_where_its_person_goes_until_it_is_put_down() -> None:
    world = World(HOME)
    world.advance(0)
    world.advance(2 * NS_PER_S)
    assert named(world, 'wrist').position_m == pytest.approx((2.0, 0.0, 1.0), abs=0.05)
    assert world.where().splitlines()[3:-1] == [
        'node kitchen 3.000 1.000 1.400 on', 'node wrist 2.000 0.000 1.000 on',
        'node button 5.000 5.000 1.000 on']
    world.inject('node wrist move 4 -1'.split())
    world.advance(3 * NS_PER_S)
    assert named(world, 'wrist').position_m == (4.0, -1.0, 1.0)


def test_nodes_lose_their_power_get_it_back_and_begin_anew() -> None:
    world = World(replace(HOME, events=('node kitchen off at 1 for 2', 'node kitchen reboot at 5',
                                        'node kitchen off at 7', 'node kitchen reboot at 8')))
    kitchen = named(world, 'kitchen')
    world.advance(0)
    found = []
    for second in (0.5, 1.5, 3.5, 5.5, 7.5, 8.5):
        world.advance(round(second * NS_PER_S))
        found.append((kitchen.on, kitchen.boots))
    assert found == [(True, 1), (False, 1), (True, 2), (True, 3), (False, 3), (False, 3)]
    world.inject('node kitchen on'.split())
    assert (kitchen.on, kitchen.boots) == (True, 4)


def test_a_button_is_pressed_by_its_own_name_or_that_of_who_wears_it() -> None:
    world = World(HOME)
    world.advance(0)
    world.inject('alarm anna 3'.split())
    world.inject('alarm button'.split())
    pressed = []
    for second in (1, 4, 9, 11):
        world.advance(second * NS_PER_S)
        pressed.append((bool(named(world, 'wrist').alarms), bool(named(world, 'button').alarms)))
    assert pressed == [(True, True), (False, True), (False, True), (False, False)]


@pytest.mark.parametrize(('line', 'text'), [
    ('node cellar off', 'node off cellar: there is no such node; there are kitchen, wrist, but'),
    ('node kitchen dance', "'node dance' is not a known event"),
    ('node kitchen', "'node' is not a known event: write kidnap X Y YAW"),
    ('node kitchen move 1', 'node NAME move X Y'),
    ('alarm kitchen', 'kitchen has no button'), ('alarm carl', 'carl has no button'),
    ('calm anna', "'calm' is not a known event")])
def test_what_cannot_happen_to_a_node_is_refused(line: str, text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        World(HOME).inject(line.split())
    assert text in str(caught.value)


def test_nobody_wears_what_is_on_nobody() -> None:
    with pytest.raises(ConfigError, match='wrist: there is no person carl to wear it; there are '
                                          'anna, bob'):
        World(replace(HOME, nodes=('wrist 1 2 1 on carl alarm',)))
    alone = World(replace(HOME, people=()))
    assert named(alone, 'wrist').position_m == (8.0, 8.0, 1.0)

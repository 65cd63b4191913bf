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

"""The shipped house: what its page promises of it."""

from __future__ import annotations

from pathlib import Path
import runpy

import pytest

from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.settings.world import load_world
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.people import PERSON_RADIUS_M
from test_flat import along
from test_flat import room

ROOT = Path(__file__).resolve().parents[2]
MAPS = ROOT / 'config' / 'maps'


@pytest.fixture(scope='module')
def world() -> World:
    return World(load_world(MAPS / 'house_world.yaml'))


def test_the_script_makes_what_is_shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / 'scripts'))
    made = runpy.run_path(str(ROOT / 'scripts' / 'make_house.py'))['made']()
    shipped = GridMap.load(MAPS / 'house.yaml')
    assert (made.cells == shipped.cells).all()
    assert (made.resolution_m, made.origin) == (shipped.resolution_m, shipped.origin)


def test_people_walk_through_no_wall_and_thirty_nodes_hang_in_no_wall(world: World) -> None:
    for text in world.settings.people:
        numbers = [float(word) for word in text.split()[2:]]
        points = list(zip(numbers[::2], numbers[1::2]))
        for at in along([*points, points[0]]):
            assert room(world, *at) > PERSON_RADIUS_M, (text, at)
    assert len(world.nodes) == 30

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

"""The shipped flat: what its page promises of it."""

from __future__ import annotations

from collections.abc import Iterator
import importlib.util
import math
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.settings.world import load_world
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.people import PERSON_RADIUS_M

ROOT = Path(__file__).resolve().parents[2]
MAPS = ROOT / 'config' / 'maps'
ALL_ROUND = np.linspace(-math.pi, math.pi, 90)


@pytest.fixture(scope='module')
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location('make_flat', ROOT / 'scripts' / 'make_flat.py')
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope='module')
def world() -> World:
    return World(load_world(MAPS / 'flat_world.yaml'))


def room(world: World, x: float, y: float) -> float:
    """Return how far the nearest wall is."""
    return float(world.walls.cast(x, y, ALL_ROUND).min()) * (not world.map.occupied(x, y)
                                                             if world.map else 1)


def along(points: list[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    for (ax, ay), (bx, by) in zip(points, points[1:]):
        for part in np.linspace(0.0, 1.0, 20):
            yield ax + part * (bx - ax), ay + part * (by - ay)


def test_the_script_makes_what_is_shipped(script: ModuleType) -> None:
    made, shipped = script.made(), GridMap.load(MAPS / 'flat.yaml')
    assert (made.cells == shipped.cells).all()
    assert (made.resolution_m, made.origin) == (shipped.resolution_m, shipped.origin)
    world = World(load_world(MAPS / 'flat_world.yaml'))
    assert '\n'.join(script.drawing(world)) == script.PICTURE.read_text(encoding='utf-8')


def test_the_runs_of_the_benchmarks_lie_in_free_space(script: ModuleType, world: World) -> None:
    x, y, long, wide = script.EIGHT
    eight = [(x + long / 2 * math.sin(t), y + wide / 2 * math.sin(2 * t))
             for t in np.linspace(0, math.tau, 40)]
    for at in (*along(list(script.RUN)), *eight):
        assert room(world, *at) > 2 * world.base.radius_m, at
        assert all(math.hypot(person.x - at[0], person.y - at[1]) > 0.6
                   for person in world.people)


def test_people_walk_through_no_wall_and_the_robot_fits_through_every_door(
        script: ModuleType, world: World) -> None:
    for text in world.settings.people:
        numbers = [float(word) for word in text.split()[2:]]
        points = list(zip(numbers[::2], numbers[1::2]))
        for at in along([*points, points[0]]):
            assert room(world, *at) > PERSON_RADIUS_M, (text, at)
    for left, bottom, right, top in script.DOORS:
        assert room(world, (left + right) / 2, (bottom + top) / 2) == pytest.approx(0.45, abs=0.01)


def test_from_everywhere_a_mark_is_in_sight(world: World) -> None:
    assert world.map is not None
    xs, ys = world.map.centres()
    free = world.map.cells == 0
    nearest = np.min([np.hypot(xs - mark.x, ys - mark.y) for mark in world.landmarks], axis=0)
    assert nearest[free].max() < 1.5
    assert len(world.nodes) == 7 and len(world.people) == 2

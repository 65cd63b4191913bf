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

"""The section of the simulated world: its file, its map, and every problem with its line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import re

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import from_json
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
from rt_robot_os.settings.world import load_world
from rt_robot_os.sim.commands import execute_command
from rt_robot_os.sim.world import World

Loader = Callable[..., RobotSettings]
Judge = Callable[..., tuple[str, ...]]

MAP = ('image: flat.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n'
       'occupied_thresh: 0.65\nfree_thresh: 0.196\n')


def with_world(*lines: str) -> str:
    section = ''.join(f'      {line}\n' for line in lines)
    return f'robot:\n  ros__parameters:\n    world:\n{section}'


@pytest.fixture
def maps(tmp_path: Path) -> Path:
    folder = tmp_path / 'maps'
    folder.mkdir()
    (folder / 'flat.yaml').write_text(MAP)
    (folder / 'flat.pgm').write_bytes(b'P5 2 1 255\n\x00\xff')
    (folder / 'world.yaml').write_text(
        'map: flat.yaml\nstart: [0.07, 0.02, 0.0]\nseed: 5\npeople: [anna 0.8 1 2 3 4]\n'
        'landmarks: ["7 1 2 0.5"]\n')
    return folder


def test_without_the_section_there_is_no_world(load_text: Loader, good: str) -> None:
    assert load_text(good).world.map == ''


def test_a_map_is_found_beside_the_file_that_names_it(load_text: Loader, maps: Path) -> None:
    text = with_world('map: maps/flat.yaml', 'start: [1.0, 2.5, 0.0]', 'people: [bob 1 0 0]')
    found = load_text(text).world
    assert found.map == str(maps / 'flat.yaml')
    assert (found.start, found.people) == ((1.0, 2.5, 0.0), ('bob 1 0 0',))


def test_a_file_of_the_world_lies_below_the_section(load_text: Loader, maps: Path) -> None:
    settings = load_text(with_world('file: maps/world.yaml', 'seed: 6'),
                         overrides={'world.slip': 0.05})
    found = settings.world
    assert (found.map, found.seed, found.slip) == (str(maps / 'flat.yaml'), 6, 0.05)
    assert found.people == ('anna 0.8 1 2 3 4',)
    assert from_json(to_json(settings)).world == found
    alone = load_world(maps / 'world.yaml')
    assert (alone.map, alone.seed, alone.landmarks) == (found.map, 5, ('7 1 2 0.5',))


def test_the_shipped_maps_are_found_by_their_name(load_text: Loader) -> None:
    assert load_text(with_world('map: open')).world.map == 'open'
    found = load_text(with_world('file: maps/flat_world.yaml')).world
    assert Path(found.map).name == 'flat.yaml' and found.people


def test_every_problem_is_told_with_its_line(problems_of: Judge, maps: Path) -> None:
    (maps / 'flat.yaml').write_text(MAP.replace('0.05', 'x').replace('0, 0, 0', '0'))
    (maps / 'world.yaml').write_text('map: flat.yaml\nsede: 5\nnodes: [a 1 2 3, a 1 2 3]\n')
    text = with_world('file: maps/world.yaml', 'start: [1]', 'slip: 2.0', 'people:',
                      '- anna 0.8 1', '- 7up 1 2 3', 'events: [dance at 3]')
    found = '\n'.join(problems_of(text)).replace(str(maps), 'maps')
    assert found.splitlines() == [
        'robot.yaml:5: world.start = [1.0]: must be 3 numbers',
        'robot.yaml:6: world.slip = 2.0: must be a number from 0 to 1',
        "robot.yaml:8: world.people = 'anna 0.8 1': must be a name, a speed in m/s and x y of "
        'each way point',
        "robot.yaml:9: world.people = '7up 1 2 3': must begin with a name: a letter, then "
        'letters, digits and _',
        "robot.yaml:10: world.events = 'dance at 3': 'dance' is not a known event: write kidnap X "
        'Y YAW; person NAME X Y [SECONDS]; walk NAME; fall NAME [SECONDS]; rise NAME; '
        'sit NAME [SECONDS]; sleep NAME [SECONDS]; speak NAME SECONDS; '
        'vital NAME SIGN VALUE [SECONDS]; press NAME help|fine [SECONDS]; '
        'answer NAME fine|help|silent; slip SHARE [SECONDS]; lamp SHARE [SECONDS]; '
        'heat NAME DEGREES [SECONDS]; node NAME off [SECONDS]; node NAME on; node NAME reboot; '
        'node NAME move X Y; alarm NAME [SECONDS]; smoke NAME [SECONDS]; water NAME [SECONDS]',
        "maps/world.yaml:1: world.map: maps/flat.yaml:2: resolution: 'x' must be a number",
        'maps/world.yaml:1: world.map: maps/flat.yaml:3: origin: must be a list of three numbers: '
        'x and y in m, yaw in rad',
        "maps/world.yaml:2: world.sede: unknown key, did you mean 'seed'?",
        'maps/world.yaml:3: world.nodes: a is listed twice',
    ]


@pytest.mark.parametrize('lines, problem', [
    (('map: nowhere.yaml',), 'nowhere.yaml: cannot be read: No such file'),
    (('file: nowhere.yaml',), 'nowhere.yaml: cannot be read: No such file'),
    (('file: maps/flat.pgm',), 'maps/flat.pgm'),
    (('map: open', 'events: [person bob 1 2 at 3]'), 'no such person; there are none'),
    (('map: maps/flat.yaml', 'start: [0.01, 0.02, 0.0]'), 'robot.yaml:5: world.start: '
     'the map has an obstacle at 0.01, 0.02: choose a free position from 0, 0 to 0.1, 0.05'),
    (('file: [1]',), 'world.file = [1]: must be a string'),
    (('map: 5',), 'world.map = 5: must be a string'),
])
def test_a_mistake_is_told(
        problems_of: Judge, maps: Path, lines: tuple[str, ...], problem: str) -> None:
    found = problems_of(with_world(*lines))
    assert len(found) == 1 and problem in found[0]


def test_what_the_page_shows_works(
        load_text: Loader, capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).resolve().parents[2] / 'docs' / 'world.md').read_text(encoding='utf-8')
    text, = re.findall(r'```yaml\n(robot:.*?)```', page, re.DOTALL)
    text = text[:text.index('    devices:')]  # the drivers are not those of this test
    # Orders are to the flat in which somebody falls: it has smoke detectors as well.
    world = World(load_text(text.replace('flat_world', 'assisted_living_world')).world)
    orders = re.findall(r'--tell "world (.*?)"', page)
    assert len(orders) > 4
    for order in orders:
        execute_command(f'world {order}', {}, world)
    assert (world.people[0].x, world.base.slip, world.lamps) == (3.4, 0.3, 0.0)
    code, = re.findall(r'```python\n(.*?)```', page, re.DOTALL)
    exec(code.replace('my_map.yaml', world.settings.map), {})
    assert capsys.readouterr().out.startswith('(3.')


def test_a_file_of_the_world_names_no_other_and_needs_a_map(maps: Path) -> None:
    (maps / 'other.yaml').write_text('file: world.yaml\n')
    with pytest.raises(ConfigError, match='other.yaml:1: file: a file with a world must not name'):
        load_world(maps / 'other.yaml')
    (maps / 'other.yaml').write_text('seed: 3\n')
    with pytest.raises(ConfigError, match='other.yaml: map is missing'):
        load_world(maps / 'other.yaml')
    (maps / 'other.yaml').write_text('')
    with pytest.raises(ConfigError, match='must have the keys of a world'):
        load_world(maps / 'other.yaml')

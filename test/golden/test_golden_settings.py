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

"""Every configuration that users are shown is read as it was, into the same parameters."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import importlib
import json
import os
from pathlib import Path
import re
import sys
import textwrap
from typing import Any

import pytest

from rt_robot_os.settings import default_path
from rt_robot_os.settings import from_json
from rt_robot_os.settings import load
from rt_robot_os.settings import parameters
from rt_robot_os.settings import to_json

pytest.importorskip('sensor_msgs.msg', reason='the ROS 2 messages are not installed')

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / 'examples' / 'rt_robot_example'
EVERYTHING = 'test/golden/everything.yaml'
BLOCK = re.compile(r'^```yaml\n(.*?)^```', re.MULTILINE | re.DOTALL)
# Not for this package, or not to be read before a user has filled it in.
NO_ROBOT = {'README.md 1', 'config/diagnostics_aggregator.yaml',
            'config/maps/assisted_living_world.yaml', 'config/maps/flat.yaml',
            'config/maps/flat_world.yaml', 'config/maps/house.yaml',
            'config/maps/house_world.yaml', 'config/nav2.yaml',
            'docs/camera_and_voice.md 1', 'docs/gateway.md 1', 'docs/localization.md 1',
            'docs/notifier.md 1', 'docs/tutorials/map_your_flat.md 1'}
# Those of sensor networks have tests of their own.
NO_ROBOTS = ('config/scenarios/', 'docs/network_simulator.md ')
HEAD = '/**/robot:\n  ros__parameters:\n'
# What a part of a file is laid over, where that is not the shipped robot.
UNDER = {'config/mapping.yaml': ROOT / 'config' / 'service_robot.yaml',
         'docs/alarms.md 2': HEAD + '    devices: []\n    topics: [command, answer]\n'
         '    command: {topic: alarms/command, message: std_msgs/msg/String, tail: 400}\n'
         '    answer: {topic: alarms/answer, message: std_msgs/msg/String, tail: 400}\n',
         'docs/tutorials/a_module_in_an_afternoon.md 1': EXAMPLE / 'config' / 'example.yaml',
         'docs/attitude.md 1': HEAD + '    devices: [imu]\n'
         '    imu: {type: witmotion, port: sim, frame_id: imu_link}\n',
         'docs/configuration.md 2': HEAD + '    devices: []\n',
         'docs/planner.md 2': HEAD + '    devices: []\n    modules: [planner]\n'
         '    planner: {type: planner, followed_topic: ""}\n    topics: [goal_pose, pose, map, '
         'slam_correction]\n    slam_correction: {topic: slam/correction, message: '
         'geometry_msgs/msg/PoseWithCovarianceStamped}\n'
         '    goal_pose: {message: geometry_msgs/msg/PoseStamped}\n'
         '    pose: {message: geometry_msgs/msg/PoseWithCovarianceStamped}\n',
         'docs/rules.md 1': ROOT / 'config' / 'sensor_network.yaml',
         'docs/rules.md 2': ROOT / 'config' / 'sensor_network.yaml',
         'docs/rules.md 3': ROOT / 'config' / 'service_robot.yaml',
         'docs/rules.md 4': ROOT / 'config' / 'sensor_network.yaml',
         'docs/rules.md 5': HEAD + '    devices: []\n',
         'docs/frames.md 1': HEAD + '    devices: [laser]\n',
         'docs/frames.md 2': HEAD + '    topics: [odom_to_base, map_to_odom]\n'
         '    odom_to_base: {message: geometry_msgs/msg/TransformStamped}\n'
         '    map_to_odom: {message: geometry_msgs/msg/TransformStamped}\n',
         'docs/frames.md 3': HEAD + '    devices: []\n'}


def whole_files() -> dict[str, str]:
    """Give the configurations of the repository by their path."""
    paths = [path for folder in ('config', 'docs', 'examples')
             for path in (ROOT / folder).rglob('*.yaml')
             if not {'build', 'install', 'log'} & set(path.relative_to(ROOT).parts)]
    names = {path.relative_to(ROOT).as_posix(): path for path in paths}
    return {name: names[name].read_text(encoding='utf-8') for name in sorted(names)} | {
        EVERYTHING: (ROOT / EVERYTHING).read_text(encoding='utf-8')}


def blocks() -> dict[str, str]:
    """Give the configurations in the pages by page and number."""
    pages = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md')),
             *sorted((ROOT / 'rt_robot_os').rglob('page.md'))]
    return {f'{page.relative_to(ROOT).as_posix()} {number}': text for page in pages
            for number, text in enumerate(BLOCK.findall(page.read_text(encoding='utf-8')), 1)}


SOURCES = {name: text for name, text in (whole_files() | blocks()).items()
           if name not in NO_ROBOT and not name.startswith(NO_ROBOTS)}


def file_of(name: str, kind: str = 'settings') -> str:
    """Give the file of a configuration in this folder."""
    return f'{kind}/{name.replace("/", "__").replace(" ", "_")}.json'


def install(setup: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a package be found as if it were installed: its modules, its entry points."""
    call = next(node for node in ast.walk(ast.parse(setup.read_text(encoding='utf-8')))
                if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'setup')
    points = next(ast.literal_eval(each.value) for each in call.keywords
                  if each.arg == 'entry_points')
    facts = folder / f'{setup.parent.name}-0.1.0.dist-info'
    facts.mkdir()
    (facts / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {setup.parent.name}\n'
                                    'Version: 0.1.0\n')
    (facts / 'entry_points.txt').write_text('\n'.join(
        f'[{group}]\n' + '\n'.join(lines) for group, lines in points.items()))
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.syspath_prepend(str(setup.parent))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Work in an empty folder, with what the examples install."""
    before = set(sys.modules)
    install(EXAMPLE / 'setup.py', tmp_path, monkeypatch)
    monkeypatch.syspath_prepend(str(ROOT / 'docs' / 'examples'))
    monkeypatch.syspath_prepend(str(ROOT / 'examples' / 'robot_base'))
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    for name in set(sys.modules) - before:
        if name.split('.')[0] in ('courier', 'my_robot', 'rt_robot_example', 'square', 'trouble'):
            del sys.modules[name]


def read(name: str, folder: Path) -> Any:
    """Load a configuration as a user would write it down."""
    text = SOURCES[name]
    paths = [folder / 'robot.yaml']
    is_part = 'ros__parameters' not in text
    if is_part:
        text = HEAD + textwrap.indent(textwrap.dedent(text), '    ')
    if is_part or name in UNDER:
        under = UNDER.get(name, default_path())
        if isinstance(under, str):
            (folder / 'under.yaml').write_text(under, encoding='utf-8')
            under = folder / 'under.yaml'
        paths.insert(0, under)
    paths[-1].write_text(text, encoding='utf-8')
    return load(paths)


def flat(value: Any, prefix: str = '') -> Iterator[tuple[str, Any]]:
    """Give what is in settings by dotted names; parts by their own."""
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from flat(item, f'{prefix}.{key}' if prefix else key)
    elif isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
        for each in value:
            name = each.get('name') or each.get('frame_id') or each['label']
            yield from flat(each, f'{prefix}.{name}')
    else:
        yield prefix, value


def written(pairs: dict[str, Any]) -> str:
    """Write one line a pair."""
    lines = (f' {json.dumps(key)}: {json.dumps(value)}' for key, value in pairs.items())
    return '{\n' + ',\n'.join(lines) + '\n}\n'


def as_file(settings: Any) -> str:
    """Write settings without what is of this machine."""
    text = to_json(settings)
    assert to_json(from_json(text)) == text
    data = json.loads(text)
    del data['format']
    data['files'] = [os.path.basename(path) for path in data['files']]
    return written(dict(sorted(flat(data)))).replace(str(ROOT), '(the package)')


@pytest.mark.parametrize('name', SOURCES)
def test_a_configuration_is_read_as_it_was(name: str, here: Path, golden: Any) -> None:
    golden.check(file_of(name), as_file(read(name, here)))


def test_no_configuration_came_or_went(golden: Any) -> None:
    assert len(SOURCES) > 30
    golden.check_files('settings', {Path(file_of(name)).name for name in SOURCES})


def test_the_package_that_new_writes_is_read_as_it_was(
    here: Path, golden: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    module, _, function = golden.programs()['new'].partition(':')
    monkeypatch.setattr(sys, 'argv', ['new', 'my_robot', '--driver', 'my_gauge', '--module',
                                      'my_module'])
    assert getattr(importlib.import_module(module), function)() == 0
    capsys.readouterr()
    package = here / 'my_robot'
    (here / 'installed').mkdir()
    install(package / 'setup.py', here / 'installed', monkeypatch)
    config, = (package / 'config').glob('*.yaml')
    golden.check('new_package.json', as_file(load([config])))


def described(each: Any) -> dict[str, Any]:
    """Give what ROS is told of a parameter."""
    field = each.field
    facts = {
        'value': each.value, 'type': field.kind.__name__,
        'item': field.item.__name__ if field.kind is list else '', 'unit': field.unit,
        'minimum': field.minimum, 'maximum': field.maximum, 'choices': list(field.choices),
        'live': each.live, 'description': field.description}
    return {key: value for key, value in facts.items()
            if key in ('value', 'type', 'live') or value not in ('', None, [])}


@pytest.mark.parametrize('name', ['config/all_devices.yaml', 'config/camera.yaml', EVERYTHING])
def test_the_parameters_of_a_robot_are_those_they_were(
    name: str, here: Path, golden: Any,
) -> None:
    found = {}
    first: dict[str, tuple[str, dict[str, Any]]] = {}
    for each in parameters(read(name, here)):
        # What many devices declare alike is written once.
        facts = described(each)
        like, known = first.setdefault(each.name.split('.', 1)[-1], (each.name, facts))
        same = like != each.name and known == {**facts, 'value': known['value']}
        found[each.name] = {'value': each.value, 'like': like} if same else facts
    golden.check(file_of(name, 'parameters'), written(found))

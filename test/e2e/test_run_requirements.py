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

"""
Each program that the README starts has all it needs in the environment of `./scripts/run PROGRAM`.

The processes are real. Each hides what the tests alone have installed: every module of a
distribution that the requirements of the program do not lead to. By hand the same is seen with
`RT_ROBOT_OS_VENV=/tmp/venv ./scripts/run PROGRAM`, in an environment that is made anew.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from importlib import metadata
import os
from pathlib import Path
import re
import shlex
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
import pytest

from rt_robot_os.base.requirements import libraries
from rt_robot_os.base.requirements import PROGRAMS

ROOT = Path(__file__).resolve().parents[2]
Until = Callable[..., Any]

PRELUDE = """
import os, sys
sys.modules.update(dict.fromkeys(os.environ['HIDDEN_MODULES'].split()))
"""
# Neither priority nor memory locks, so that many can run at once.
MODEST = ('-p', 'core.scheduler_priority:=0', '-p', 'core.lock_memory:=false',
          '-p', 'core.cpu:=-2')
# What a busy machine brings about is not what is tested.
BUSY = re.compile(r'of its budget of|stood still')


def listed(name: str) -> list[str]:
    """Give the lines of a file of requirements."""
    lines = (ROOT / 'scripts' / f'requirements-{name}.txt').read_text().splitlines()
    return [line for line in lines if line and not line.startswith('#')]


def reachable(requirements: Iterable[str]) -> set[str]:
    """Give the distributions that are installed with requirements."""
    found: set[str] = set()
    waiting = [Requirement(each) for each in requirements]
    done: set[str] = set()
    while waiting:
        each = waiting.pop()
        if str(each) in done:
            continue
        done.add(str(each))
        name = canonicalize_name(each.name)
        try:
            needed = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue
        found.add(name)
        for text in needed:
            requirement = Requirement(text)
            marker = requirement.marker
            if marker is None or any(marker.evaluate({'extra': extra})
                                     for extra in (each.extras or {''})):
                waiting.append(requirement)
    return found


def hidden(program: str) -> list[str]:
    """Give the modules that are not installed for a program."""
    asked = [each.bounded for each in libraries(['base', *PROGRAMS.get(program, ())])]
    there = reachable([*listed('run'), *asked])
    return sorted(module for module, names in metadata.packages_distributions().items()
                  if module.isidentifier() and not module.startswith('rt_robot')
                  and not any(canonicalize_name(name) in there for name in names))


@pytest.fixture
def environment(tmp_path: Path) -> Callable[[str], dict[str, str]]:
    """Give the variables with which all processes lack what a program does not install."""
    def of(program: str) -> dict[str, str]:
        (tmp_path / 'sitecustomize.py').write_text(PRELUDE)
        return {'HIDDEN_MODULES': ' '.join(hidden(program)), 'PYTHONPATH': os.pathsep.join(
            [str(tmp_path), str(ROOT), os.environ.get('PYTHONPATH', '')])}
    return of


Environment = Callable[[str], dict[str, str]]


def assert_no_errors(*programs: Any) -> None:
    for program in programs:
        assert program.end() == 0, program.output
        wrong = [line for line in program.lines if not BUSY.search(line) and re.search(
            r'\bERROR\b|Traceback|not installed', line)]
        assert wrong == [], program.output


def config(*names: str) -> list[str]:
    return [word for name in names for word in (
        '--params-file', str(ROOT / 'config' / f'{name}.yaml'))]


def test_what_is_hidden_is_what_the_tests_alone_need() -> None:
    pytest.importorskip('scipy')
    assert {'hypothesis', 'scipy', 'fastapi', 'websockets'} <= set(hidden('robot'))
    assert 'scipy' not in hidden('mapping') and 'fastapi' in hidden('mapping')
    assert not {'numpy', 'rclpy', 'PIL', 'yaml'} & set(hidden('robot'))


def test_the_readme_starts_no_other_programs_with_a_robot() -> None:
    lines = re.findall(r'^\./scripts/run([^#\n]*)', (ROOT / 'README.md').read_text(),
                       re.MULTILINE)
    named = {' '.join(Path(word).name for word in shlex.split(line)) for line in lines}
    assert named == {'', '--ros-args --params-file service_robot.yaml', 'mapping',
                     '--ros-args --params-file sensor_network.yaml', 'monitor',
                     '--ros-args --params-file assisted_living.yaml'}, 'to be tested below'


@pytest.mark.one_build
def test_the_service_robot_has_its_camera_and_mapping_its_libraries(
        world: Any, until: Until, environment: Environment) -> None:
    messages = pytest.importorskip('nav_msgs.msg')
    maps = world.listen(messages.OccupancyGrid, '/map')
    given = ['--ros-args', *config('service_robot', 'mapping'), *MODEST]
    robot = world.start('rt_robot_os.ros.program', *given, **environment('robot'))
    robot.wait_for_line('[robot.camera]: active')
    mapping = world.start('rt_robot_os.features.mapping.cli.program', *given[:-len(MODEST)],
                          **environment('mapping'))
    until(lambda: maps or mapping.process.poll() is not None, 'a map')
    assert_no_errors(mapping, robot)


@pytest.mark.one_build
def test_the_sensor_network_has_all_it_needs(world: Any, environment: Environment) -> None:
    core = world.start('rt_robot_os.core.program', '--ros-args', *config('sensor_network'),
                       *MODEST, **environment('robot'))
    core.wait_for_line('sink: active')
    assert_no_errors(core)


@pytest.mark.one_build
def test_the_monitor_shows_the_assisted_flat(
        world: Any, environment: Environment, tmp_path: Path) -> None:
    monitor = world.start('rt_robot_os.monitor.program', '--demo', '--port', '0', '--folder',
                          str(tmp_path / 'monitor'), **environment('monitor'))
    monitor.wait_for_line('nobody has an account yet')
    monitor.wait_for_line('camera]: active')
    assert_no_errors(monitor)

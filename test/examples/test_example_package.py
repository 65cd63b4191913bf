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

"""Does the example package build beside ours, pass its own tests, and run in a core."""

from __future__ import annotations

from collections.abc import Iterator
import importlib.util
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time
from xml.etree import ElementTree

import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / 'examples' / 'rt_robot_example'
COLCON = 'import sys; from colcon_core.command import main; sys.exit(main())'
TIMEOUT_S = 60.0


class Workspace:
    """A colcon workspace with a link to our package and a copy of the example."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / 'src').mkdir()
        (folder / 'src' / 'rt_robot_os').symlink_to(ROOT)
        shutil.copytree(EXAMPLE, folder / 'src' / EXAMPLE.name, ignore=shutil.ignore_patterns(
            '__pycache__', '.*', '*.egg-info', 'build', 'install', 'log'))
        self.environment = {**os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(folder)}
        self.add_path(ROOT)

    def add_path(self, path: Path) -> None:
        self.environment['PYTHONPATH'] = os.pathsep.join(
            [str(path), self.environment.get('PYTHONPATH', '')]).rstrip(os.pathsep)

    def colcon(self, *arguments: str) -> str:
        done = subprocess.run(
            [sys.executable, '-c', COLCON, *arguments], cwd=self.folder, env=self.environment,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert done.returncode == 0, done.stdout
        return done.stdout


@pytest.fixture(scope='module')
def workspace() -> Iterator[Workspace]:
    if importlib.util.find_spec('colcon_core') is None:
        pytest.skip('colcon is not installed')
    # Short: a Unix socket's path has 108 bytes.
    with tempfile.TemporaryDirectory(prefix='rte') as name:
        made = Workspace(Path(name))
        # Ours is built by whoever runs the tests.
        made.colcon('build', '--base-paths', 'src/rt_robot_example')
        for installed in (made.folder / 'install').rglob('site-packages'):
            made.add_path(installed)
        yield made


def test_colcon_finds_both_packages_once(workspace: Workspace) -> None:
    listed = [line.split() for line in workspace.colcon('list').splitlines()]
    assert sorted((name, kind) for name, _, kind in listed) == [
        ('rt_robot_example', '(ros.ament_python)'), ('rt_robot_os', '(ros.ament_python)')]


def test_its_launch_file_gives_ours_what_it_takes() -> None:
    example = ElementTree.parse(EXAMPLE / 'launch' / 'example.launch.xml').getroot()
    ours = ElementTree.parse(ROOT / 'launch' / 'robot.launch.xml').getroot()
    include, = example.iter('include')
    assert include.get('file') == '$(find-pkg-share rt_robot_os)/launch/robot.launch.xml'
    taken = {each.get('name') for each in ours.iter('arg')}
    assert {each.get('name') for each in include} <= taken


def test_its_own_tests_pass(workspace: Workspace) -> None:
    text = workspace.colcon(
        'test', '--base-paths', 'src/rt_robot_example', '--return-code-on-test-failure',
        '--event-handlers', 'console_direct+')
    assert ' passed' in text


def test_a_core_runs_its_driver_and_its_module(workspace: Workspace) -> None:
    share = workspace.folder / 'install' / EXAMPLE.name / 'share' / EXAMPLE.name
    assert (share / 'launch' / 'example.launch.xml').is_file()
    process = subprocess.Popen(
        [sys.executable, '-m', 'rt_robot_os.core.program', '--ros-args', '--params-file',
         str(share / 'config' / 'example.yaml'), '-p', 'core.scheduler_priority:=0',
         '-p', 'core.lock_memory:=false', '-p', 'core.cpu:=-2'],
        cwd='/', stderr=subprocess.PIPE, text=True, env=workspace.environment)
    try:
        with connect(workspace.folder, process) as client:
            seen: set[int] = set()
            client.on_data = lambda head, cdr: seen.add(head.channel)
            wanted = {client.mirror(topic) for topic in ('battery', 'battery/low')}
            deadline = time.monotonic() + TIMEOUT_S
            while not wanted <= seen and time.monotonic() < deadline:
                client.pump(0.1)
            assert wanted <= seen
            assert client.topics['battery'].type_name == 'sensor_msgs/msg/BatteryState'
    finally:
        process.terminate()
        _, said = process.communicate()
    assert process.returncode == 0, said
    assert 'gauge: active' in said


def connect(folder: Path, process: subprocess.Popen[str]) -> LinkClient:
    deadline = time.monotonic() + TIMEOUT_S
    while process.poll() is None and time.monotonic() < deadline:
        try:
            return LinkClient(folder / 'robot.sock', 'test', timeout_s=TIMEOUT_S)
        except LinkError:
            time.sleep(0.02)
    process.kill()
    pytest.fail(f'no core answered: {process.communicate()[1]}')

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

"""A core is loaded while its node is checked, and opens nothing before it is started."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
import tempfile

import pytest

from rt_robot_os.core.simulators import device_folder
from rt_robot_os.link import LinkClient
from rt_robot_os.linux.process import start_child
from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.settings import load
from rt_robot_os.settings import to_json

TIMEOUT_S = 60.0
ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    devices: [sonar]
    sonar: {type: maxbotix, port: sim, sim: {rate_hz: 50.0}}
"""


@pytest.fixture
def settings(tmp_path: Path) -> str:
    (tmp_path / 'robot.yaml').write_text(ROBOT)
    return to_json(load([tmp_path / 'robot.yaml']))


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix='rtc') as name:  # a socket's path must be short
        monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', name)
        monkeypatch.setenv('ROS_LOG_DIR', f'{name}/log')
        yield Path(name)


@pytest.fixture
def core(folder: Path) -> Iterator[CoreProcess]:
    process = CoreProcess('', folder / 'robot.sock')
    yield process
    process.stop()


def child_of(core: CoreProcess) -> subprocess.Popen[bytes]:
    assert core._process is not None
    return core._process


def wait_until_ready(core: CoreProcess) -> None:
    while core.wait_until_ready(TIMEOUT_S):
        pass


@pytest.mark.parametrize('prepared', [False, True])
def test_a_core_that_is_not_started_ends_in_silence_and_has_opened_nothing(
        core: CoreProcess, folder: Path, settings: str, prepared: bool,
        capfd: pytest.CaptureFixture[str]) -> None:
    core.load()
    assert core.starts == 0 and not core.alive() and core.pid
    if prepared:
        core.prepare(settings)
    child = child_of(core)
    assert child.stdin is not None
    child.stdin.close()
    assert child.wait(TIMEOUT_S) == 0
    assert list(folder.iterdir()) == []
    assert capfd.readouterr() == ('', '')


@pytest.mark.parametrize('prepared', [False, True])
def test_a_core_that_was_loaded_runs_as_the_settings_say_with_which_it_is_started(
        core: CoreProcess, folder: Path, settings: str, prepared: bool) -> None:
    core.load()
    loaded = core.pid
    if prepared:
        core.prepare(settings.replace('sonar', 'another'))
    core.set_settings(settings)
    core.start()
    assert (core.pid, core.starts, core.alive()) == (loaded, 1, True)
    wait_until_ready(core)
    with LinkClient(folder / 'robot.sock', timeout_s=TIMEOUT_S) as client:
        assert 'sonar' in str(client.core['tasks'])
    assert (device_folder(folder / 'robot.sock') / 'sonar').exists()
    core.stop()
    assert not core.alive() and core.exit_code == 0
    assert not device_folder(folder / 'robot.sock').exists()


def test_a_core_whose_settings_are_not_known_in_time_is_stopped_at_once(
        core: CoreProcess, folder: Path) -> None:
    core.load()
    core.stop()
    assert not core.pid and not core.alive()
    assert list(folder.iterdir()) == []


def test_a_core_that_has_ended_before_it_was_started_is_started_anew(
        core: CoreProcess, folder: Path, settings: str) -> None:
    core.load()
    os.kill(core.pid, signal.SIGKILL)
    child_of(core).wait(TIMEOUT_S)
    core.prepare(settings)
    core.set_settings(settings)
    core.start()
    assert core.alive() and core.exit_code is None
    wait_until_ready(core)
    LinkClient(folder / 'robot.sock', timeout_s=TIMEOUT_S).close()


def test_nobody_waits_for_a_core_that_refuses_its_settings(
        core: CoreProcess, capfd: pytest.CaptureFixture[str]) -> None:
    core.set_settings('{}')
    core.start()
    wait_until_ready(core)
    assert core.ended_within(TIMEOUT_S)
    assert core.exit_code == 2
    assert 'settings: not of format' in capfd.readouterr().err


def test_what_keeps_simulated_devices_running_ends_when_there_are_none(
        folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    keeper = start_child('rt_robot_os.core.simulator_supervisor', os.getpid(), folder / 'robot',
                         stdin=subprocess.PIPE)
    assert keeper.stdin is not None
    keeper.stdin.close()
    assert keeper.wait(TIMEOUT_S) == 0
    assert list(folder.iterdir()) == []
    assert capfd.readouterr() == ('', '')

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


"""A real core process for each thing that its watchdog can do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import signal
import socket
import subprocess
import time
from typing import Any

from core_tools import Start
from processes import TIMEOUT_S
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.kernel import TaskState
from rt_robot_os.link import LinkClient

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')


def connect(folder: Path, process: subprocess.Popen[str]) -> LinkClient:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        try:
            return LinkClient(folder / 'robot.sock', 'test', timeout_s=TIMEOUT_S)
        except LinkError:
            time.sleep(0.01)
    pytest.fail('the core did not answer')


def until(condition: Callable[[], Any], what: str) -> Any:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    pytest.fail(f'{what} did not happen')


def test_exit_ends_the_process_with_its_code(start: Start) -> None:
    # Long enough for an end in order: after it the handle ends the process.
    process = start('timeout_s: 1, action: exit, exit_code: 71')
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == 71
    assert "[FATAL] watchdog: task 'it' has ended no job well for" in errors
    assert 'the core ends with exit code 71' in errors


def test_a_loop_without_end_in_python_ends_by_the_handle(start: Start) -> None:
    process = start('timeout_s: 0.5, action: exit',
                    'Hanging, native: false, priority: 20')
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == -signal.SIGABRT
    assert 'in hang' in errors


@pytest.mark.parametrize('action', ['log', 'exit'])
def test_a_native_call_without_end_ends_the_process_whatever_the_action(
        action: str, start: Start) -> None:
    process = start(f'timeout_s: 0.5, action: {action}', 'Hanging')
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == -signal.SIGABRT
    assert 'Fatal Python error: Aborted' in errors
    assert 'core_modules.py' in errors and 'in hang' in errors


def test_log_tells_and_lets_it_live(start: Start, folder: Path) -> None:
    process = start('timeout_s: 1, action: log')
    with connect(folder, process) as client:
        until(lambda: client.statistics().core['watchdog'].startswith(
            "task 'it' has ended no job well for"), 'an unhealthy task')
        time.sleep(2.5)  # longer than the handle holds
        assert client.statistics().core['pid'] == process.pid
    process.send_signal(signal.SIGTERM)
    assert '[ERROR] watchdog: ' in process.communicate(timeout=60)[1]
    assert process.returncode == 0


def test_a_safe_state_is_held_until_somebody_rearms_it(start: Start, folder: Path) -> None:
    process = start('timeout_s: 1, action: safe_state',
                    'Safe, raises: 20, heals: 200')
    with connect(folder, process) as client:
        def state() -> TaskState:
            return next(t.state for t in client.statistics().tasks if t.name == 'it')

        until(lambda: state() is TaskState.SAFE, 'the safe state')
        until(lambda: client.statistics().core['watchdog'] == "task 'it' is held (safe)",
              'the reason')
        assert client.request('rearm') == {'tasks': ['it']}
        assert client.request('rearm', task='it') == {'tasks': []}
        # It fails a few times more, on a busy machine for long enough to be held again.
        until(lambda: client.request('rearm') and state() is TaskState.ACTIVE
              and client.statistics().core['watchdog'] == 'healthy', 'a healthy robot')
        with pytest.raises(LinkError, match="no task 'arm'"):
            client.request('rearm', task='arm')


def test_the_service_manager_and_the_machine_are_fed_while_all_is_well(
        start: Start, folder: Path) -> None:
    machine = folder / 'watchdog'
    machine.touch()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(folder / 'notify'))
        manager.settimeout(60.0)
        process = start(f'timeout_s: 1, device: {machine}', 'Noted',
                        NOTIFY_SOCKET=str(folder / 'notify'), WATCHDOG_USEC='400000')
        told = [manager.recv(200) for _ in range(8)]
        assert told.count(b'READY=1') == 1
        assert set(told) == {b'READY=1', b'WATCHDOG=1'}
        process.send_signal(signal.SIGTERM)
        until(lambda: manager.recv(200) == b'STOPPING=1', 'the last word')
        process.communicate(timeout=60)
    assert process.returncode == 0
    food = machine.read_bytes()
    assert len(food) > 3 and set(food[:-1]) == {0} and food.endswith(b'V')


def test_they_starve_when_a_task_stands_still(start: Start, folder: Path) -> None:
    machine = folder / 'watchdog'
    machine.touch()
    process = start(f'timeout_s: 1, device: {machine}, action: exit', 'Noted, raises: 40')
    process.communicate(timeout=60)
    assert process.returncode == 70
    # Not stopped: unless the next core takes over in time the machine starts anew.
    assert machine.read_bytes().strip(b'\0') == b''


def test_a_machine_without_the_device_says_so(start: Start, folder: Path) -> None:
    process = start(f'timeout_s: 1, device: {folder}/none', 'Noted')
    with connect(folder, process) as client:
        results = {r['step']: r for r in client.statistics().core['realtime']}
        assert results['end of a process that hangs']['ok']
        refused = results[f'watchdog {folder}/none']
        assert not refused['ok'] and 'modprobe softdog' in refused['reason']

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

"""Supervision goes on whatever goes wrong, gives slow cores more time, and judges fairly."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from contextlib import suppress
import itertools
import json
import os
from pathlib import Path
import socket
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

import pytest

from rt_robot_os.link.client import Question
from rt_robot_os.link.liveness import LivenessPage
from rt_robot_os.link.liveness import LivenessReader
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import parse_header
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.linux.process import scheduling_state
from rt_robot_os.ros import supervisor as under_test
from rt_robot_os.ros.core_health import SilenceTimer
from rt_robot_os.ros.core_health import StarvationDetector
from rt_robot_os.ros.supervisor import Supervisor

TIMEOUT_S = 60.0


def wait_for(condition: Callable[[], Any], what: str) -> Any:
    deadline_s = time.monotonic() + TIMEOUT_S
    while not (value := condition()):
        if time.monotonic() > deadline_s:
            pytest.fail(f'{what} did not happen')
        time.sleep(0.005)
    return value


class FakeProcess:
    """A core that starts and never answers, or cannot even be started."""

    def __init__(self, fail: bool = False) -> None:
        self.fail = fail
        self.starts = self.kills = 0
        self.exit_code: int | None = None
        self.running = False
        self.liveness: LivenessReader | None = None
        self.pid = 0

    def take_liveness(self) -> LivenessReader | None:
        return self.liveness

    def start(self) -> None:
        self.starts += 1
        if self.fail:
            raise OSError(24, 'Too many open files')
        self.running = True

    def wait_until_ready(self, timeout_s: float) -> bool:
        return False

    def alive(self) -> bool:
        if self.fail and self.starts > 2:
            raise PermissionError(1, 'Operation not permitted')
        return self.running

    def kill(self) -> None:
        self.kills += 1
        self.running = False
        self.exit_code = -9

    stop = kill

    def ended_within(self, timeout_s: float) -> bool:
        return not self.running


class Story:
    """A supervisor and what it says."""

    def __init__(self, path: Path, process: FakeProcess | None) -> None:
        self.said: list[str] = []
        self.supervisor = Supervisor(
            path, process, StampMapper(),  # type: ignore[arg-type]
            lambda severity, text: self.said.append(text), lambda *line: None, name='test',
            on_connect=lambda client: None, on_disconnect=lambda: None, heartbeat_s=0.1,
            statistics_period_s=1.0)

    def told(self, text: str) -> bool:
        return any(text in line for line in list(self.said))


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(under_test, '_PAUSE_FIRST_S', 0.01)
    monkeypatch.setattr(under_test, '_PAUSE_MAXIMUM_S', 0.02)
    with tempfile.TemporaryDirectory(prefix='rts') as name:
        yield Path(name)


def test_a_core_that_starts_slowly_gets_more_time_with_each_attempt(
        folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(under_test, '_START_TIMEOUT_S', 0.1)
    process = FakeProcess()
    story = Story(folder / 'none.sock', process)
    story.supervisor._start_limit_s = 0.1
    story.supervisor.start()
    wait_for(lambda: process.kills >= 3, 'three attempts')
    story.supervisor.stop()
    assert story.told('within 0.1 s and is killed; the next start may take 0.2 s')
    assert story.told('within 0.2 s and is killed; the next start may take 0.4 s')


def test_a_core_whose_first_jobs_starve_its_link_is_not_killed_and_they_are_named(
        folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(under_test, '_START_TIMEOUT_S', 0.1)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(str(folder / 'mute.sock'))
    listener.listen(1)  # and nobody comes to accept, or to answer
    page = LivenessPage()
    process = FakeProcess()
    process.liveness = LivenessReader(os.dup(page.fd))
    story = Story(folder / 'mute.sock', process)
    story.supervisor._start_limit_s = 0.1
    ticks = itertools.count(1)
    story.supervisor.start()
    try:
        begin_s = time.monotonic()
        while not story.told("task 'mapper' runs") or time.monotonic() - begin_s < 1.0:
            assert time.monotonic() - begin_s < TIMEOUT_S, story.said
            page.write(next(ticks) * 10**8 + 10**9, 1, 'mapper')
            time.sleep(0.005)
        assert process.kills == 0 and process.starts == 1
    finally:
        story.supervisor.stop()
        listener.close()
        page.close()


class Unmoved(FakeProcess):
    """A core that a kill does not end, as it never comes to run."""

    def kill(self) -> None:
        self.kills += 1

    stop = kill


def test_a_core_that_does_not_end_when_it_is_killed_is_not_told_as_ended(
        folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    process = Unmoved()
    story = Story(folder / 'none.sock', process)
    story.supervisor._start_limit_s = 0.1
    story.supervisor.start()
    wait_for(lambda: story.told('was killed and has not ended yet'), 'the reason')
    story.supervisor.stop()
    assert not story.told('None')


def test_supervision_goes_on_when_a_core_cannot_be_started_or_looked_at(folder: Path) -> None:
    process = FakeProcess(fail=True)
    story = Story(folder / 'none.sock', process)
    story.supervisor.start()
    wait_for(lambda: story.told('cannot be started: Too many open files')
             and story.told('PermissionError in supervision'), 'both told')
    process.fail = False
    starts = process.starts
    wait_for(lambda: process.starts > starts, 'another start')
    story.supervisor.stop()


HELLOS: list[Any] = [
    {}, {'topics': None}, {'topics': [{'nonsense': 1}]}, {'topics': [5]},
    {'topics': [], 'pid': 'x', 'tasks': None}, []]


@pytest.mark.parametrize('hello', HELLOS)
def test_whatever_answers_the_hello_supervision_goes_on(folder: Path, hello: Any) -> None:
    path = folder / 'core.sock'
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(str(path))
    listener.listen()
    greeted: list[int] = []

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            with connection, suppress(OSError):
                request = json.loads(connection.recv(10_000)[HEADER_BYTES:])
                connection.send(encode_json(PacketKind.REPLY, hello, seq=request['id']))
                connection.send(encode_json(PacketKind.REPORT, {'severity': 'none'}))
                greeted.append(request['id'])

    threading.Thread(target=serve, daemon=True).start()
    story = Story(path, None)
    story.supervisor.start()
    try:
        wait_for(lambda: len(greeted) > 2, 'more attempts')
        assert story.supervisor._thread.is_alive()
    finally:
        listener.close()
        story.supervisor.stop()


def test_time_in_which_the_node_did_not_run_is_no_silence_of_the_core() -> None:
    now_s = 100.0
    silence = SilenceTimer(lambda: now_s)
    assert silence.update(1) == 0.0
    for _ in range(10):
        now_s += 0.05
        silence.update(1)
    assert silence.silent_s == pytest.approx(0.5)
    now_s += 4.0  # stopped
    assert silence.update(1) < 1.0
    assert silence.update(2) == 0.0


def test_a_core_that_linux_does_not_let_run_does_not_hang() -> None:
    ready, computed_ns = True, 5_000_000_000
    starvation = StarvationDetector(lambda pid: (ready, computed_ns))
    assert not starvation.update(7, 0.0)
    assert not starvation.update(7, 1.0)  # nothing to compare with yet
    assert starvation.update(7, 3.0)
    computed_ns += 100_000_000
    assert starvation.update(7, 3.5)
    computed_ns += 900_000_000  # it computes without an end
    assert not starvation.update(7, 4.0)
    assert not starvation.update(7, 0.0)
    assert not starvation.update(7, 1.0)
    ready = False  # it waits for something that does not come
    assert not starvation.update(7, 3.0)
    assert not starvation.update(0, 3.0)


@pytest.mark.parametrize('computes', [True, False])
def test_a_process_is_looked_at(computes: bool) -> None:
    code = 'print(1, flush=True)\n' + ('while True: pass' if computes else 'input()')
    with subprocess.Popen([sys.executable, '-c', code], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        _, before_ns = scheduling_state(process.pid)
        if computes:
            wait_for(lambda: scheduling_state(process.pid)[0]
                     and scheduling_state(process.pid)[1] > before_ns, 'computing')
        else:
            wait_for(lambda: not scheduling_state(process.pid)[0], 'waiting')
        process.kill()
    assert scheduling_state(process.pid) == (False, 0)


class Refusing(FakeProcess):
    """A core that refuses at once what it is given."""

    def start(self) -> None:
        super().start()
        self.running = False
        self.exit_code = 2


def test_a_core_that_refuses_its_configuration_is_not_started_again(folder: Path) -> None:
    story = Story(folder / 'none.sock', Refusing())
    story.supervisor.start()
    wait_for(lambda: story.supervisor.fatal, 'the end')
    story.supervisor.stop()


def test_a_core_that_ran_before_is_tried_again_whatever_it_says(folder: Path) -> None:
    process = Refusing()
    story = Story(folder / 'none.sock', process)
    story.supervisor.connections = 1
    story.supervisor.start()
    wait_for(lambda: process.starts > 3, 'more attempts')
    assert not story.supervisor.fatal
    assert story.told('did not restart')
    story.supervisor.stop()


def test_an_answer_without_statistics_is_told_and_keeps_the_connection(folder: Path) -> None:
    supervisor = Story(folder / 'none.sock', None).supervisor
    question = Question('statistics', {}, 1)
    packet = encode_json(
        PacketKind.REPLY, {'error': 'too many answers are still on their way'}, seq=1)
    question.packets = [(parse_header(packet), packet)]
    supervisor.store_statistics(question)
    assert supervisor.statistics is None
    assert supervisor.reason == ('the core sends no statistics: too many answers are still on '
                                 'their way')
    packet = encode_json(PacketKind.REPLY, {'part': 'core', 'pid': 7}, seq=2)
    question.packets = [(parse_header(packet), packet)]
    supervisor.store_statistics(question)
    assert supervisor.statistics is not None and supervisor.statistics.core == {'pid': 7}
    assert supervisor.reason == ''

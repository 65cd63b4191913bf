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

"""The notifier beside a real core: once, whatever is killed, and no channel waits for another."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import json
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time
from typing import Any

from processes import environment
from processes import has_ended
from processes import wait_until
import pytest

from rt_robot_os.base.errors import StartError
from rt_robot_os.features.alarms.notifier.command import run
from rt_robot_os.features.alarms.notifier.notifier import Notifier
from rt_robot_os.features.alarms.notifier.settings import load
from rt_robot_os.link.robots import LockFile
from small_servers import serving
from small_servers import Web


def settings(folder: Path, **channels: dict[str, Any]) -> Path:
    path = folder / 'notifier.yaml'
    path.write_text(json.dumps({'/**/notifier': {'ros__parameters': {
        'channels': list(channels), 'folder': str(folder / 'memory'), 'heartbeat_s': 0.1,
        **channels}}}))
    return path


@contextmanager
def notifier(core: Any, folder: Path, said: list[str] | None = None,
             **channels: dict[str, Any]) -> Iterator[Notifier]:
    """Run a notifier in a thread; the core's ring still holds what other tests have sent."""
    made = Notifier(load([settings(folder, **channels)], {}, {}), core.folder / 'robot.sock',
                    folder / 'memory' / 'deliveries.jsonl',
                    (said if said is not None else []).append)
    ended = threading.Event()
    thread = threading.Thread(target=made.run, args=(ended.is_set,))
    thread.start()
    try:
        yield made
    finally:
        ended.set()
        thread.join()


def notify(core: Any, key: str, channel: str, **more: Any) -> None:
    core.publish('alarms/notify', {
        'key': key, 'channel': channel, 'alarm': '7', 'step': 0, 'level': 'critical',
        'subject': 'anna', 'text': 'anna fell', 'kinds': ['fall'], **more})


def reports(core: Any) -> dict[str, tuple[bool, str]]:
    found = [json.loads(text) for text in list(core.heard['alarms/report'])]
    return {each['key']: (each['ok'], each['text']) for each in found}


def keys(path: Path) -> list[str]:
    return [json.loads(line)['key'] for line in path.read_text().splitlines()
            ] if path.exists() else []


def test_a_slow_channel_delays_no_other_and_a_full_one_says_so(core: Any, tmp_path: Path) -> None:
    with serving(Web()) as web:
        assert isinstance(web, Web)
        web.wait.clear()
        with notifier(core, tmp_path, slow={'type': 'webhook', 'url': web.url, 'queue': 1,
                                            'timeout_s': 60.0},
                      quick={'type': 'file', 'path': str(tmp_path / 'quick.jsonl')}) as made:
            notify(core, 's1', 'slow')
            wait_until(lambda: made.senders['slow'].busy_since_ns, 'the slow delivery')
            for key in ('s2', 's3'):
                notify(core, key, 'slow')
            notify(core, 'q1', 'quick')
            notify(core, 'x1', 'nobody')
            core.publish('alarms/notify', 'nonsense')
            wait_until(lambda: {'q1', 's3', 'x1'} <= set(reports(core)), 'reports')
            assert keys(tmp_path / 'quick.jsonl') == ['q1']
            assert reports(core)['q1'] == (True, 'written')
            assert reports(core)['s3'] == (False, 'too many notifications wait for this channel')
            assert reports(core)['x1'] == (False, 'the notifier has no such channel; it has slow, '
                                                  'quick')
            assert 's1' not in reports(core)
            web.wait.set()
            wait_until(lambda: {'s1', 's2'} <= set(reports(core)), 'the slow ones')
            assert [content['key'] for _, _, content in web.posts] == ['s1', 's2']

            def beat() -> dict[str, Any]:
                said = core.heard['notifier/heartbeat']
                return dict(json.loads(said[-1])) if said else {}

            wait_until(lambda: beat().get('channels', {}).get('slow', {}).get('delivered') == 2,
                       'a heartbeat')
            assert beat()['malformed'] == 1 and beat()['unknown_channel'] == 1


def test_what_is_sent_again_is_not_told_again_and_its_report_is(
        core: Any, tmp_path: Path) -> None:
    path = tmp_path / 'calls.jsonl'
    said: list[str] = []
    calls = {'type': 'file', 'path': str(path)}
    with notifier(core, tmp_path, said, calls=calls):
        for _ in range(3):
            notify(core, 'a1', 'calls')
        wait_until(lambda: 'a1' in reports(core), 'a report')
        core.kill()
        core.heard['alarms/report'].clear()
        core.start()
        # The core that comes back may not have heard: it is told without having asked.
        wait_until(lambda: reports(core).get('a1') == (True, 'written'), 'the report again')
        notify(core, 'a1', 'calls')
        notify(core, 'a2', 'calls')
        wait_until(lambda: 'a2' in reports(core), 'the next one')
    waits = [line for line in said if line.endswith('; waiting for it')]
    assert waits and not any('?' in line for line in waits)  # nobody has to answer
    with notifier(core, tmp_path, calls=calls):  # its ring still holds both
        notify(core, 'a3', 'calls')
        wait_until(lambda: 'a3' in reports(core), 'one after a restart of the notifier')
    assert keys(path) == ['a1', 'a2', 'a3']


def test_what_is_too_old_is_reported_and_not_told(core: Any, tmp_path: Path) -> None:
    path = tmp_path / 'calls.jsonl'
    # Longer than expires_s, and not before a machine that has just booted began to count.
    long_ago_ns = time.monotonic_ns() - 90 * 10 ** 9
    core.publish('alarms/notify', {'key': 'old', 'channel': 'calls'}, stamp_ns=long_ago_ns)
    with notifier(core, tmp_path, calls={'type': 'file', 'path': str(path)}):
        wait_until(lambda: 'old' in reports(core), 'a report')
    is_told, why = reports(core)['old']
    assert not is_told and re.fullmatch(r'was \d+ s old when its turn came', why)
    assert 'old' not in keys(path)


def start(core: Any, path: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, '-m', 'rt_robot_os.features.alarms.notifier.program', '--ros-args',
         '--params-file', str(path)], cwd='/', env=environment(core.folder),
        stderr=subprocess.DEVNULL)


def test_a_notifier_that_is_killed_shows_nothing_twice(core: Any, tmp_path: Path) -> None:
    calls, pages, wait = (tmp_path / name for name in ('calls.jsonl', 'pages.jsonl', 'wait'))
    wait.touch()
    page = (f'cat >> {pages}; echo >> {pages}; while [ -e {wait} ]; do sleep 0.01; done')
    path = settings(tmp_path, calls={'type': 'file', 'path': str(calls)},
                    page={'type': 'command', 'command': ['sh', '-c', page], 'timeout_s': 60.0})
    first = start(core, path)
    # Before it began they might have been told by an earlier one, whose heart-beat is there still.
    wait_until(lambda: any(set(json.loads(each)['channels']) == {'calls', 'page'}
                           for each in list(core.heard['notifier/heartbeat'])), 'the first')
    notify(core, 'k1', 'calls')
    notify(core, 'k2', 'page')
    wait_until(lambda: 'k1' in reports(core) and pages.exists() and '\n\n' not in pages.read_text()
               and pages.read_text().endswith('\n'), 'both under way')
    first.send_signal(signal.SIGKILL)
    first.wait()
    wait.unlink()
    core.heard['alarms/report'].clear()
    second = start(core, path)
    try:
        wait_until(lambda: {'k1', 'k2'} <= set(reports(core)), 'reports of the second')
        assert second.poll() is None
    finally:
        second.send_signal(signal.SIGTERM)
        assert second.wait() == 0
    assert [key for key in keys(calls) if key.startswith('k')] == ['k1']
    # Nobody knows whether the page of the first went out: it goes with the same key, and says so.
    once, twice = (json.loads(line) for line in pages.read_text().split('\n') if line)
    assert once['key'] == twice['key'] == 'k2' and 'again' not in once and twice['again'] is True


def test_the_program_of_a_channel_ends_with_a_notifier_that_is_killed(
        core: Any, tmp_path: Path) -> None:
    pids = tmp_path / 'pids'
    page = f'sleep 600 & echo $$ $! > {pids}.new; mv {pids}.new {pids}; wait'
    path = settings(tmp_path, page={'type': 'command', 'command': ['sh', '-c', page],
                                    'timeout_s': 60.0})
    notifier = start(core, path)
    wait_until(lambda: core.heard['notifier/heartbeat'], 'the notifier')
    notify(core, 'k1', 'page')
    wait_until(pids.exists, 'the program')
    notifier.send_signal(signal.SIGKILL)
    notifier.wait()
    for pid in map(int, pids.read_text().split()):
        wait_until(lambda pid=pid: has_ended(pid), f'the end of {pid}')


def test_wrong_use_is_told(core: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = settings(tmp_path, family={'type': 'console'})
    asked = ['--ros-args', '--params-file', str(path)]
    assert run(['--check', *asked]) == 0 and capsys.readouterr().out == 'family: console\n'
    assert run([]) == 2 and 'no channel: write channels' in capsys.readouterr().err
    assert run([*asked, '-p', 'family.tpye:=file']) == 2
    assert 'family.tpye: unknown key' in capsys.readouterr().err
    for robot, more in (('robot', []), ('arm.robot', ['-r', '__ns:=/arm']),
                        ('arm.r2', ['--', '--robot', '/arm/r2'])):
        other = LockFile(core.folder / f'{robot}-notifier.lock')
        assert other.acquire()
        try:
            with pytest.raises(StartError, match=f'of the robot {robot} runs already: two would'):
                run([*asked, *more])
        finally:
            other.release()

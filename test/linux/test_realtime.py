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


"""Each step of the real-time set-up works or says why not and what to do."""

from __future__ import annotations

from collections.abc import Callable
import json
import os
import subprocess

import pytest

NOBODY = 65534

Runner = Callable[..., subprocess.CompletedProcess[str]]

CODE = """
import json, os, resource
from rt_robot_os.linux import realtime
{before}
results = [{steps}]
print(json.dumps([(r.ok, r.step, r.reason, str(r)) for r in results]))
"""

# Once everything is imported: another user need not be able to read this Python.
AS_NOBODY = f"""
for limit in (resource.RLIMIT_RTPRIO, resource.RLIMIT_MEMLOCK, resource.RLIMIT_NICE):
    resource.setrlimit(limit, (0, 0))
os.setgroups([])
os.setgid({NOBODY})
os.setuid({NOBODY})
"""

Results = list[tuple[bool, str, str, str]]


@pytest.fixture
def ask(run_code: Runner) -> Callable[..., Results]:
    def run(*steps: str, before: str = '') -> Results:
        done = run_code(CODE.format(before=before, steps=', '.join(steps)))
        assert done.returncode == 0, done.stderr
        return [tuple(result) for result in json.loads(done.stdout)]

    return run


needs_root = pytest.mark.skipif(
    os.getuid() != 0, reason='not root: cannot run anything as another user')


@needs_root
@pytest.mark.parametrize(('step', 'name', 'remedy'), [
    ('realtime.set_fifo(50)', 'SCHED_FIFO priority 50', 'rtprio'),
    ('realtime.lock_memory()', 'locked memory', 'memlock'),
])
def test_what_an_ordinary_user_may_not_have_comes_with_a_remedy(
        ask: Callable[..., Results], step: str, name: str, remedy: str) -> None:
    (ok, told, reason, text), = ask(step, before=AS_NOBODY)
    assert not ok
    assert told == name
    assert 'Remedy: ' in reason
    assert remedy in reason
    assert '/etc/security/limits.conf' in reason
    assert text == f'{name}: {reason}'


@needs_root
def test_what_an_ordinary_user_may_have_is_in_force(ask: Callable[..., Results]) -> None:
    results = ask('realtime.set_affinity(-1)', 'realtime.set_timer_slack()',
                  'realtime.freeze_garbage()', before=AS_NOBODY)
    assert [ok for ok, _, _, _ in results] == [True] * 3
    assert all(text.endswith(': active') for _, _, _, text in results)


def test_a_step_that_is_in_force_can_be_seen(run_code: Runner) -> None:
    done = run_code("""
import gc, os
from rt_robot_os.linux import realtime
assert realtime.set_affinity(-1).ok
assert len(os.sched_getaffinity(0)) == 1
assert realtime.set_timer_slack().ok
assert open('/proc/self/timerslack_ns').read().strip() == '1'
assert realtime.freeze_garbage().ok
assert not gc.isenabled() and gc.get_freeze_count() > 1000
if realtime.lock_memory().ok:
    status = dict(l.split(':', 1) for l in open('/proc/self/status') if l.startswith('VmLck'))
    assert int(status['VmLck'].split()[0]) > 0
if realtime.set_fifo(7).ok:
    assert os.sched_getscheduler(0) == os.SCHED_FIFO
    assert os.sched_getparam(0).sched_priority == 7
""")
    assert done.returncode == 0, done.stderr


def test_what_a_core_starts_is_no_rival_of_the_same_priority(run_code: Runner) -> None:
    # Where nothing but SCHED_FIFO decides, a thread that computes would keep its CPU for ever.
    done = run_code("""
import os, subprocess, sys, threading
from rt_robot_os.linux import realtime
if realtime.set_fifo(7, alone=True).ok:
    assert os.sched_getscheduler(0) == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    assert os.sched_getparam(0).sched_priority == 7
    seen = []
    def look():
        seen.append(os.sched_getscheduler(threading.get_native_id()))
    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert seen == [os.SCHED_OTHER], seen
    child = subprocess.run([sys.executable, '-c', 'import os; print(os.sched_getscheduler(0))'],
                           stdout=subprocess.PIPE, check=True)
    assert int(child.stdout) == os.SCHED_OTHER
""")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize('cpu', [4095, -7, 10 ** 12])
def test_a_cpu_that_is_not_there_names_those_that_are(
        ask: Callable[..., Results], cpu: int) -> None:
    (ok, step, reason, _), = ask(f'realtime.set_affinity({cpu})')
    assert not ok
    assert step == f'CPU {cpu}'
    assert f'CPUs {sorted(os.sched_getaffinity(0))}' in reason
    assert 'core.cpu' in reason


def test_a_priority_out_of_range_is_no_crash(ask: Callable[..., Results]) -> None:
    (ok, step, reason, _), = ask('realtime.set_fifo(1000)')
    assert (ok, step) == (False, 'SCHED_FIFO priority 1000')
    assert reason

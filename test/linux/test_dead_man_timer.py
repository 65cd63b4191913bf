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


"""A process that hangs where no Python runs dies by itself, and says where it was."""

from __future__ import annotations

from collections.abc import Callable
import signal
import subprocess
import time

from rt_robot_os.linux.dead_man_timer import DeadManTimer

Runner = Callable[..., subprocess.CompletedProcess[str]]

# One native call of several seconds that no signal handler of Python can interrupt.
HANG = """
import ctypes, faulthandler, signal, sys, time
from rt_robot_os.linux.dead_man_timer import DeadManTimer
{before}
handle = DeadManTimer()
handle.push(time.monotonic_ns() + 100_000_000)
def hang():
    sum(range(10 ** 12))
hang()
"""


def test_a_native_call_without_end_is_ended(run_code: Runner) -> None:
    done = run_code(HANG.format(before=''))
    assert done.returncode == -signal.SIGABRT


def test_it_says_where_it_was(run_code: Runner) -> None:
    done = run_code(HANG.format(before='faulthandler.enable()'))
    assert done.returncode == -signal.SIGABRT
    assert 'Fatal Python error: Aborted' in done.stderr
    assert 'in hang' in done.stderr


def test_code_that_ignores_the_first_signal_is_ended_by_the_second(run_code: Runner) -> None:
    before = 'signal.signal(signal.SIGABRT, signal.SIG_IGN)'
    assert run_code(HANG.format(before=before)).returncode == -signal.SIGKILL


def test_one_that_is_pushed_in_time_lives() -> None:
    handle = DeadManTimer()
    try:
        for _ in range(20):
            handle.push(time.monotonic_ns() + 10_000_000_000)
        handle.release()
        handle.push(time.monotonic_ns() + 10_000_000_000)
    finally:
        handle.close()
        handle.close()


LET_GO = """
import signal, time
from rt_robot_os.linux.dead_man_timer import DeadManTimer

for let_go in (DeadManTimer.release, DeadManTimer.close):
    # Held back, so that one which a busy machine did not let go in time can be tried again.
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGABRT])
    late = True
    while late:
        handle = DeadManTimer()
        handle.push(time.monotonic_ns() + 50_000_000)
        let_go(handle)
        late = signal.sigtimedwait([signal.SIGABRT], 0)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGABRT])
    time.sleep(0.2)
print('alive')
"""


def test_one_that_is_let_go_does_nothing(run_code: Runner) -> None:
    done = run_code(LET_GO)
    assert (done.returncode, done.stdout) == (0, 'alive\n')

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

"""Processes: how children start, end with their parent, and are ended; what Linux lets run."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import suppress
import os
from pathlib import Path
import signal
import subprocess
import sys
import weakref

from rt_robot_os.base.programs import own_process
from rt_robot_os.linux import _libc

# How long a child may take to be ready, which is a second at most unless the machine has far too
# much to do. One that ends is noticed at once; only one that hangs is waited for that long.
START_PATIENCE_S = 60.0


def start_child(
    module: str, *arguments: object, given: bytes | None = None, stdin: int = subprocess.DEVNULL,
    stdout: int | None = None, stderr: int | None = None, pass_fds: Sequence[int] = (),
    env: Mapping[str, str] | None = None, own_session: bool = True,
) -> subprocess.Popen[bytes]:
    """
    Start a module in a Python of its own, as ``python -m`` does.

    One that is to end with this process gets the number of that (:func:`os.getpid`) and has
    :func:`run_child` or :func:`die_with_parent`. Linux takes the *thread* that starts it for the
    parent.

    :param given: is written to its standard input, which is then closed; that it has ended before
        it has read that is seen by whoever waits for it.
    :param stdin: where nothing is given. This and the next two are as in `subprocess.Popen`.
    :param pass_fds: descriptors that it inherits, under their numbers.
    :param env: its whole environment; None for that of this process.
    :param own_session: a Ctrl-C in the terminal is for this process alone, which then ends the
        child in order; False leaves the child in the process group of this one.
    :raises OSError: it cannot be started.
    """
    process = subprocess.Popen(
        [sys.executable, '-m', module, *map(str, arguments)],
        stdin=stdin if given is None else subprocess.PIPE, stdout=stdout, stderr=stderr, env=env,
        pass_fds=pass_fds, start_new_session=own_session)
    if given is not None:
        hand_over(process, given)
    return process


def hand_over(process: subprocess.Popen[bytes], given: bytes) -> None:
    """Write all that a child reads from its standard input; does nothing when it has ended."""
    if process.stdin is not None:
        with suppress(BrokenPipeError), process.stdin as pipe:
            pipe.write(given)


def run_child(main: Callable[[Sequence[str]], int], signo: int = signal.SIGTERM) -> int:
    """
    Run the main function of a child that ends with its parent.

    :param main: takes the arguments behind the first, which is the process id of the parent.
    :param signo: is sent to this process when the parent dies.
    :return: the exit code; 0 when the parent has ended before.
    """
    parent, *arguments = sys.argv[1:]
    with own_process():
        return main(arguments) if die_with_parent(int(parent), signo) else 0


def end_child(process: subprocess.Popen[bytes], patience_s: float, signo: int = signal.SIGTERM
              ) -> None:
    """
    End a child in order, by force when it does not listen; one that has ended is left alone.

    :param patience_s: how long to wait for it, after either signal.
    :param signo: is sent first.
    """
    for each in (signo, signal.SIGKILL):
        process.send_signal(each)
        with suppress(subprocess.TimeoutExpired):
            process.wait(patience_s)
            return


def leave_alone(cpus: Iterable[int]) -> None:
    """Take ordinary priority, and run on other CPUs than those of a pinned core, if there are."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    everywhere = set(range(os.cpu_count() or 1))
    others = everywhere - set(cpus)
    if others != everywhere and others:
        with suppress(OSError):  # a container that may use that one CPU only
            os.sched_setaffinity(0, others)


def die_with_parent(parent_pid: int | None = None, signo: int = signal.SIGTERM) -> bool:
    """
    Ask for a signal when the parent dies (PR_SET_PDEATHSIG, prctl(2)).

    :param parent_pid: the parent that started this process; a parent that died before this call
        is noticed by comparing it with the present one.
    :return: False when the parent is gone already: the caller should end.
    """
    _libc.prctl(_libc.PR_SET_PDEATHSIG, int(signo), 0, 0, 0)
    return parent_pid is None or os.getppid() == parent_pid


def parent_of(pid: int) -> int:
    """Return the parent of a process; 0 when it has ended or is not ours to see."""
    try:
        return int(Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[1])
    except (OSError, ValueError, IndexError):
        return 0


# For a process these are the numbers of its first thread (proc_pid_schedstat(5)).
_PATH = Path('/proc/self/schedstat')


class WaitingTime:
    """
    The waiting time of the main thread.

    Always 0 on a Linux without these numbers (CONFIG_SCHED_INFO).
    """

    def __init__(self) -> None:
        try:
            self._fd = os.open(_PATH, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self._fd = -1
        else:
            weakref.finalize(self, os.close, self._fd)

    def read(self) -> int:
        """Return the nanoseconds so far; about 1 us, safe in the real-time loop."""
        if self._fd < 0:
            return 0
        try:
            return int(os.pread(self._fd, 64, 0).split()[1])
        except (OSError, ValueError, IndexError):
            return 0


def computing(pid: int) -> tuple[bool, int]:
    """
    Look at the first thread of a process.

    :return: whether it runs or is ready to, and the nanoseconds that it has computed so far; not
        ready when there is no such process.
    """
    try:
        # The name, which stands before the state, may hold anything.
        state = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0]
        return state == 'R', int(Path(f'/proc/{pid}/schedstat').read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return False, 0

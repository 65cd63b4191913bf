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

"""Child processes: start, end with the parent, and termination; scheduling information."""

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

# Timeout for a child to become ready, which takes at most a second unless the machine is
# overloaded. A child that ends is noticed immediately; the timeout is for one that hangs.
START_PATIENCE_S = 60.0


def start_child(
    module: str, *arguments: object, given: bytes | None = None, stdin: int = subprocess.DEVNULL,
    stdout: int | None = None, stderr: int | None = None, pass_fds: Sequence[int] = (),
    env: Mapping[str, str] | None = None, own_session: bool = True,
) -> subprocess.Popen[bytes]:
    """
    Start a module in a separate Python process, as ``python -m`` does.

    A child that is to end with this process gets its process id (:func:`os.getpid`) and uses
    :func:`run_child` or :func:`die_with_parent`. Linux treats the *thread* that starts it as the
    parent.

    :param given: written to its standard input, which is then closed. A child that ended before
        it read that is noticed by waiting for it.
    :param stdin: used without ``given``. This and the next two are as in `subprocess.Popen`.
    :param pass_fds: descriptors that it inherits, with the same numbers.
    :param env: its whole environment; None for that of this process.
    :param own_session: a Ctrl-C in the terminal reaches only this process, which then ends the
        child in order; False leaves the child in the process group of this one.
    :raises OSError: it cannot be started.
    """
    process = subprocess.Popen(
        [sys.executable, '-m', module, *map(str, arguments)],
        stdin=stdin if given is None else subprocess.PIPE, stdout=stdout, stderr=stderr, env=env,
        pass_fds=pass_fds, start_new_session=own_session)
    if given is not None:
        write_stdin(process, given)
    return process


def write_stdin(process: subprocess.Popen[bytes], given: bytes) -> None:
    """Write the whole standard input of a child; does nothing when it has ended."""
    if process.stdin is not None:
        with suppress(BrokenPipeError), process.stdin as pipe:
            pipe.write(given)


def run_child(main: Callable[[Sequence[str]], int], signo: int = signal.SIGTERM) -> int:
    """
    Run the main function of a child that ends with its parent.

    :param main: called with the arguments after the first, which is the parent's process id.
    :param signo: sent to this process when the parent dies.
    :return: the exit code; 0 when the parent has ended before.
    """
    parent, *arguments = sys.argv[1:]
    with own_process():
        return main(arguments) if die_with_parent(int(parent), signo) else 0


def end_child(process: subprocess.Popen[bytes], patience_s: float, signo: int = signal.SIGTERM
              ) -> None:
    """
    Terminate a child; kill it when it does not end in time. One that has ended is ignored.

    :param patience_s: timeout after either signal.
    :param signo: the first signal.
    """
    for each in (signo, signal.SIGKILL):
        process.send_signal(each)
        with suppress(subprocess.TimeoutExpired):
            process.wait(patience_s)
            return


def use_ordinary_scheduling(cpus: Iterable[int]) -> None:
    """Use ordinary scheduling, on other CPUs than those of a pinned core, if there are any."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    everywhere = set(range(os.cpu_count() or 1))
    others = everywhere - set(cpus)
    if others != everywhere and others:
        with suppress(OSError):  # a container that may use only that CPU
            os.sched_setaffinity(0, others)


def die_with_parent(parent_pid: int | None = None, signo: int = signal.SIGTERM) -> bool:
    """
    Request a signal when the parent dies (PR_SET_PDEATHSIG, prctl(2)).

    :param parent_pid: the parent that started this process; a parent that died before this call
        is noticed by comparing it with the present one.
    :return: False when the parent has ended already: the caller should end.
    """
    _libc.prctl(_libc.PR_SET_PDEATHSIG, int(signo), 0, 0, 0)
    return parent_pid is None or os.getppid() == parent_pid


def parent_of(pid: int) -> int:
    """Return the parent of a process; 0 when it has ended or is not visible to this user."""
    try:
        return int(Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[1])
    except (OSError, ValueError, IndexError):
        return 0


# For a process these are the numbers of its first thread (proc_pid_schedstat(5)).
_PATH = Path('/proc/self/schedstat')


class WaitingTime:
    """
    The time that the main thread has waited for a CPU.

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


def scheduling_state(pid: int) -> tuple[bool, int]:
    """
    Read the scheduling state of the first thread of a process.

    :return: whether it runs or is ready, and its CPU time in nanoseconds; (False, 0) when the
        process does not exist.
    """
    try:
        # The name, which precedes the state, may contain any characters.
        state = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0]
        return state == 'R', int(Path(f'/proc/{pid}/schedstat').read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return False, 0

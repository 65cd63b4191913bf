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

"""Start the child of one measurement, wait for it, and leave no process behind."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import suppress
import fcntl
import json
import os
from pathlib import Path
import random
import re
import select
import signal
import subprocess
import tempfile
import time

from rt_robot_os.linux.process import start_child
from rt_robot_os.tools.bench import builds
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.child import JOB_FILE
from rt_robot_os.tools.bench.child import read_result
from rt_robot_os.tools.bench.child import RESULT_FILE
from rt_robot_os.tools.bench.result import RunStatus

#: Where this package lies; in the source tree, the folder ``benchmarks`` is there as well.
ROOT = Path(__file__).resolve().parents[3]
_LOG_FILE = 'output.log'
_PATIENCE_S = 30.0     # beyond what a run is expected to take
_END_S = 5.0           # to end after the result is there, and after SIGTERM
_LOOK_S = 1.0
_GROUP_S = 1.0         # for its own processes to be gone
_DOMAINS = range(1, 102)
_FIRST_PORT, _PORTS_A_DOMAIN = 7400, 250   # of DDSI-RTPS
# One BLAS thread: the others would only disturb.
_ENVIRONMENT = {'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1',
                'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def free_domain(shared_memory: Path = Path('/dev/shm')) -> int:
    """
    Choose a ROS domain at random among those that no Fast DDS process uses, or left files of.

    Leftovers of a killed process can delay discovery by seconds.
    """
    used = {(int(match[1]) - _FIRST_PORT) // _PORTS_A_DOMAIN
            for path in shared_memory.glob('fastrtps_port*')
            if (match := re.match(r'fastrtps_port(\d+)', path.name))}
    free = [domain for domain in _DOMAINS if domain not in used]
    return random.SystemRandom().choice(free or list(_DOMAINS))


def environment(folder: Path, build: str = '') -> dict[str, str]:
    """Make the environment of a child: a ROS domain, logs and sockets of its own, its build."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get('PYTHONPATH'))))
    return {**builds.environment(os.environ, build), **_ENVIRONMENT, 'PYTHONPATH': path,
            'ROS_DOMAIN_ID': str(free_domain()),
            'ROS_LOG_DIR': str(folder), 'RT_ROBOT_OS_RUNTIME_DIR': str(folder / 'run')}


def lock_path() -> Path:
    """Return the file whose lock the one holds that measures; for all users of the machine."""
    return Path(tempfile.gettempdir()) / 'rt_robot_os_bench.lock'


@contextmanager
def alone(path: Path, wait: bool = True) -> Iterator[bool]:
    """
    Wait until no other bench measures: at the same priority on one CPU they would starve.

    There is no waiting where the file cannot be opened, such as one of another user.

    :param wait: False: only check.
    :return: whether another bench measures; always False after waiting.
    """
    try:
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    except OSError:
        yield False
        return
    try:
        yield not _lock(fd, wait)
    finally:
        os.close(fd)


def _lock(fd: int, wait: bool) -> bool:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    return True


def measure(run: Run) -> RunOutcome:
    """
    Run a subject in a fresh interpreter, when no other bench measures on this machine.

    Its group of processes is ended, whatever happens, before this returns or raises.

    :return: also for a child that failed, crashed or hung: the reason says it.
    """
    # Short: the path of a Unix socket has 108 bytes.
    with alone(lock_path()), tempfile.TemporaryDirectory(
            prefix='rtb', ignore_cleanup_errors=True) as name:
        folder = Path(name)
        (folder / JOB_FILE).write_text(json.dumps({
            'subject': run.subject, 'arguments': dict(run.arguments), 'cpu': run.cpu,
            'priority': run.priority, 'build': run.build}))
        with open(folder / _LOG_FILE, 'wb') as log:
            process = start_child(
                'rt_robot_os.tools.bench.child', os.getpid(), name, stdout=log.fileno(),
                stderr=log.fileno(), env=environment(folder, run.build))
            try:
                ended = _wait(process, folder / RESULT_FILE, run.seconds + _PATIENCE_S)
            finally:
                end_group(process)
        if (folder / RESULT_FILE).exists():
            return read_result(folder)
        return RunOutcome(RunStatus.FAILED, _why(process.returncode if ended else None,
                                                 run.seconds + _PATIENCE_S, folder / _LOG_FILE))


def _wait(process: subprocess.Popen[bytes], result: Path, timeout_s: float) -> bool:
    """Wait, without disturbing the measurement; whether the child ended by itself."""
    deadline = time.monotonic() + timeout_s
    fd = os.pidfd_open(process.pid)
    try:
        while time.monotonic() < deadline:
            if select.select([fd], [], [], _LOOK_S)[0]:
                process.wait()
                return True
            if result.exists():
                # Some executors do not come to an end.
                deadline = min(deadline, time.monotonic() + _END_S)
        return False
    finally:
        os.close(fd)


def end_group(process: subprocess.Popen[bytes]) -> None:
    """End a child that leads a session, with everything that it started in it."""
    for signo, wait_s in ((signal.SIGTERM, _END_S), (signal.SIGKILL, None)):
        if process.poll() is not None:
            break
        try:
            os.killpg(process.pid, signo)
            process.wait(wait_s)
        except (ProcessLookupError, subprocess.TimeoutExpired):
            continue
    # What the child had started ends with it, but not at the same moment.
    deadline = time.monotonic() + _GROUP_S
    with suppress(ProcessLookupError):
        while time.monotonic() < deadline:
            os.killpg(process.pid, signal.SIGKILL)
            time.sleep(0.005)


def _why(code: int | None, timeout_s: float, log: Path) -> str:
    lines = log.read_text(errors='replace').strip().splitlines()
    said = f': {lines[-1].strip()}' if lines else ''
    if code is None:
        return f'did not end within {timeout_s:.0f} s{said}'
    return f'ended with code {code}{said}'

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

"""
A process beside a measurement: one that computes, or the other side of a connection.

Run as ``python -m rt_robot_os.tools.bench.helper PARENT JOB`` with the job as JSON.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from importlib import import_module
import json
import os
import select
import signal
import subprocess
import sys
from types import TracebackType
from typing import Any

from rt_robot_os.linux.process import run_child
from rt_robot_os.linux.process import start_child

_START_TIMEOUT_S = 20.0


def load_function(name: str) -> Any:
    """
    Find a function.

    :param name: ``package.module:function``.
    """
    module, _, function = name.partition(':')
    return getattr(import_module(module), function)


class Helper:
    """
    The process, for the one that started it; ended with the ``with`` block.

    :param cpus: that it may use.
    :raises RuntimeError: it did not get ready.
    """

    def __init__(self, subject: str, arguments: Mapping[str, Any], cpus: Sequence[int]) -> None:
        job = {'subject': subject, 'arguments': dict(arguments), 'cpus': list(cpus)}
        self.process = start_child(
            'rt_robot_os.tools.bench.helper', os.getpid(), json.dumps(job), stdout=subprocess.PIPE,
            own_session=False)  # it is ended with the group of the measurement
        try:
            self._wait_until_ready(subject)
        except BaseException:
            self.close()
            raise

    def _wait_until_ready(self, subject: str) -> None:
        pipe = self.process.stdout
        if pipe is None or not select.select([pipe], [], [], _START_TIMEOUT_S)[0] or (
                pipe.readline().strip() != b'ready'):
            raise RuntimeError(f'helper {subject} did not get ready '
                               f'(exit code {self.process.poll()})')

    def close(self) -> None:
        """End it; may be called twice."""
        self.process.kill()
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def __enter__(self) -> Helper:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        self.close()


def main(argv: Sequence[str]) -> int:
    """Be a helper."""
    job = json.loads(argv[0])
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.sched_setaffinity(0, job['cpus'])
    load_function(job['subject'])(job['arguments'], lambda: print('ready', flush=True))
    return 0


if __name__ == '__main__':
    sys.exit(run_child(main, signal.SIGKILL))

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


"""How long Linux let the main thread wait for a CPU that it was ready to use."""

from __future__ import annotations

import os
from pathlib import Path
import weakref

# Of a process its first thread's (proc_pid_schedstat(5)).
_PATH = Path('/proc/self/schedstat')


class WaitingTime:
    """
    The waiting time of the main thread.

    A Linux without these numbers (CONFIG_SCHED_INFO) tells of no waiting.
    """

    def __init__(self) -> None:
        try:
            self._fd = os.open(_PATH, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self._fd = -1
        else:
            weakref.finalize(self, os.close, self._fd)

    def read(self) -> int:
        """Give the nanoseconds so far; about 1 us, safe in the real-time loop."""
        if self._fd < 0:
            return 0
        try:
            return int(os.pread(self._fd, 64, 0).split()[1])
        except (OSError, ValueError, IndexError):
            return 0

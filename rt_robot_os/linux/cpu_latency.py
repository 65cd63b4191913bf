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
How deeply an idle CPU may sleep: the request that ``/dev/cpu_dma_latency`` takes.

It holds as long as the file is open (Documentation/power/pm_qos_interface.rst of Linux).
"""

from __future__ import annotations

import os
from pathlib import Path
import struct

from rt_robot_os.linux.realtime import RtResult

DEVICE = Path('/dev/cpu_dma_latency')


class HeldCpuLatency:
    """A request that holds until it is closed, or the process ends."""

    def __init__(self, fd: int) -> None:
        self._fd = fd

    def close(self) -> None:
        """Take the request back; may be called twice."""
        if self._fd >= 0:
            fd, self._fd = self._fd, -1
            os.close(fd)


def hold_cpu_latency(
    microseconds: int, path: Path = DEVICE,
) -> tuple[RtResult, HeldCpuLatency | None]:
    """
    Ask that a sleeping CPU wakes within a time: what takes longer than that is not entered.

    0 keeps the CPUs out of every sleep state, and costs the power that they would save.

    :param microseconds: from 0.
    :return: what became of it, and the request to keep; None when it was refused.
    """
    step = f'CPU latency {microseconds} us'
    try:
        fd = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return RtResult(False, step, f'there is no {path}: this Linux was built without power '
                        'management, or a container hides it'), None
    except PermissionError:
        return RtResult(False, step, 'not permitted; waking may take longer. Remedy: write '
                        'KERNEL=="cpu_dma_latency", GROUP="realtime", MODE="0660" into '
                        '/etc/udev/rules.d/99-realtime.rules and start the machine again'), None
    except OSError as error:
        return RtResult(False, step, f'{path}: {error.strerror}'), None
    try:
        os.write(fd, struct.pack('=i', microseconds))
    except OSError as error:
        os.close(fd)
        return RtResult(False, step, f'{path}: {error.strerror}'), None
    return RtResult(True, step), HeldCpuLatency(fd)

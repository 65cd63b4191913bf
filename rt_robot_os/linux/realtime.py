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
Real-time set-up of a process: a step that is refused is reported, and the process continues.

Returning a result with a reason instead of raising follows ros2_control's realtime_tools: a robot
on a laptop without privileges must run and report what is missing. One step limits the sleep
states of an idle CPU, as long as ``/dev/cpu_dma_latency`` is open (Documentation/power/
pm_qos_interface.rst of Linux).
"""

from __future__ import annotations

from dataclasses import dataclass
import gc
import os
from pathlib import Path
import struct

from rt_robot_os.linux import _libc


@dataclass(frozen=True)
class RtResult:
    """
    The result of one step of the set-up.

    :ivar ok: the step is active.
    :ivar step: the requested setting.
    :ivar reason: why it failed, and the remedy; empty on success.
    """

    ok: bool
    step: str
    reason: str = ''

    def __str__(self) -> str:
        return f'{self.step}: {"active" if self.ok else self.reason}'


def set_fifo(priority: int, *, alone: bool = False) -> RtResult:
    """
    Run under SCHED_FIFO (sched(7)).

    :param priority: 1..99, higher runs first.
    :param alone: threads and processes that this one starts get ordinary scheduling. On the same
        CPU, a computing thread of the same priority would never let this one run again.
    """
    step = f'SCHED_FIFO priority {priority}'
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | (os.SCHED_RESET_ON_FORK if alone else 0),
                              os.sched_param(priority))
    except PermissionError:
        return RtResult(False, step, 'not permitted; other programs can delay the core. '
                        "Remedy: add the line '@realtime - rtprio 98' to "
                        '/etc/security/limits.conf, join that group and log in again')
    except OSError as error:
        return RtResult(False, step, f'refused: {error.strerror}')
    return RtResult(True, step)


def set_affinity(cpu: int) -> RtResult:
    """
    Pin the process to one CPU.

    :param cpu: a CPU number; -1 selects the last allowed one.
    """
    allowed = sorted(os.sched_getaffinity(0))
    wanted = allowed[-1] if cpu == -1 else cpu
    step = f'CPU {wanted}'
    try:
        os.sched_setaffinity(0, {wanted})
    except (OSError, ValueError, OverflowError):
        return RtResult(False, step, f'this process may use CPUs {allowed} only; '
                        'remedy: choose core.cpu among them, or -1')
    return RtResult(True, step)


def lock_memory() -> RtResult:
    """
    Lock all current and future pages of the process in memory (mlockall(2)).

    MCL_ONFAULT: without it unused parts of every shared library are loaded as well, which
    multiplies the resident size without benefit.
    """
    step = 'locked memory'
    try:
        _libc.mlockall(_libc.MCL_CURRENT | _libc.MCL_FUTURE | _libc.MCL_ONFAULT)
    except OSError as error:
        return RtResult(False, step, f'{error.strerror}; pages may be swapped out. Remedy: add '
                        "the line '@realtime - memlock unlimited' to /etc/security/limits.conf, "
                        'join that group and log in again')
    return RtResult(True, step)


def set_timer_slack() -> RtResult:
    """Set the minimum timer slack, 1 ns; it matters only where SCHED_FIFO was refused."""
    step = 'timer slack 1 ns'
    try:
        _libc.prctl(_libc.PR_SET_TIMERSLACK, 1, 0, 0, 0)
    except OSError as error:
        return RtResult(False, step, f'{error.strerror}')
    return RtResult(True, step)


def freeze_garbage() -> RtResult:
    """
    Move all objects of the set-up out of the cyclic garbage collector and disable it.

    A collection is a native call that no release can preempt. From now on the caller has to
    collect when there is time.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    return RtResult(True, 'garbage collector frozen')


DEVICE = Path('/dev/cpu_dma_latency')


class CpuLatencyRequest:
    """A request that is active until it is closed or the process ends."""

    def __init__(self, fd: int) -> None:
        self._fd = fd

    def close(self) -> None:
        """Withdraw the request; may be called twice."""
        if self._fd >= 0:
            fd, self._fd = self._fd, -1
            os.close(fd)


def request_cpu_latency(
    microseconds: int, path: Path = DEVICE,
) -> tuple[RtResult, CpuLatencyRequest | None]:
    """
    Limit the wake-up latency of the CPUs: deeper sleep states are not entered.

    0 disables all sleep states, at the cost of the power that they would save.

    :param microseconds: from 0.
    :return: the result, and the request to store; None when it was refused.
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
    return RtResult(True, step), CpuLatencyRequest(fd)

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

"""The measurement at the end: start the measuring process, wait for it, judge the result."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
import json
import os
import subprocess
import time
from typing import Any

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.linux.process import start_child
from rt_robot_os.tools.doctor.facts import asked_cpu
from rt_robot_os.tools.doctor.finding import bad
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.lateness import Measured
from rt_robot_os.tools.doctor.lateness import measured
from rt_robot_os.tools.doctor.system import ProbeError
from rt_robot_os.tools.doctor.system import System

CHILD = 'rt_robot_os.tools.doctor.wakeup_child'
# A tenth of the period at 1 kHz. Well set up machines stay below it (PREEMPT_RT: 20 to 80 us), and
# a control loop loses no phase margin worth mentioning: 100 us are 3.6 degrees at 100 Hz.
READY_MAXIMUM_NS = 100 * NS_PER_US
# One release in a thousand may be a whole period late: the loop misses it, and goes on.
USABLE_P999_NS = NS_PER_MS
_TENTH = 10
_ONCE_MORE = Remedy((), 'fix what the summary names first, end what need not run, measure again')
_START_S = 0.7
_MARGIN_S = 15.0
_REFRESH_S = 0.1

MACHINE = Check('measured.machine', 'machine alone',
                'no program on this machine can be earlier than this', lambda _: ())
KERNEL = Check('measured.kernel', 'with our kernel',
               'this late begins a 1 kHz job in Python that nothing else delays', lambda _: ())


@dataclass(frozen=True)
class Wakeup:
    """
    The result.

    :ivar machine: on ``clock_nanosleep``.
    :ivar kernel: in this package's kernel.
    :ivar refused: steps of the set-up that Linux did not grant.
    """

    machine: Measured
    kernel: Measured
    seconds: float
    refused: tuple[str, ...]


def _job(system: System, seconds: float) -> str:
    cpu = asked_cpu(system)
    return json.dumps({
        'cpu': -2 if cpu is None else cpu, 'priority': system.wanted.priority,
        'lock_memory': system.wanted.lock_memory, 'seconds': seconds,
        'cpu_latency_us': system.wanted.cpu_latency_us, 'spin_us': system.wanted.spin_us})


def measure(system: System, seconds: float,
            progress: Callable[[float], None] | None = None) -> Wakeup:
    """
    Measure in a child process, which ends with this one whatever happens.

    :param progress: called about ten times a second with a part from 0 to 1. It goes by the
        clock alone: a child that reports would measure its reports.
    :raises ProbeError: the child did not answer.
    """
    begin = time.monotonic()
    child = start_child(CHILD, os.getpid(), _job(system, seconds), stdout=subprocess.PIPE,
                        stderr=subprocess.PIPE, env=system.environ)
    try:
        while True:
            try:
                output, errors = child.communicate(
                    timeout=_REFRESH_S if progress else seconds + _MARGIN_S)
                break
            except subprocess.TimeoutExpired:
                elapsed = time.monotonic() - begin
                if elapsed > seconds + _MARGIN_S:
                    raise ProbeError(f'the measurement did not end in {elapsed:.0f} s') from None
                if progress:
                    progress(min(1.0, elapsed / (seconds + _START_S)))
    finally:
        if child.poll() is None:
            child.kill()
            child.communicate()
    return _read(child.returncode, output, errors, seconds)


def _read(code: int, output: bytes, errors: bytes, seconds: float) -> Wakeup:
    try:
        answer: Mapping[str, Any] = json.loads(output.decode().splitlines()[-1])
    except (ValueError, IndexError):
        text = errors.decode(errors='replace').strip().splitlines()
        raise ProbeError(f'the measurement ended with code {code}'
                         + (f': {text[-1]}' if text else '')) from None
    return Wakeup(measured(answer['machine']), measured(answer['kernel']), seconds,
                  tuple(answer['refused']))


def rate_hz(maximum_ns: int) -> int:
    """Return the rate whose period is ten times as long as the worst lateness, at most 1 kHz."""
    exact = NS_PER_S / (_TENTH * max(1, maximum_ns))
    steps = [rate for decade in (1, 10, 100) for rate in (decade, 2 * decade, 5 * decade)]
    return max([rate for rate in (*steps, 1000) if rate <= exact], default=0)


def microseconds(duration_ns: int) -> str:
    """Write a duration with about three digits."""
    value = duration_ns / NS_PER_US
    return f'{value:.1f}' if value < 10 else f'{value:.0f}'


def judge(result: Measured, refused: Sequence[str] = ()) -> Finding:
    """
    Compare a measurement with what a 1 kHz loop needs.

    :param refused: steps of the set-up that Linux did not grant.
    """
    summary = result.summary
    text = (f'p50 {microseconds(summary.p50_ns)}, p99 {microseconds(summary.p99_ns)}, '
            f'p99.9 {microseconds(summary.p999_ns)}, max {microseconds(summary.maximum_ns)} us')
    if result.missed:
        text += f', {result.missed} of {summary.count + result.missed} missed'
    if not summary.count:
        return bad('no wake-up at all', _ONCE_MORE, weight=99)
    if summary.maximum_ns < READY_MAXIMUM_NS:
        return ok(f'{text}: ready for 1 kHz')
    rate = rate_hz(summary.maximum_ns)
    fit = f'at its worst ready for {rate} Hz' if rate else 'too late for any loop at times'
    remedy = (Remedy((), f'first of all, fix what was refused: {", ".join(refused)}')
              if refused else _ONCE_MORE)
    if summary.p999_ns < USABLE_P999_NS:
        return warn(f'{text}: usable, {fit}', remedy, weight=1)
    return bad(f'{text}: not usable for 1 kHz, {fit}', remedy, weight=1)


class StepWatch:
    """
    Notices a time of day that jumps while the doctor works.

    :ivar check: what its line is called.
    """

    # Slewing by chrony or NTP stays below 500 ppm: 10 ms in twenty seconds.
    LIMIT_NS = 20 * NS_PER_MS
    check = Check('measured.steps', 'steps of the clock',
                  'stamps go backwards or jump; releases do not: they follow CLOCK_MONOTONIC',
                  lambda _: ())

    def __init__(self, now: Callable[[], tuple[int, int]] | None = None) -> None:
        self._now = now or self._read
        self._begin = self._now()

    @staticmethod
    def _read() -> tuple[int, int]:
        """Read CLOCK_REALTIME and CLOCK_MONOTONIC as near to each other as can be had."""
        tries = []
        for _ in range(5):
            before = time.monotonic_ns()
            wall = time.time_ns()
            after = time.monotonic_ns()
            tries.append((after - before, wall, (before + after) // 2))
        _, wall, monotonic = min(tries)
        return wall, monotonic

    def finding(self) -> Finding:
        """Compare with the beginning."""
        wall, monotonic = self._now()
        elapsed = monotonic - self._begin[1]
        step = wall - self._begin[0] - elapsed
        watched = f'in {elapsed / NS_PER_S:.1f} s'
        if abs(step) < self.LIMIT_NS:
            return ok(f'none {watched}')
        return warn(f'{step / NS_PER_MS:+.0f} ms {watched}', Remedy(
            ('journalctl --since -5min -u chrony -u systemd-timesyncd',),
            'slew it instead: chrony without `makestep` after the start; in a virtual machine, '
            'turn off the time synchronisation of the guest tools'), weight=25)

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

"""The control loop of the second paper as a task of the kernel, and as a thread; laws compared."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
import math
import time
from typing import Any
from typing import Final

from benchmarks.trajectory.drives import eight
from benchmarks.trajectory.drives import eight_drive
from benchmarks.trajectory.drives import paper_drive
from benchmarks.trajectory.loop import ControlLoop
from benchmarks.trajectory.loop import Drive
from benchmarks.trajectory.robot import Robot
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.motion.spline import spline
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.threads import Threads

# Each workload task asks for 4 % of a CPU, twenty of them for 80 %, all at the same moment: less
# than the 950 ms after which Linux takes the CPU from a real-time process for others.
WORK_NS: Final = 45 * NS_PER_MS
WORK_PERIOD_NS: Final = 1125 * NS_PER_MS

_LOADS: Final = 'benchmarks.shared.sine:loads'
_LOOP_PRIORITY, _WORK_PRIORITY = 50, 1
# Of the virtual clock, on which laws are compared.
_BEGIN_NS: Final = 10 * NS_PER_S
_LONGEST_NS: Final = 120 * NS_PER_S


def work() -> None:
    """Be a workload task once: plain Python of so much CPU time, however long that takes."""
    cpu_ns = time.thread_time_ns
    end_ns = cpu_ns() + WORK_NS
    value = 1
    while cpu_ns() < end_ns:
        for i in range(200):
            value = (value * 31 + i) & 0xFFFF


def drive_of(a: Mapping[str, Any]) -> Drive:
    """Return what a run drives."""
    return eight_drive(a['speed_m_s'], a['law']) if a['eight'] else paper_drive()


def made(a: Mapping[str, Any]) -> ControlLoop:
    """Make the robot and the loop of a run."""
    drive = drive_of(a)
    return ControlLoop(drive, Robot(drive.start, a['seed'], a['slip']))


def measured(loop: ControlLoop) -> Measurement:
    """Return what a loop has noted."""
    figures = dict(loop.figures(time.monotonic_ns()))
    samples = loop.cycles.taken()
    samples['control_ns'] = samples['control_ns'].astype(np.int64)
    return Measurement(samples, figures)


@contextmanager
def loaded(harness: Harness) -> Iterator[None]:
    """Let other programs compute on the CPU of the loop: ``outside`` of them, always."""
    count = harness.arguments['outside']
    if not count:
        yield
        return
    with harness.helper(_LOADS, {'count': count}, same_cpu=True):
        yield


def kernel(harness: Harness) -> Measurement:
    """Run the loop as a task over ``inside`` workload tasks of the lowest priority."""
    a = harness.arguments
    loop, tested = made(a), Kernel()

    def control() -> None:
        loop.cycle()
        if loop.over:
            tested.stop('arrived')

    tested.add_task('control', control, priority=_LOOP_PRIORITY,
                    rate_hz=NS_PER_S / drive_of(a).period_ns)
    for i in range(a['inside']):
        tested.add_task(f'work{i}', work, priority=_WORK_PRIORITY,
                        rate_hz=NS_PER_S / WORK_PERIOD_NS)
    with loaded(harness):
        harness.prepare(freeze=True)
        loop.prepare(time.monotonic_ns())
        tested.run(a['limit_ns'])
        return measured(loop)


def threads(harness: Harness) -> Measurement:
    """Run the loop as a thread beside ``inside`` workload threads; with real time if it has it."""
    a = harness.arguments
    loop = made(a)
    with loaded(harness):
        harness.prepare()
        loop.prepare(time.monotonic_ns())
        jobs: list[tuple[int, int, Callable[[], object]]] = [
            (drive_of(a).period_ns, harness.priority, loop.cycle)]
        jobs += [(WORK_PERIOD_NS, harness.priority // 4, work)] * a['inside']
        Threads(jobs, a['limit_ns'], lambda: loop.over).run()
        return measured(loop)


def laws(harness: Harness) -> Measurement:
    """Drive an eight with each law on a clock of its own: only the seed decides."""
    figures: dict[str, float] = {}
    for law, speed_m_s in harness.arguments['laws']:
        drive = eight_drive(speed_m_s, law)
        now_ns = [_BEGIN_NS]
        robot = Robot(drive.start, harness.arguments['seed'])
        loop = ControlLoop(drive, robot, clock_ns=lambda: now_ns[0])
        loop.prepare(now_ns[0])
        while not loop.over and now_ns[0] < _BEGIN_NS + _LONGEST_NS:
            loop.cycle()
            now_ns[0] += drive.period_ns
        noted = loop.cycles.taken()
        away_m = away(noted['x_m'], noted['y_m'])
        key = law_key(law, speed_m_s)
        figures[f'{key} rms_m'] = float(np.sqrt(np.mean(away_m ** 2)))
        figures[f'{key} maximum_m'] = float(away_m.max())
        figures[f'{key} control_us'] = float(np.median(noted['control_ns'])) / 1000
        figures[f'{key} time_s'] = loop.figures(now_ns[0])['time_ms'] / 1000
    return Measurement({}, figures)


def law_key(law: str, speed_m_s: float) -> str:
    """Return how the figures of a law begin."""
    return f'{law} {speed_m_s:g}'


def away(x_m: Any, y_m: Any) -> Any:
    """Return how far from the eight some places are, in the order in which they were driven."""
    path = spline([(x, y) for x, y, _ in eight()])
    near, found = 0.0, []
    for x, y in zip(x_m.tolist(), y_m.tolist()):
        near = path.nearest(x, y, near)
        px, py = path.at(near)[:2]
        found.append(math.hypot(px - x, py - y))
    return np.array(found)

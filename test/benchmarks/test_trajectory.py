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

"""Does the loop of the second paper's experiment keep its time and its way, whatever else runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math
import random
from typing import Any

from benchmarks.trajectory.case import CASE
from benchmarks.trajectory.drives import paper_drive
from benchmarks.trajectory.loop import ControlLoop
from benchmarks.trajectory.robot import Robot
from benchmarks.trajectory.subjects import laws
import numpy as np
import pytest

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.processes import measure
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict

BEGIN_NS = 10 * NS_PER_S
PERIOD_NS = 300 * NS_PER_MS
SEEDS = [random.Random(0).randrange(1000) for _ in range(4)]


def made(clock_ns: Callable[[], int], seed: int, slip: float = 0.0) -> ControlLoop:
    drive = paper_drive()
    return ControlLoop(drive, Robot(drive.start, seed, slip), clock_ns=clock_ns)


def under_load(tasks: int, seed: int, slip: float = 0.0) -> Measurement:
    """Drive the paper's run in the kernel, on the virtual clock, over tasks that compute."""
    clock = VirtualClock(BEGIN_NS)
    kernel = Kernel(clock)
    loop = made(clock.now_ns, seed, slip)

    def control() -> None:
        clock.spend(2 * NS_PER_MS)  # as long as localising and control may take
        loop.cycle()
        if loop.over:
            kernel.stop('arrived')

    kernel.add_task('control', control, priority=50, rate_hz=NS_PER_S / PERIOD_NS)
    for number in range(tasks):
        kernel.add_task(f'work{number}', lambda: clock.spend(75 * NS_PER_MS), priority=1,
                        rate_hz=NS_PER_S / (375 * NS_PER_MS))
    loop.prepare(BEGIN_NS)
    assert kernel.run(20 * NS_PER_S) == 'arrived'
    return Measurement(loop.cycles.taken(), loop.figures(clock.now_ns()))


def cycles_ms(found: Measurement) -> np.ndarray[Any, Any]:
    return np.diff(found.samples['time_s']) * 1000


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('tasks', [0, 7, 20])
def test_under_any_load_the_task_keeps_its_time_and_the_robot_its_way(
        tasks: int, seed: int) -> None:
    found = under_load(tasks, seed)
    figures = found.figures
    assert figures['arrived']
    assert cycles_ms(found) == pytest.approx(300.0, abs=1e-6)
    assert figures['travelled_m'] == pytest.approx(1.30, abs=0.01)
    assert math.hypot(figures['end_x_m'] - 3.44, figures['end_y_m'] - 2.30) < 0.01
    assert math.degrees(figures['heading_rad']) == pytest.approx(90.0, abs=1.0)
    assert figures['time_ms'] in (6300.0, 6600.0)
    x, y = found.samples['x_m'], found.samples['y_m']
    assert math.sqrt(np.mean((x[y > 1.30] - 3.44) ** 2)) < 0.015


def test_the_load_changes_nothing_at_all() -> None:
    alone, loaded = under_load(0, 3), under_load(20, 3)
    for name in ('time_s', 'x_m', 'y_m', 'heading_rad'):
        assert loaded.samples[name].tolist() == alone.samples[name].tolist()


@pytest.mark.parametrize('seed', SEEDS)
def test_wheels_that_slip_cost_time_and_little_way(seed: int) -> None:
    found = under_load(7, seed, slip=0.05)
    assert found.figures['travelled_m'] == pytest.approx(1.30, abs=0.02)


def test_a_loop_that_is_starved_drives_too_far_and_takes_longer() -> None:
    now_ns = [BEGIN_NS]
    loop = made(lambda: now_ns[0], 1)
    loop.prepare(BEGIN_NS)
    chance = random.Random(1)
    while not loop.over:
        loop.cycle()
        now_ns[0] += chance.choice((1, 2)) * PERIOD_NS
    figures = loop.figures(now_ns[0])
    assert figures['travelled_m'] > 1.35
    assert figures['time_ms'] > 1.25 * 6300


def test_a_loop_that_is_never_called_again_drives_on_as_it_was_told() -> None:
    now_ns = [BEGIN_NS]
    loop = made(lambda: now_ns[0], 1)
    loop.prepare(BEGIN_NS)
    for _ in range(8):
        loop.cycle()
        now_ns[0] += PERIOD_NS
    figures = loop.figures(now_ns[0] + 10 * NS_PER_S)
    assert figures['travelled_m'] > 2.0
    assert not figures['arrived']


# --- what the case makes of it ---------------------------------------------------------------

def outcome(found: Measurement) -> RunOutcome:
    samples = dict(found.samples)
    samples['control_ns'] = np.full(len(samples['time_s']), 30_000)
    return RunOutcome(RunStatus.OK, '', samples, {**found.figures, 'env waited_ms': 0.0})


def test_the_case_finds_the_aims_reached_and_draws_the_figures() -> None:
    options = BenchOptions(1.0, 1)
    outcomes = Outcomes(CASE.plan(options))
    good = outcome(under_load(7, 1))
    slow = replace(good, samples={**good.samples, 'time_s': 2 * good.samples['time_s']})
    for key in outcomes.runs:
        if key == 'laws':
            outcomes.add(key, RunOutcome(RunStatus.OK, '', {}, {
                'kanayama 0.3 rms_m': 0.01, 'kanayama 0.3 maximum_m': 0.02,
                'kanayama 0.3 control_us': 12.0,
                'regulated_pure_pursuit 0.3 rms_m': 0.02}))
        elif key.startswith('eight'):
            outcomes.add(key, RunOutcome(RunStatus.MISSING, 'left out'))
        else:
            outcomes.add(key, good if key.startswith('rt ') else slow)
    result = CASE.evaluate(options, outcomes)
    verdicts = {target.text: target.verdict for target in result.targets}
    assert verdicts.pop('eight, 7 tasks: cycle off 20 ms, p99.9') is TargetVerdict.UNKNOWN
    assert set(verdicts.values()) == {TargetVerdict.REACHED}, verdicts
    plots = {plot.name: plot for plot in result.plots}
    assert list(plots) == ['1-way', '1-time', '12a-way', '12b-way', '13a-heading', '13b-heading',
                           '14a-cycle', '14b-cycle']
    assert {series.label for series in plots['14a-cycle'].series} >= {
        '0 tasks', '5 tasks', '7 tasks'}
    assert not any(plot.flat() for plot in plots.values()), 'a flat one is drawn as well'
    kept = plots['14b-cycle'].series[0].y
    assert list(kept) == pytest.approx([300.0] * len(kept))
    assert {series.label for series in plots['1-way'].series} == {
        'paper, without real time', 'rt_robot_os', 'Python threads', 'Process without real time',
        'rclpy SingleThreadedExecutor', 'rclpy MultiThreadedExecutor'}
    rows = {row.label: row for row in result.tables[0].rows}
    assert rows['paper, 5 tasks'].published
    found = rows['rt_robot_os, 7 inside'].metrics['longest']
    assert found is not None and found.median == pytest.approx(300.0)


@pytest.mark.parametrize('key', ['rt 7', 'single 7'])
def test_a_real_run_that_is_cut_short_says_where_the_robot_is(key: str) -> None:
    run = next(run for run in CASE.plan(BenchOptions(1.0, 1)) if run.key == key)
    if key == 'single 7':
        pytest.importorskip('rclpy', reason='rclpy is not installed')
    found = measure(replace(run, cpu=UNPINNED, priority=0, arguments={
        **run.arguments, 'inside': 1, 'limit_ns': 700 * NS_PER_MS}))
    assert found.status is RunStatus.OK, found.reason
    assert not found.figures['arrived']
    assert 0.0 < found.figures['travelled_m'] < 1.0
    assert len(found.samples['time_s']) >= 1
    assert (found.samples['control_ns'] > 0).all()


def test_the_laws_are_compared_on_a_clock_of_their_own() -> None:
    class Given:
        arguments = {'laws': [('kanayama', 1.2)], 'seed': 1}

    figures = laws(Given()).figures  # type: ignore[arg-type]
    assert figures['kanayama 1.2 rms_m'] < 0.03
    again = dict(laws(Given()).figures)  # type: ignore[arg-type]
    # Only the cost is of this machine.
    assert again.pop('kanayama 1.2 control_us') > 0.0
    assert again == {key: figures[key] for key in again}

#!/usr/bin/env python3
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
Let each allocation of a run fail once: no crash, and an exception or the right result.

    .venv/bin/python scripts/failing_allocations.py [--step 1] [--scenarios 6]

A scenario runs once to count its allocations, then once for each of them with that one failing
(``_testcapi.set_nomemory``). A run may end with an error, or with failures of tasks in its report;
one without any must have done what the first did. A SystemError of a built-in function or method
says that it returned NULL without an exception, or a result with one: that is a defect, as is a crash.
(The interpreter itself does so in functions of Python, where no memory is left for a traceback.)
"""

from __future__ import annotations

import argparse
import gc
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'kernel')]

from differential_runner import Runner  # noqa: E402, I100
from differential_scenario import ClockData  # noqa: E402
from differential_scenario import KernelData  # noqa: E402
from differential_scenario import PipeData  # noqa: E402
from differential_scenario import ReaderData  # noqa: E402
from differential_scenario import Scenario  # noqa: E402
from differential_scenario import TaskData  # noqa: E402
from differential_scenario import TopicData  # noqa: E402
from differential_scenario import TriggerData  # noqa: E402

MS = 1_000_000
# After so many runs in a row that did the right thing no allocation is left to fail.
QUIET = 30
RUNS = (2 * MS,)
SCENARIOS = (
    Scenario(  # timers and preemption
        tasks=(TaskData(5, 500_000, programs=((('spend', 300_000),),)),
               TaskData(9, 200_000, programs=((('spend', 30_000), ('settle',)),))), runs=RUNS),
    Scenario(  # topics and their triggers
        tasks=(TaskData(5, 400_000, programs=((('publish', 0, 0), ('publish', 1, 0)),)),
               TaskData(9, programs=((('take', 0), ('latest', 1)),)), TaskData(3)),
        topics=(TopicData('fixed', 2), TopicData('tail', 2)),
        readers=(ReaderData(0, 1, True), ReaderData(1, 1)),
        triggers=(TriggerData(2, 0, (0, 1)), TriggerData(2, 2, (0,))), runs=RUNS),
    Scenario(  # budgets, failures, policies
        tasks=(TaskData(5, 500_000, budget_ns=100_000, on_budget='ABORT', failure='RESTART',
                        on_restart=(('spend', 1000),), programs=((('spend', 300_000),),)),
               TaskData(7, 600_000, failure='SAFE_STATE', on_safe_state=(('spend', 1),),
                        programs=((('raise', 0),),)),
               TaskData(6, 100_000, overrun='CATCH_UP', programs=((('spend', 150_000),),))),
        runs=RUNS),
    Scenario(  # coroutines, one-shot timers, events
        tasks=(TaskData(5, is_async=True, failure='RESTART', programs=((
                   ('wait', (('sleep', 200_000),)), ('wait', (('event', 0), ('sleep', 900_000))),
                   ('wait', (('sample', 0),)), ('start_timer', 0, 10_000)),)),
               TaskData(3, 300_000, programs=((('set_event', 0), ('publish', 0, 0)),)),
               TaskData(8)),
        topics=(TopicData(),), readers=(ReaderData(),), events=1, timers=(2,), runs=RUNS),
    Scenario(  # resources, interrupts, observers, the idle hook
        tasks=(TaskData(5, 500_000, resources=(0,), programs=((
                   ('within', 0, (('spend', 100_000), ('release', 1))), ('write', 0, True)),)),
               TaskData(8, resources=(0,), programs=((('within', 0, ()),),)),
               TaskData(9, programs=((('drain', 0),),))),
        resources=1, pipes=(PipeData(2),),
        kernel=KernelData(observers=(0,), records=4, idle=(('spend', 1000),)), runs=RUNS),
    Scenario(  # logical execution time, close releases, statistics
        tasks=(TaskData(5, 500_000, logical=True, programs=((('publish', 0, 0), ('take', 0)),)),
               TaskData(4, 50_000, programs=((('statistics',),), ())), TaskData(3, 60_000)),
        topics=(TopicData(),), readers=(ReaderData(),),
        clock=ClockData(wake_ns=20_000, signal=True), runs=(MS,)),
)


def told_by(found: dict[str, Any]) -> list[str]:
    """Give what a run says of errors."""
    told = [str(value) for key, value in found.items()
            if key.startswith('end of run') and not isinstance(value, str)]
    return told + [failure[3] for key, value in found.items() if key.startswith('failures')
                   for failure in value]


def run(scenario: Scenario, fails_at: int) -> tuple[dict[str, Any] | None, list[str]]:
    """Run it with one allocation failing; give what was seen, and what is told of errors."""
    import _testcapi
    try:
        runner = Runner(scenario)
        kernel_run = runner.kernel.run

        def failing_run(duration_ns: int | None) -> str:
            _testcapi.set_nomemory(fails_at, fails_at + 1)
            try:
                return kernel_run(duration_ns)
            finally:
                _testcapi.remove_mem_hooks()

        if fails_at:
            runner.run_kernel = failing_run
        found = runner.run()
    except Exception as error:
        return None, [f'{type(error).__name__}: {error}']
    return found, told_by(found)


def child(number: int, first: int, step: int) -> int:
    """Go through the allocations of a scenario from a number on; tell each on a line."""
    scenario = SCENARIOS[number]
    right, right_told = run(scenario, 0)
    fails_at, quiet = first, 0
    while quiet < QUIET:  # there are no more allocations
        print(f'at {fails_at}', flush=True)
        found, told = run(scenario, fails_at)
        if any('SystemError: <' in text and '<function ' not in text for text in told):
            print(f'DEFECT at {fails_at}: {told}', flush=True)
        if told == right_told and found != right:
            print(f'DEFECT at {fails_at}: it did something else and told nothing', flush=True)
        quiet = quiet + 1 if found == right else 0
        fails_at += step
        if not fails_at % 500:
            gc.collect()
    return 0


def main() -> int:
    """Run all; the exit code says whether a defect was found."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--step', type=int, default=1, help='only each so-many-th allocation')
    parser.add_argument('--scenarios', type=int, default=len(SCENARIOS))
    parser.add_argument('--child', type=int, nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        return child(*options.child, options.step)
    defects = 0
    for number in range(options.scenarios):
        first = 1
        while True:
            done = subprocess.run(
                [sys.executable, '-X', 'faulthandler', __file__, '--step', str(options.step),
                 '--child', str(number), str(first)], text=True, capture_output=True,
                env=os.environ)
            lines = done.stdout.splitlines()
            told = [line for line in lines if line.startswith('DEFECT')]
            reached = max([int(line[3:]) for line in lines if line.startswith('at ')] or [first])
            for line in told:
                print(f'scenario {number}: {line}')
            defects += len(told)
            if done.returncode == 0:
                print(f'scenario {number}: one in {options.step} of {reached} allocations failed, '
                      'each in a run of its own')
                break
            defects += 1
            print(f'scenario {number}, allocation {reached}: exit code {done.returncode}\n'
                  f'{done.stderr[-2500:]}')
            first = reached + options.step
    return int(bool(defects))


if __name__ == '__main__':
    sys.exit(main())

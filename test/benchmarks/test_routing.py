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


"""The case routing: what it runs, and what it makes of the runs."""

from __future__ import annotations

from pathlib import Path

from benchmarks.routing import subjects as subject
from benchmarks.routing.case import CASE
import numpy as np
import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict

USUAL = BenchOptions(2.0, 3)


def harness(arguments: dict, folder: Path) -> Harness:
    return Harness(arguments, -2, 0, folder)


def test_the_robot_counts_in_a_flat_as_in_truth(tmp_path: Path) -> None:
    measured = subject.home(harness({
        'rows': [('paper moving', 'home12_moving', 'paper')], 'seconds': 60, 'seeds': 1},
        tmp_path))
    found = {name.removeprefix('paper moving '): values.tolist()
             for name, values in measured.samples.items()}
    assert set(found) == set(subject.KEPT)
    assert found['delivery_ppm'][0] > 980_000
    assert (found['duplicates'], found['withheld'], found['differ']) == ([0], [0], [0])


def outcomes(**changed: int) -> Outcomes:
    """Make outcomes of which all are the same, but for some."""
    runs = CASE.plan(USUAL)
    found = Outcomes(runs)
    keys = {'home': [row[0] for row in runs[0].arguments['rows']],
            'load': [f'{protocol} {period}' for protocol in runs[1].arguments['protocols']
                     for period in runs[1].arguments['periods_binary_ms']],
            'relays': [f'{size} {sink}' for size in runs[2].arguments['sizes']
                       for sink in ('corner', 'fixed', 'moving')]}
    usual = dict.fromkeys(subject.KEPT, 0) | {'delivery_ppm': 999_000, 'load_milli': 2000}
    for run in runs:
        samples = {f'{key} {name}': np.array([changed.get(
            f'{key} {name}'.replace(' ', '_'), value)])
                   for key in keys[run.key] for name, value in usual.items()}
        found.add(run.key, RunOutcome(RunStatus.OK, samples=samples))
    return found


def test_what_is_promised_is_judged() -> None:
    result = CASE.evaluate(USUAL, outcomes(**{'200_moving_load_milli': 1500}))
    assert {target.verdict for target in result.targets} == {TargetVerdict.REACHED}
    assert len(result.tables) == 3
    gain = result.targets[-1].measured
    assert gain is not None and gain.median == pytest.approx(0.75)


@pytest.mark.parametrize('name, value', [
    ('ctp_delivery_ppm', 994_000), ('paper_delivery_ppm', 989_000),
    ('paper_moving_delivery_ppm', 979_000), ('paper_moving_longest_ms', 8001),
    ('lqi_duplicates', 1), ('ctp_moving_withheld', 1), ('lqi_differ', 1),
    ('200_moving_load_milli', 2001)])
def test_what_is_missed_is_told(name: str, value: int) -> None:
    result = CASE.evaluate(USUAL, outcomes(**{name: value}))
    assert [target.verdict for target in result.targets].count(TargetVerdict.MISSED) == 1

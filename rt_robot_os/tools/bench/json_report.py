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

"""The result as JSON, and the raw samples as compressed NumPy files; both can be read again."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import RunStatus

SCHEMA_VERSION = 2
_META = 'meta'


def document(machine: Mapping[str, Any], conditions: Mapping[str, Any], options: BenchOptions,
             results: Sequence[CaseResult], interrupted: bool) -> dict[str, Any]:
    """
    Put everything together in plain values.

    :param machine: from :func:`rt_robot_os.tools.bench.machine.describe`.
    :param conditions: when it was measured, with which privileges, what the harness costs.
    :param interrupted: the cases after these were not measured.
    """
    return {
        'program': 'rt_robot_os bench', 'schema': SCHEMA_VERSION, **conditions,
        'interrupted': interrupted,
        'options': {'seconds': options.seconds, 'repeats': options.repeats, 'full': options.full,
                    'quick': options.quick, 'docs': options.docs, 'hours': options.hours,
                    'data': Path(options.data).name, 'expected': Path(options.expected).name,
                    'imu_mounting': list(options.imu_mounting)},
        'machine': dict(machine), 'samples': _files(options.out, results),
        'cases': [result.as_json() for result in results]}


def _files(out: str, results: Sequence[CaseResult]) -> dict[str, list[str]]:
    """Name the files that hold the raw samples of each case; none without a folder."""
    return {result.name: sorted(
        path.name for path in Path(out).glob(f'{result.name}[.-]*')
        if path.suffix in ('.npz', '.csv')) for result in results} if out else {}


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """
    Write a document; the file is complete or as it was before.

    :raises OSError: it cannot be written.
    """
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + '\n'
    if path.exists() and not path.is_file():
        path.write_text(text)  # such as /dev/stdout
        return
    unfinished = path.with_name(f'.{path.name}.{os.getpid()}')
    unfinished.write_text(text)
    unfinished.replace(path)


def write_samples(folder: Path, name: str, outcomes: Outcomes) -> None:
    """
    Write the raw samples of a case: ``NAME.npz`` with the arrays ``run/repeat/sample``.

    :raises OSError: it cannot be written.
    """
    arrays: dict[str, Any] = {}
    meta: dict[str, list[dict[str, Any]]] = {}
    for key in outcomes.runs:
        meta[key] = [{'status': outcome.status.value, 'reason': outcome.reason,
                      'figures': dict(outcome.figures),
                      'realtime': list(outcome.realtime)} for outcome in outcomes.all(key)]
        for repeat, outcome in enumerate(outcomes.all(key)):
            for sample, values in outcome.samples.items():
                arrays[f'{key}/{repeat}/{sample}'] = values
    arrays[_META] = np.array(json.dumps(meta))
    unfinished = folder / f'.{name}.npz'
    np.savez_compressed(unfinished, **arrays)
    unfinished.replace(folder / f'{name}.npz')


def read_samples(folder: Path, name: str, runs: Sequence[Run]) -> Outcomes:
    """
    Read what :func:`write_samples` wrote.

    :param runs: of the case; those that are not in the file were not run.
    :raises OSError: there is no such file.
    :raises ValueError: it is something else.
    """
    outcomes = Outcomes(runs)
    with np.load(folder / f'{name}.npz') as file:
        meta = json.loads(str(file[_META]))
        samples: dict[tuple[str, str], dict[str, Any]] = {}
        for path in file.files:
            if path != _META:
                key, repeat, sample = path.rsplit('/', 2)
                samples.setdefault((key, repeat), {})[sample] = file[path]
    for key in outcomes.runs:
        for repeat, one in enumerate(meta.get(key, ())):
            outcomes.add(key, RunOutcome(RunStatus(one['status']), one['reason'],
                                         samples.get((key, str(repeat)), {}), one['figures'],
                                         [(step, in_force, reason)
                                          for step, in_force, reason in one['realtime']]))
    return outcomes

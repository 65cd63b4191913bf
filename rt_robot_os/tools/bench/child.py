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
The child process of one measurement: a fresh interpreter that runs one subject and ends.

Run as ``python -m rt_robot_os.tools.bench.child PARENT FOLDER`` with the job as JSON in
``job.json`` of that folder; it leaves ``result.npz`` there.
"""

from __future__ import annotations

from collections.abc import Sequence
import json
from pathlib import Path
import signal
import sys
from types import FrameType
from typing import Any

import numpy as np

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.needs import remedy
from rt_robot_os.base.requirements import LIBRARIES
from rt_robot_os.linux.process import run_child
from rt_robot_os.tools.bench import builds
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Unavailable
from rt_robot_os.tools.bench.helper import load_function
from rt_robot_os.tools.bench.result import RunStatus

JOB_FILE = 'job.json'
RESULT_FILE = 'result.npz'
_OWN = 'rt_robot_os'
_META = 'meta'


def _work(job: dict[str, Any], folder: Path) -> RunOutcome:
    harness = Harness(job['arguments'], job['cpu'], job['priority'], folder)
    why = builds.why_not(job['build'])
    if why:
        return RunOutcome(RunStatus.MISSING, why)
    try:
        measured = load_function(job['subject'])(harness)
    except ImportError as error:
        name = (error.name or '').partition('.')[0]
        if name == _OWN or not name:
            return RunOutcome(RunStatus.FAILED, f'ImportError: {error}')
        if not isinstance(error, ModuleNotFoundError):
            return RunOutcome(
                RunStatus.MISSING, f'this version of {name} has not got it ({error})')
        known = [each for each in LIBRARIES.values() if each.module == name]
        return RunOutcome(RunStatus.MISSING, f'{name} is not installed ({error})' + (
            f'; remedy: {remedy(known)}' if known else ''))
    except Unavailable as error:
        return RunOutcome(RunStatus.MISSING, str(error))
    except (RtRobotError, OSError, RuntimeError) as error:
        if isinstance(error.__cause__, ImportError):  # such as that of a message package
            return RunOutcome(RunStatus.MISSING, str(error))
        return RunOutcome(RunStatus.FAILED, f'{type(error).__name__}: {error}')
    figures = {**harness.machine_state.figures(), **builds.figures(), **measured.figures}
    return RunOutcome(RunStatus.OK, '', measured.samples, figures,
                      [(r.step, r.ok, r.reason) for r in harness.realtime])


def write_result(folder: Path, outcome: RunOutcome) -> None:
    """Leave an outcome for the parent; the file appears complete or not at all."""
    meta = json.dumps({'status': outcome.status.value, 'reason': outcome.reason,
                       'figures': dict(outcome.figures), 'realtime': list(outcome.realtime)})
    path = folder / 'unfinished.npz'
    arrays: dict[str, Any] = {_META: np.array(meta), **outcome.samples}
    np.savez(path, **arrays)
    path.rename(folder / RESULT_FILE)


def read_result(folder: Path) -> RunOutcome:
    """Read what a child left."""
    with np.load(folder / RESULT_FILE) as file:
        meta = json.loads(str(file[_META]))
        samples = {name: file[name] for name in file.files if name != _META}
    return RunOutcome(RunStatus(meta['status']), meta['reason'], samples, meta['figures'],
                      [(step, ok, reason) for step, ok, reason in meta['realtime']])


def main(argv: Sequence[str]) -> int:
    """Run one subject."""
    folder = Path(argv[0])
    job = json.loads((folder / JOB_FILE).read_text())

    def end(signum: int, frame: FrameType | None) -> None:
        sys.exit(128 + signum)

    signal.signal(signal.SIGTERM, end)
    write_result(folder, _work(job, folder))
    return 0


if __name__ == '__main__':
    sys.exit(run_child(main, signal.SIGKILL))

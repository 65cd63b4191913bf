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

"""What a robot's tasks were measured to take, and the file that stores it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import field
from dataclasses import fields
import json
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError

FORMAT: Final = 1
FILE_BYTES_MAXIMUM: Final = 4 << 20
FEW_RUNS: Final = 100


@dataclass(frozen=True, slots=True)
class MeasuredTask:
    """
    A task in a measurement; the maxima are what was seen, without a margin.

    :ivar releases: whatever released it.
    :ivar execution_ns: the longest computing time of a job, what preempted it taken off.
    :ivar native_ns: the longest time that its code held up an interrupt.
    :ivar latency_ns: the longest time from a release to the start of the job.
    :ivar response_ns: the longest time from a release to the end of the job.
    """

    priority: int
    period_ns: int
    releases: int
    runs: int
    execution_ns: int
    native_ns: int
    latency_ns: int
    response_ns: int


@dataclass(frozen=True, slots=True)
class Measured:
    """
    A measurement.

    :ivar elapsed_ns: how long it took.
    :ivar tick_ns: computing time of the kernel for each wake-up or release, on average; 0 when
        that could not be measured.
    :ivar resources: the longest time that each resource was held, what preempted it included.
    :ivar idle: devices that did not deliver, with the reason: their tasks did not do their work.
    :ivar refused: what Linux did not grant the core.
    :ivar fed: whether topics that ROS feeds were published.
    """

    elapsed_ns: int
    tasks: Mapping[str, MeasuredTask]
    tick_ns: int = 0
    resources: Mapping[str, int] = field(default_factory=dict)
    idle: Mapping[str, str] = field(default_factory=dict)
    refused: tuple[str, ...] = ()
    fed: bool = False

    def lateness_ns(self) -> int:
        """
        Return how late the machine released tasks.

        The highest task with a period waits for no other task, so it waited for the timer,
        Linux, and native calls below it.
        """
        timed = [task for task in self.tasks.values() if task.period_ns and task.runs]
        return max(timed, key=lambda t: (t.priority, -t.latency_ns)).latency_ns if timed else 0

    def save(self, path: Path) -> None:
        """
        Write it as JSON.

        :raises ConfigError: the file cannot be written.
        """
        try:
            path.write_text(json.dumps({'format': FORMAT, **asdict(self)}, indent=1) + '\n')
        except OSError as error:
            raise ConfigError([f'{path}: cannot be written: {error.strerror}']) from error


def read_measured(path: Path) -> Measured:
    """
    Read what :meth:`Measured.save` wrote.

    :raises ConfigError: the file cannot be read or is something else; it lists every problem.
    """
    try:
        if path.stat().st_size > FILE_BYTES_MAXIMUM:
            raise ConfigError([f'{path}: larger than {FILE_BYTES_MAXIMUM} bytes: this is no file '
                               'that --save-measured wrote'])
        data = json.loads(path.read_text())
    except OSError as error:
        raise ConfigError([f'{path}: cannot be read: {error.strerror}; write it with '
                           'plan --measure 10 --save-measured FILE']) from error
    except (ValueError, RecursionError) as error:
        raise ConfigError([f'{path}: no JSON: {error}']) from None
    if not isinstance(data, dict) or data.get('format') != FORMAT:
        raise ConfigError([f'{path}: not a measurement of format {FORMAT}: measure again with '
                           'plan --measure 10 --save-measured FILE'])
    problems: list[str] = []
    tasks = _tasks(data.get('tasks'), problems)
    elapsed_ns = _whole(data, 'elapsed_ns', problems, 1)
    tick_ns = _whole(data, 'tick_ns', problems, 0)
    resources = _resources(data.get('resources'), problems)
    idle, refused = data.get('idle'), data.get('refused')
    if not isinstance(idle, dict) or not all(isinstance(each, str) for each in idle.values()):
        problems.append('idle must be an object of reasons by device')
    if not isinstance(refused, list) or not all(isinstance(each, str) for each in refused):
        problems.append('refused must be a list of texts')
    if not isinstance(data.get('fed'), bool):
        problems.append('fed must be true or false')
    if problems:
        raise ConfigError([f'{path}: {problem}' for problem in problems])
    return Measured(elapsed_ns, tasks, tick_ns, resources, dict(idle or {}),
                    tuple(refused or ()), data['fed'])


def _tasks(data: Any, problems: list[str]) -> dict[str, MeasuredTask]:
    if not isinstance(data, dict):
        problems.append('tasks must be an object of tasks by name')
        return {}
    keys = [each.name for each in fields(MeasuredTask)]
    found = {}
    for name, values in data.items():
        if not isinstance(values, dict):
            problems.append(f'tasks: {name!r} must be an object')
            continue
        extra = sorted(set(values) - set(keys))
        if extra:
            problems.append(f'tasks: {name!r}: unknown {", ".join(extra)}; known: '
                            f'{", ".join(keys)}')
        numbers = {key: _whole(values, key, problems, 0, f'tasks: {name!r}: ') for key in keys}
        found[name] = MeasuredTask(**numbers)
    return found


def _resources(data: Any, problems: list[str]) -> dict[str, int]:
    if not isinstance(data, dict):
        problems.append('resources must be an object of nanoseconds by name')
        return {}
    return {name: _whole(data, name, problems, 0, 'resources: ') for name in data}


def _whole(data: Mapping[str, Any], key: str, problems: list[str], least: int,
           where: str = '') -> int:
    value = data.get(key)
    if isinstance(value, int) and not isinstance(value, bool) and least <= value < 1 << 62:
        return value
    problems.append(f'{where}{key} = {value!r}: must be an integer from {least}')
    return least

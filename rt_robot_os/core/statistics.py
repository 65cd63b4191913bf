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

"""The statistics of a core, from sources that its parts add."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import itertools
from typing import Any

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.safe_text import safe_text
from rt_robot_os.kernel import Kernel
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.requests import Arguments
from rt_robot_os.link.requests import Part
from rt_robot_os.link.requests import Requests
from rt_robot_os.link.session import ClientSession
from rt_robot_os.link.task_records import encode_task
from rt_robot_os.modules import Module

# Limits on the statistics of a module; more would delay other readers of the statistics.
_VALUES_MAXIMUM = 256
_VALUE_TEXT_MAXIMUM = 500

Rows = Callable[[], Iterable[Arguments]]
Facts = Callable[[], Mapping[str, Any]]


class Statistics:
    """The statistics of the tasks, of all sources, and of the core itself, in this order."""

    def __init__(self, kernel: Kernel, requests: Requests, warn: Callable[[str], object]) -> None:
        """
        Register the request.

        :param warn: reports, once for each source, that the source fails.
        """
        self._kernel = kernel
        self._warn = warn
        self._rows: list[tuple[str, Rows]] = []
        self._facts: list[Rows] = []
        self._failing: set[Rows] = set()
        requests.add_long('statistics', self._answer)

    def add_rows(self, part: str, rows: Rows) -> None:
        """
        Add a source of rows, each sent in a packet of its own.

        :param part: the kind of rows, see :func:`rt_robot_os.link.core_statistics.collect`.
        """
        self._rows.append((part, rows))

    def add_facts(self, facts: Facts) -> None:
        """
        Add a source of facts about the core itself.

        :param facts: returns plain values by name; called by the lowest tasks.
        """
        self._facts.append(lambda: (dict(facts()),))

    def _answer(self, session: ClientSession, arguments: Arguments) -> Iterator[Part]:
        for task in self._kernel.tasks:
            yield PacketKind.TASK, encode_task(task)
        for part, rows in self._rows:
            for row in self._rows_of(rows):
                yield {'part': part, **row}
        core: Arguments = {'part': 'core'}
        for facts in self._facts:
            for found in self._rows_of(facts):
                core |= found
        yield core

    def _rows_of(self, rows: Rows) -> Iterator[Arguments]:
        """Query one source; if it fails, the others are still sent."""
        try:
            yield from rows()
        except Exception as error:
            if rows not in self._failing:
                self._failing.add(rows)
                self._warn(f'statistics are incomplete: {type(error).__name__}: {error}')


def module_rows(modules: Sequence[Module], requests: Requests) -> Iterator[Arguments]:
    """
    Query each module for its statistics.

    :param requests: records the module whose code runs.
    """
    for module in modules:
        requests.occupied_by = f'statistics() of {module.name}'
        try:
            values = statistics_of(module)
        finally:
            requests.occupied_by = ''
        yield {'name': module.name, 'values': values}


def statistics_of(module: Module) -> dict[str, str | int | float]:
    """Query a module, possibly of a user, for its statistics; bounded, and fit to be sent."""
    try:
        values = module.statistics()
        shown = {safe_line(str(name)): _plain_value(value)
                 for name, value in itertools.islice(values.items(), _VALUES_MAXIMUM)}
        if len(values) > _VALUES_MAXIMUM:
            shown['warning'] = shown.get('warning') or (
                f'statistics() returns {len(values)} values; {_VALUES_MAXIMUM} are shown')
        return shown
    except Exception as error:
        return {'warning': safe_line(f'statistics() failed: {type(error).__name__}: {error}')}


def _plain_value(value: Any) -> str | int | float:
    if isinstance(value, int | float):
        return value
    return safe_text(str(value)[:_VALUE_TEXT_MAXIMUM])

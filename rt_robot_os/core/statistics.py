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

# Of what a module tells of itself; more would hold up whoever else reads the statistics.
_VALUES_MAXIMUM = 256
_VALUE_TEXT_MAXIMUM = 500

Rows = Callable[[], Iterable[Arguments]]
Facts = Callable[[], Mapping[str, Any]]


class Statistics:
    """The statistics of the tasks, of all sources, and of the core itself, in this order."""

    def __init__(self, kernel: Kernel, requests: Requests, warn: Callable[[str], object]) -> None:
        """
        Answer who asks for all of them.

        :param warn: reports, once for each source, that it gives none.
        """
        self._kernel = kernel
        self._warn = warn
        self._rows: list[tuple[str, Rows]] = []
        self._facts: list[Rows] = []
        self._failing: set[Rows] = set()
        requests.add_long('statistics', self._answer)

    def add_rows(self, part: str, rows: Rows) -> None:
        """
        Tell of many things of a kind, each in a packet of its own.

        :param part: which kind, see :func:`rt_robot_os.link.client.collect`.
        """
        self._rows.append((part, rows))

    def add_facts(self, facts: Facts) -> None:
        """
        Tell something of the core itself.

        :param facts: gives plain values by name; asked by the lowest tasks.
        """
        self._facts.append(lambda: (dict(facts()),))

    def _answer(self, session: ClientSession, arguments: Arguments) -> Iterator[Part]:
        for task in self._kernel.tasks:
            yield PacketKind.TASK, encode_task(task)
        for part, rows in self._rows:
            for row in self._asked(rows):
                yield {'part': part, **row}
        told: Arguments = {'part': 'core'}
        for facts in self._facts:
            for found in self._asked(facts):
                told |= found
        yield told

    def _asked(self, rows: Rows) -> Iterator[Arguments]:
        """Ask one source; the code behind it may be anybody's, and must not hide the others."""
        try:
            yield from rows()
        except Exception as error:
            if rows not in self._failing:
                self._failing.add(rows)
                self._warn(f'statistics are incomplete: {type(error).__name__}: {error}')


def module_rows(modules: Sequence[Module], requests: Requests) -> Iterator[Arguments]:
    """
    Ask each module for its statistics.

    :param requests: who waits for them is told whose code that is.
    """
    for module in modules:
        requests.occupied_by = f'statistics() of {module.name}'
        try:
            values = statistics_of(module)
        finally:
            requests.occupied_by = ''
        yield {'name': module.name, 'values': values}


def statistics_of(module: Module) -> dict[str, str | int | float]:
    """Ask a module, which may be anybody's, for its statistics; bounded, and fit to be sent."""
    try:
        told = module.statistics()
        kept = {safe_line(str(name)): _plain_value(value)
                for name, value in itertools.islice(told.items(), _VALUES_MAXIMUM)}
        if len(told) > _VALUES_MAXIMUM:
            kept['warning'] = kept.get('warning') or (
                f'statistics() gives {len(told)} values; {_VALUES_MAXIMUM} are shown')
        return kept
    except Exception as error:
        return {'warning': safe_line(f'statistics() failed: {type(error).__name__}: {error}')}


def _plain_value(value: Any) -> str | int | float:
    if isinstance(value, int | float):
        return value
    return safe_text(str(value)[:_VALUE_TEXT_MAXIMUM])

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

"""The whole report of one call as blocks: requirements, verdicts, machine, method, cases."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

from rt_robot_os.tools.bench import expectations
from rt_robot_os.tools.bench import plot_drawing
from rt_robot_os.tools.bench.advice import INTRODUCTION
from rt_robot_os.tools.bench.advice import requirements
from rt_robot_os.tools.bench.advice import WORDS
from rt_robot_os.tools.bench.blocks import Block
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import CodeBlock
from rt_robot_os.tools.bench.blocks import Heading
from rt_robot_os.tools.bench.blocks import Paragraph
from rt_robot_os.tools.bench.blocks import PictureBlock
from rt_robot_os.tools.bench.blocks import TableBlock
from rt_robot_os.tools.bench.case import COMPILED
from rt_robot_os.tools.bench.machine import IN_FORCE
from rt_robot_os.tools.bench.machine import summary
from rt_robot_os.tools.bench.machine import warnings
from rt_robot_os.tools.bench.method import BY_HAND
from rt_robot_os.tools.bench.method import method
from rt_robot_os.tools.bench.method import PEERS
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.text_report import absence
from rt_robot_os.tools.bench.text_report import cell
from rt_robot_os.tools.bench.text_report import spread
from rt_robot_os.tools.bench.verdicts import verdicts

OURS = 'rt_robot_os'
_NAMES = {'cpu': 'processor', 'cores': 'CPUs', 'cores_allowed': 'CPUs that bench may use',
          'isolated': 'isolated CPUs', 'work_queue_cpus': 'CPUs of the work queues (mask)',
          'build': 'build of rt_robot_os', 'compiled': 'hot path compiled',
          'kernel': 'Linux', 'kernel_version': 'Linux, version',
          'preemption': 'Linux, preemption', 'python': 'Python', 'rmw': 'RMW_IMPLEMENTATION',
          'ros_distro': 'ROS_DISTRO', 'load_average': 'load average at the start'}


def report(content: Mapping[str, Any], results: Sequence[CaseResult]) -> Iterator[Block]:
    """
    Put the report together.

    :param content: from :func:`rt_robot_os.tools.bench.json_report.document`.
    """
    yield Heading('Benchmarks of rt_robot_os', 1)
    yield Paragraph(INTRODUCTION)
    yield Paragraph(f'Measured from {_moment(content["started"])} to {_moment(content["ended"])} '
                    'UTC, all systems in turns on one machine.'
                    + (' Interrupted: cases are missing.' if content['interrupted'] else ''))
    refused = [f'Refused to the measured processes: {step}: {state}'
               for step, state in content['realtime'].items() if state != IN_FORCE]
    yield Bullets([*summary(content['machine']), *warnings(content['machine']), *refused])
    yield from requirements(results)
    yield from verdicts(results)
    yield Heading('Words', 2)
    yield Bullets(WORDS)
    yield Heading('Cases', 2)
    if not plot_drawing.available():
        yield Paragraph(plot_drawing.remedy() + '; then `bench --page FOLDER` draws them.')
    for result in results:
        yield from _case(result)
    yield Heading('Method', 2)
    yield Bullets(method(content['machine'], content, content['options']))
    yield CodeBlock(BY_HAND, 'python')
    yield Heading('How each system is run', 2)
    yield Bullets(PEERS)
    yield from _machine(content)
    yield from expectations.blocks(results, content['machine'])
    yield Heading('Repeat it', 2)
    yield CodeBlock(content['command'])


def _moment(text: str) -> str:
    return text[:16].replace('T', ' ')


def _case(result: CaseResult) -> Iterator[Block]:
    yield Heading(f'{result.name}: {result.title}', 3)
    # How it was measured comes first; pictures belong to the whole case.
    explained = result.tables[:1] if result.tables and not result.tables[0].title else ()
    for table in explained:
        yield from _notes(table)
    if plot_drawing.available():
        for plot in result.plots:
            flat = plot.flat()
            if flat is not None:
                yield Paragraph(f'{plot.title}: {flat[0]:.4g} to {flat[1]:.4g} ({plot.y_label}), '
                                'so there is no picture.')
            elif any(series.x for series in plot.series):
                yield PictureBlock(plot, f'{result.name}-{plot.name}')
    for table in result.tables:
        if table.title:
            yield Heading(table.title, 4)
        if table not in explained:
            yield from _notes(table)
        yield _grid(table)
    runs = dict.fromkeys(row.run for table in result.tables for row in table.rows if row.run)
    if runs:
        yield Paragraph(f'Raw samples: `{result.name}.npz`; the runs of the rows, in their order: '
                        + ', '.join(f'`{run}`' for run in runs) + '.')


def _notes(table: Table) -> Iterator[Block]:
    if table.notes:
        yield Paragraph(' '.join(table.notes))


def _grid(table: Table) -> TableBlock:
    columns = [column for column in table.columns
               if not column.spread or any(spread(row.metrics.get(column.key))
                                           for row in table.rows)]
    rows: list[Sequence[str]] = []
    kinds: list[str] = []
    given: set[str] = set()
    for row in table.rows:
        if row.status is RunStatus.OK:
            rows.append((row.label, *(cell(row.metrics.get(c.key), c) for c in columns)))
        else:
            rows.append((row.label, absence(row, given)))
        kinds.append(_kind(row))
    return TableBlock(('', *(column.title for column in columns)), rows, kinds,
                      groups=(('', ''), *((column.group, column.unit) for column in columns)))


def _kind(row: Row) -> str:
    if row.published:
        return 'published'
    if row.status is not RunStatus.OK:
        return 'absent'
    # Of two builds the compiled one is what most users have.
    return 'ours' if OURS in row.label or row.run.endswith(f' {COMPILED}') else ''


def _machine(content: Mapping[str, Any]) -> Iterator[Block]:
    machine = content['machine']
    yield Heading('The machine', 2)
    rows = [(_NAMES.get(key, key.replace('_', ' ')), _plain(value))
            for key, value in machine.items() if value not in ('', [], {})]
    rows += [(f'measured processes: {step}', state)
             for step, state in content['realtime'].items()]
    yield TableBlock(('', ''), rows, [''] * len(rows), 2)


def _plain(value: Any) -> str:
    if isinstance(value, Mapping):
        return ', '.join(f'{key} {one}' for key, one in value.items())
    if isinstance(value, list | tuple):
        return ', '.join(_plain(one) for one in value)
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    return f'{value:.2f}' if isinstance(value, float) else str(value)

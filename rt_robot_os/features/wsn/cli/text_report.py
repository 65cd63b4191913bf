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


"""The results of simulations as text: one run, several seeds, several scenarios."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import math
import statistics
from typing import Final

from rt_robot_os.features.wsn.simulator.results import Results

_MOST_ROWS: Final = 40

Figure = Callable[[Results], float]

#: Figures that are compared between runs: title, unit, function, digits.
FIGURES: Final[Sequence[tuple[str, str, Figure, int]]] = (
    ('delivery', '%', lambda one: 100.0 * one.delivery, 2),
    ('duplicates', '', lambda one: one.duplicates, 0),
    ('data frames per packet', '', lambda one: one.per_delivery(one.data_transmissions), 2),
    ('all frames per packet', '', lambda one: one.per_delivery(one.transmissions), 2),
    ('latency p50', 'ms', lambda one: one.latency_ms(0.5), 1),
    ('latency p95', 'ms', lambda one: one.latency_ms(0.95), 1),
    ('hops, mean', '', lambda one: _mean_hops(one), 2),
    ('relay load, largest over mean', '', lambda one: one.load_ratio, 2),
    ('charge, largest over mean', '', lambda one: one.energy_ratio, 2),
    ('first battery empty after', 'days', lambda one: one.first_empty_days, 1),
    ('breaks', '', lambda one: len(one.gaps), 0),
    ('longest gap', 's', lambda one: one.gap_s[-1] if one.gaps else 0.0, 1))


def _mean_hops(one: Results) -> float:
    known = [one.hops[each] for each, parent in one.parents.items() if parent is not None]
    return statistics.fmean(known) if known else math.nan


def number(value: float, digits: int) -> str:
    """Format a number; - for an unknown one."""
    return f'{value:,.{digits}f}' if math.isfinite(value) else '-'


def one_run(one: Results) -> Iterator[str]:
    """Yield the results of one run: totals, then each node."""
    networks = f' in {len(one.sinks)} networks' if len(one.sinks) > 1 else ''
    yield (f'{one.scenario}: {one.nodes} nodes{networks}, {one.protocol}, seed {one.seed}, '
           f'{number(one.ended_s, 0)} s simulated in {number(one.wall_s, 2)} s '
           f'({number(one.ended_s / one.wall_s if one.wall_s else math.nan, 0)} times real time)')
    yield (f'generated {one.total_generated:,}, delivered {one.total_delivered:,}; '
           f'frames: {one.data_transmissions:,} data, {one.beacons:,} beacons, {one.acks:,} acks')
    yield ''
    width = max(len(title) for title, _, _, _ in FIGURES)
    for title, unit, of, digits in FIGURES:
        yield f'  {title:<{width}}  {number(of(one), digits):>10} {unit}'.rstrip()
    lost = {name: count for name, count in one.outcomes.items() if name != 'received' and count}
    if lost:
        yield ''
        yield f'frames not received: {_counts(lost)}'
    if one.counters:
        yield f'protocol: {_counts({name: n for name, n in one.counters.items() if n})}'
    if one.happenings:
        yield f'events: {_counts(one.happenings)}'
    if one.host:
        wrong = len(one.host['losses_that_differ'])
        yield (f"the robot's count: {one.host['duplicates_to_application']} duplicates to the "
               f"application, {one.host['withheld']} packets withheld, losses of "
               f'{len(one.parents) - wrong} of {len(one.parents)} nodes correct')
    yield ''
    yield from _nodes(one)


def _counts(counts: Mapping[str, int]) -> str:
    return ', '.join(f'{name} {count:,}' for name, count in counts.items()) or 'nothing'


def _nodes(one: Results) -> Iterator[str]:
    head = ('node', 'parent', 'hops', 'cost', 'generated', 'delivered', '%', 'data frames', 'mAh')
    rows = []
    for each in sorted(one.parents, key=lambda node: _share(one, node))[:_MOST_ROWS]:
        parent = one.parents[each]
        rows.append((
            str(each), '-' if parent is None else str(parent),
            '-' if parent is None else str(one.hops[each]),
            '-' if parent is None else str(one.costs[each]),
            f'{one.generated.get(each, 0):,}', f'{one.delivered.get(each, 0):,}',
            number(100.0 * _share(one, each), 1) if one.generated.get(each) else '-',
            f'{one.data_by_node.get(each, 0):,}',
            number(one.used_mah.get(each, math.nan), 2)))
    if len(one.parents) <= _MOST_ROWS:
        rows.sort(key=lambda row: int(row[0]))
    else:
        yield f'the {_MOST_ROWS} nodes of {len(one.parents):,} with the highest losses:'
    yield from table([head, *rows])


def _share(one: Results, node: int) -> float:
    made = one.generated.get(node, 0)
    return one.delivered.get(node, 0) / made if made else 1.0


def several(columns: Mapping[str, Sequence[Results]]) -> Iterator[str]:
    """
    Yield a comparison of runs: mean and standard deviation over the seeds.

    :param columns: runs by the title of their column.
    """
    if not columns:
        yield 'no run was completed'
        return
    rows = [('', *columns)]
    rows.append(('runs', *(str(len(runs)) for runs in columns.values())))
    for title, unit, of, digits in FIGURES:
        label = f'{title}, {unit}' if unit else title
        rows.append((label, *(mean_and_spread([of(one) for one in runs], digits)
                              for runs in columns.values())))
    yield from table(rows)


def mean_and_spread(values: Sequence[float], digits: int) -> str:
    """Format the mean of several runs and their standard deviation."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return '-'
    mean = number(statistics.fmean(known), digits)
    return mean if len(known) < 2 else f'{mean} +- {number(statistics.stdev(known), digits)}'


def table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Align a table: the first row is the header, the first column has labels."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        cells = [f'{row[0]:<{widths[0]}}']
        cells += [f'{cell:>{width}}' for cell, width in zip(row[1:], widths[1:])]
        yield '  '.join(cells).rstrip()

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


"""Simulate what others have simulated or measured, and compare."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import json
import math
from pathlib import Path
import statistics
import sys
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.features.wsn.cli.compare_report import Difference
from rt_robot_os.features.wsn.cli.compare_report import lines
from rt_robot_os.features.wsn.cli.compare_report import width

if TYPE_CHECKING:
    from rt_robot_os.features.wsn.cli.references import Reference
    from rt_robot_os.features.wsn.cli.references import Skipped
    from rt_robot_os.features.wsn.simulator.results import Results

_EPILOG: Final = """
FOLDER holds tossim_reference.json with tossim_NAME.topo.txt and noise_NAME.txt.gz,
mspsim_summary.json with mspsim_NAME.links.txt and mspsim_NAME_PROTOCOL.air.csv.gz, or logs of what
nodes under MultiHopLQI decided, NAME_decisions.csv.gz; or several of these.
The exit code is 1 when something differs by more than it may: delivery by 0.03 (0.06 under heavy
noise) from the mean, or from the one run of firmware by two standard deviations of our seeds;
frames for each packet that came by 15 %; against firmware, when a node in most of our runs never
had the parent that it had there at the end, or never said a cost that it said there; of a log,
when the rules do not give what a row says. A reference of which a file is missing or damaged is
named and left out; it is 2 when nothing is left.
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser of the program."""
    parser = commands.add_parser(
        'compare', allow_abbrev=False, epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        help='simulate what TOSSIM and real firmware gave, and compare')
    parser.add_argument('folder', metavar='FOLDER', type=Path)
    parser.add_argument('--only', metavar='TEXT', default='',
                        help='only those whose name has all these words, such as "chain7 ctp"')
    parser.add_argument('--seeds', metavar='N', type=int, default=0,
                        help='seeds (default: as many as theirs; 6 against firmware)')
    parser.add_argument('--jobs', metavar='N', type=int, default=0,
                        help='processes at once (default: one a processor)')
    parser.add_argument('--json', action='store_true', help='write the result as JSON')
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """
    Run the command.

    :return: the exit code.
    :raises ConfigError: nothing can be compared.
    """
    from rt_robot_os.features.wsn.cli.references import Skipped
    references, logs, skipped = _chosen(arguments)
    compared = {one.name: differences(one, runs) for one, runs in simulated(
        references, arguments.seeds, arguments.jobs)}
    for path in logs:
        try:
            compared[path.name] = [_decisions(path)]
        except ConfigError as error:
            skipped.append(Skipped(path.name, '; '.join(error.problems)))
    if not compared:
        raise ConfigError([f'{arguments.folder}: nothing can be compared',
                           *(f'{one.name}: {one.why}' for one in skipped)])
    if arguments.json:
        for one in skipped:
            warn('wsn', f'skipped: {one.name}: {one.why}')
        print(json.dumps({name: [vars(each) for each in found]
                          for name, found in compared.items()}, indent=1))
    else:
        print('\n'.join(lines(compared, skipped, width())))
    return OK if all(each.ok for found in compared.values() for each in found) else FAILED


def _chosen(arguments: argparse.Namespace
            ) -> tuple[list[Reference], list[Path], list[Skipped]]:
    """
    Find what is to be compared.

    :return: references, logs of decisions, and what cannot be read.
    :raises ConfigError: there is nothing, or nothing with the words of ``--only``.
    """
    from rt_robot_os.features.wsn.cli.decisions import PATTERN
    from rt_robot_os.features.wsn.cli.references import FIRMWARE_FILE
    from rt_robot_os.features.wsn.cli.references import read_references
    from rt_robot_os.features.wsn.cli.references import TOSSIM_FILE
    folder, words = arguments.folder, arguments.only.split()
    logs = sorted(folder.glob(PATTERN))
    references, skipped = read_references(folder, arguments.seeds or 6)
    names = [one.name for one in (*references, *logs, *skipped)]
    if not names:
        raise ConfigError([
            f'{folder}: has neither a reference in {TOSSIM_FILE} or {FIRMWARE_FILE} nor a log '
            f'{PATTERN}' if folder.is_dir() else f'{folder}: is no folder'])

    def wanted(name: str) -> bool:
        return all(word in name for word in words)

    if not any(map(wanted, names)):
        raise ConfigError([f'--only {arguments.only!r}: no reference of {folder} has all these '
                           'words in its name; there are:', *(f'  {name}' for name in names)])
    return ([one for one in references if wanted(one.name)],
            [path for path in logs if wanted(path.name)],
            [one for one in skipped if wanted(one.name)])


def simulated(references: Sequence[Reference], seeds: int = 0, jobs: int = 0
              ) -> Iterator[tuple[Reference, Sequence[Results]]]:
    """
    Run what the references have.

    :param seeds: of each so many at most; 0: all.
    :param jobs: see :func:`rt_robot_os.features.wsn.cli.runs.run_each`.
    """
    from rt_robot_os.features.wsn.cli.runs import run_each
    scenarios = [(one.name, scenario) for one in references
                 for scenario in (one.scenarios[:seeds] if seeds else one.scenarios)]

    def told(done: int, whole: int) -> None:
        if sys.stderr.isatty():
            print(f'\r{done} of {whole} runs ', end='\n' if done == whole else '',
                  file=sys.stderr, flush=True)

    found = run_each([scenario for _, scenario in scenarios], jobs, told)
    for one in references:
        yield one, [result for (name, _), result in zip(scenarios, found) if name == one.name]


def differences(one: Reference, runs: Sequence[Results]) -> list[Difference]:
    """Compare a reference with our runs of it."""
    deliveries = [run.delivery for run in runs]
    ours, within, said = statistics.fmean(deliveries), one.delivery_within, ''
    if one.single and len(runs) > 2:
        # Theirs is one draw; where links are poor, draws differ.
        within = max(within, 2.0 * statistics.stdev(deliveries))
        said = ' (2 sigma of ours)' if within > one.delivery_within else ''
    found = [Difference('delivery', f'{ours:.4f}', f'{one.delivery:.4f}',
                        abs(ours - one.delivery) <= within, f'{within:.2f}{said}')]
    if one.frames_per_delivery is not None:
        frames = statistics.fmean(run.per_delivery(
            run.transmissions if one.beacons_count else run.data_transmissions) for run in runs)
        off = frames / one.frames_per_delivery - 1.0
        found.append(Difference('frames per packet', f'{frames:.2f}',
                                f'{one.frames_per_delivery:.2f}',
                                math.isfinite(off) and abs(off) <= one.frames_within,
                                f'{100 * one.frames_within:.0f} %, is {100 * off:+.0f} %'))
    if one.parents:
        found.append(_parents(one.parents, runs))
    if one.beacon_costs:
        found.append(_costs(one.beacon_costs, runs))
    return found


def _decisions(path: Path) -> Difference:
    """Explain a log of decisions by our rules: each row must be."""
    from rt_robot_os.features.wsn.cli.decisions import explained
    found = explained(path)
    if not found.rows:
        raise ConfigError([f'{path}: no row of it can be compared'])
    allowed = 'nothing'
    if found.unknown:
        allowed += (f'; the log begins in mid-run: compared from row {found.first} on, without '
                    f'{found.unknown} rows of nodes whose state was not known yet')
    return Difference('decisions', str(found.explained), str(found.rows),
                      found.explained == found.rows, allowed)


def _parents(theirs: Mapping[int, int], runs: Sequence[Results]) -> Difference:
    """
    Compare the tree at the end.

    Where links are poor it changes all the time, and theirs is one of those that occur: it agrees
    when each node had that parent in most of our runs.
    """
    same = sum({node: run.parents.get(node) for node in theirs} == theirs for run in runs)
    had = sum(all(parent in run.parents_had[node] for node, parent in theirs.items())
              for run in runs)
    ours = next((run.parents for run in runs if run.parents != theirs), runs[0].parents)
    return Difference('parents', _pairs({node: ours.get(node) for node in theirs}),
                      _pairs(theirs), 2 * had > len(runs),
                      f'at the end in {same}, at some time in {had} of {len(runs)}')


def _costs(theirs: Mapping[int, frozenset[int]], runs: Sequence[Results]) -> Difference:
    """Compare all costs that beacons said: each of theirs must be one of ours, to the number."""
    ours = {node: frozenset().union(*(run.costs_said.get(node, frozenset()) for run in runs))
            for node in theirs}
    return Difference('beacon costs', _sets(ours), _sets(theirs),
                      all(said <= ours[node] for node, said in theirs.items()), 'nothing')


def _sets(values: Mapping[int, frozenset[int]]) -> str:
    return ' '.join(f'{node}:{"/".join(map(str, sorted(said)))}'
                    for node, said in sorted(values.items()))


def _pairs(values: Mapping[int, int | None]) -> str:
    return ' '.join(f'{node}:{"-" if value is None else value}'
                    for node, value in sorted(values.items()))

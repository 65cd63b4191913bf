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


"""The command `wsn compare`: simulate networks of published runs, and compare the results."""

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
FOLDER contains tossim_reference.json with tossim_NAME.topo.txt and noise_NAME.txt.gz,
mspsim_summary.json with mspsim_NAME.links.txt and mspsim_NAME_PROTOCOL.air.csv.gz, or logs of
decisions of nodes with MultiHopLQI, NAME_decisions.csv.gz; or several of these.
The exit code is 1 when a figure differs by more than its limit: delivery by 0.03 (0.06 with heavy
noise) from the mean, or from the single firmware run by two standard deviations of our seeds;
frames for each delivered packet by 15 %; against firmware, when in most of our runs a node never
had its final parent there, or never advertised a cost that it advertised there; for a log, when
the rules do not explain the decision of a row. A reference with a missing or damaged file is
reported and skipped; the exit code is 2 when none is left.
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser of the program."""
    parser = commands.add_parser(
        'compare', allow_abbrev=False, epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        help='simulate networks of TOSSIM and of real firmware, and compare')
    parser.add_argument('folder', metavar='FOLDER', type=Path)
    parser.add_argument('--only', metavar='TEXT', default='',
                        help='only references with all these words in the name: "chain7 ctp"')
    parser.add_argument('--seeds', metavar='N', type=int, default=0,
                        help='seeds (default: as many as in the reference; 6 against firmware)')
    parser.add_argument('--jobs', metavar='N', type=int, default=0,
                        help='parallel processes (default: one for each processor)')
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
        raise ConfigError([f'{arguments.folder}: no reference can be compared',
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
    Find the references.

    :return: references, logs of decisions, and those that cannot be read.
    :raises ConfigError: there are none, or none with the words of ``--only``.
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
            f'{PATTERN}' if folder.is_dir() else f'{folder}: is not a folder'])

    def wanted(name: str) -> bool:
        return all(word in name for word in words)

    if not any(map(wanted, names)):
        raise ConfigError([f'--only {arguments.only!r}: no reference of {folder} has all these '
                           'words in its name, only:', *(f'  {name}' for name in names)])
    return ([one for one in references if wanted(one.name)],
            [path for path in logs if wanted(path.name)],
            [one for one in skipped if wanted(one.name)])


def simulated(references: Sequence[Reference], seeds: int = 0, jobs: int = 0
              ) -> Iterator[tuple[Reference, Sequence[Results]]]:
    """
    Simulate the references.

    :param seeds: largest number for each; 0: all.
    :param jobs: see :func:`rt_robot_os.features.wsn.cli.runs.run_each`.
    """
    from rt_robot_os.features.wsn.cli.runs import run_each
    scenarios = [(one.name, scenario) for one in references
                 for scenario in (one.scenarios[:seeds] if seeds else one.scenarios)]

    def progress(done: int, whole: int) -> None:
        if sys.stderr.isatty():
            print(f'\r{done} of {whole} runs ', end='\n' if done == whole else '',
                  file=sys.stderr, flush=True)

    found = run_each([scenario for _, scenario in scenarios], jobs, progress)
    for one in references:
        yield one, [result for (name, _), result in zip(scenarios, found) if name == one.name]


def differences(one: Reference, runs: Sequence[Results]) -> list[Difference]:
    """Compare a reference with our runs of its network."""
    deliveries = [run.delivery for run in runs]
    ours, within, note = statistics.fmean(deliveries), one.delivery_within, ''
    if one.single and len(runs) > 2:
        # The reference is a single run; with poor links, runs differ.
        within = max(within, 2.0 * statistics.stdev(deliveries))
        note = ' (2 sigma of our runs)' if within > one.delivery_within else ''
    found = [Difference('delivery', f'{ours:.4f}', f'{one.delivery:.4f}',
                        abs(ours - one.delivery) <= within, f'{within:.2f}{note}')]
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
    """Replay a log of decisions with our rules, which must explain each row."""
    from rt_robot_os.features.wsn.cli.decisions import replay_log
    found = replay_log(path)
    if not found.rows:
        raise ConfigError([f'{path}: no row can be compared'])
    allowed = 'nothing'
    if found.unknown:
        allowed += (f'; the log starts in mid-run: compared from row {found.first} on, without '
                    f'{found.unknown} rows of nodes whose state was unknown')
    return Difference('decisions', str(found.explained), str(found.rows),
                      found.explained == found.rows, allowed)


def _parents(theirs: Mapping[int, int], runs: Sequence[Results]) -> Difference:
    """
    Compare the final tree.

    With poor links the tree changes all the time. It agrees when in most of our runs each node had
    its parent of the reference at some time.
    """
    same = sum({node: run.parents.get(node) for node in theirs} == theirs for run in runs)
    had = sum(all(parent in run.parents_had[node] for node, parent in theirs.items())
              for run in runs)
    ours = next((run.parents for run in runs if run.parents != theirs), runs[0].parents)
    return Difference('parents', _pairs({node: ours.get(node) for node in theirs}),
                      _pairs(theirs), 2 * had > len(runs),
                      f'at the end in {same}, at some time in {had} of {len(runs)}')


def _costs(theirs: Mapping[int, frozenset[int]], runs: Sequence[Results]) -> Difference:
    """Compare the advertised costs: each cost of the reference must occur in our runs, too."""
    ours = {node: frozenset().union(*(run.costs_said.get(node, frozenset()) for run in runs))
            for node in theirs}
    return Difference('beacon costs', _sets(ours), _sets(theirs),
                      all(note <= ours[node] for node, note in theirs.items()), 'nothing')


def _sets(values: Mapping[int, frozenset[int]]) -> str:
    return ' '.join(f'{node}:{"/".join(map(str, sorted(note)))}'
                    for node, note in sorted(values.items()))


def _pairs(values: Mapping[int, int | None]) -> str:
    return ' '.join(f'{node}:{"-" if value is None else value}'
                    for node, value in sorted(values.items()))

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


"""The command `wsn simulate`: simulate the sensor network of a scenario."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import contextmanager
import json
import math
from pathlib import Path
import statistics
import sys
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import INTERRUPTED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.base.units import NS_PER_S

_EPILOG: Final = """
A scenario is a YAML file, or the name of a shipped one, such as home12, home12_moving,
house30, block, city, city10000, ctp_collapse, figure6; docs/network_simulator.md lists all keys.

  wsn simulate home12
  wsn simulate my.yaml --set protocol=ctp --set traffic.period_ms=5000 --json
  wsn simulate house30 --picture tree.png --csv out --pcap air.pcap
  wsn simulate block --seeds 10 --sink both --sizes 30,100,200

Ctrl-C stops the simulation and prints the results so far. The exit code is 2 for an invalid
scenario, 130 after Ctrl-C.
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser of the program."""
    parser = commands.add_parser(
        'simulate', allow_abbrev=False, epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        help='simulate a network of 10 to 10,000 nodes')
    parser.add_argument('scenario', metavar='SCENARIO', help='a YAML file, or a shipped one')
    parser.add_argument('--set', metavar='KEY=VALUE', action='append', default=[], dest='assigned',
                        help='set a key of the scenario, such as protocol=ctp; may be repeated')
    parser.add_argument('--seed', metavar='N', type=_whole(0), help='same as --set seed=N')
    parser.add_argument('--seconds', metavar='S', type=float, help='same as --set seconds=S')
    parser.add_argument('--json', action='store_true', help='write the result as JSON')
    parser.add_argument('--csv', metavar='FOLDER', type=Path,
                        help='write tables of nodes, links, packets and of the tree over time')
    parser.add_argument('--pcap', metavar='FILE', type=Path,
                        help='write all frames on the air, for Wireshark')
    parser.add_argument('--no-fcs', action='store_true',
                        help='without their frame check sequences (link type 230, not 195)')
    parser.add_argument('--picture', metavar='FILE', type=Path,
                        help='draw the tree, as .png, .svg or .pdf')
    parser.add_argument('--host', action='store_true',
                        help="also run the robot's model of the network, and compare its counts")
    parser.add_argument('--quiet', action='store_true', help='do not print the progress')
    several = parser.add_argument_group('comparison of several runs')
    several.add_argument('--seeds', metavar='N', type=_whole(1), default=1,
                         help='run each with N seeds: mean and standard deviation')
    several.add_argument('--sink', choices=('fixed', 'moving', 'both'),
                         help='a fixed sink, a moving one, or both')
    several.add_argument('--sizes', metavar='N,N', type=_wholes,
                         help='other numbers of random nodes, with the density of the scenario')
    several.add_argument('--protocols', metavar='NAME,NAME', type=_names,
                         help='other protocols: multihoplqi, paper, ctp')
    several.add_argument('--jobs', metavar='N', type=_whole(1), default=0,
                         help='parallel processes (default: one for each processor)')
    parser.set_defaults(run=run)


def _whole(least: int) -> Any:
    def convert(text: str) -> int:
        if not (text.isascii() and text.isdigit() and least <= int(text[:18])):
            raise argparse.ArgumentTypeError(
                f'{text!r}: must be an integer of at least {least}')
        return int(text)
    return convert


def _wholes(text: str) -> list[int]:
    return [_whole(2)(word.strip()) for word in text.split(',')]


def _names(text: str) -> list[str]:
    from rt_robot_os.features.wsn.simulator.scenario import PROTOCOLS
    names = [word.strip() for word in text.split(',')]
    for name in names:
        if name not in PROTOCOLS:
            raise argparse.ArgumentTypeError(
                f'{name!r}: there are {", ".join(PROTOCOLS)}')
    return names


def run(arguments: argparse.Namespace) -> int:
    """
    Run the command.

    :return: the exit code.
    :raises ConfigError: the scenario is invalid; nothing was run.
    """
    from rt_robot_os.features.wsn.cli.scenario_file import find_scenario
    from rt_robot_os.features.wsn.cli.scenario_file import load_scenario
    assigned = list(arguments.assigned)
    for key in ('seed', 'seconds'):
        if getattr(arguments, key) is not None:
            assigned.append(f'{key}={getattr(arguments, key)}')
    scenario, topology = load_scenario(find_scenario(arguments.scenario), assignments=assigned)
    if arguments.seeds > 1 or arguments.sink or arguments.sizes or arguments.protocols:
        return _run_several(arguments, scenario)
    return _run_once(arguments, scenario, topology)


# ---- one run --------------------------------------------------------------------------------


def _run_once(arguments: argparse.Namespace, scenario: Any, topology: Any) -> int:
    from rt_robot_os.features.wsn.cli import figure as picture
    from rt_robot_os.features.wsn.cli.simulation_files import write_tables
    from rt_robot_os.features.wsn.cli.text_report import one_run
    if arguments.picture is not None:
        picture.check()
    _check_places(arguments)
    if topology.changes and topology.changes[0].at_ns > scenario.seconds * NS_PER_S:
        first_s = topology.changes[0].at_ns / NS_PER_S
        warn('wsn', f'{scenario.topology.links}: its first @ line is at {first_s:g} s, after the '
             f'end; if its times are not in {scenario.topology.time_unit}, set topology.time_unit')
    code = OK
    with _simulation(arguments, scenario, topology) as simulation:
        progress = _Progress(scenario.seconds, arguments.quiet)
        try:
            simulation.run(progress.show, watch_tree=arguments.csv is not None)
        except KeyboardInterrupt:
            code = INTERRUPTED
        progress.clear()
    results = simulation.results()
    if arguments.json:
        print(json.dumps(results.as_json(), indent=1))
    else:
        print('\n'.join(one_run(results)))
    try:
        if arguments.csv is not None:
            write_tables(arguments.csv, simulation, results)
        if arguments.picture is not None:
            picture.draw(arguments.picture, simulation, results)
    except OSError as error:
        raise RtRobotError(f'{error.filename}: cannot be written: {error.strerror}') from None
    return code


def _check_places(arguments: argparse.Namespace) -> None:
    """Check before a long simulation that its files can be written."""
    problems = []
    for option in ('pcap', 'picture', 'csv'):
        path = getattr(arguments, option)
        if path is not None and not path.absolute().parent.is_dir():
            problems.append(f'--{option} {path}: there is no folder {path.absolute().parent}')
    if arguments.picture is not None and arguments.picture.suffix not in ('.png', '.svg', '.pdf'):
        problems.append(f'--picture {arguments.picture}: must end with .png, .svg or .pdf')
    if problems:
        raise ConfigError(problems)


@contextmanager
def _simulation(arguments: argparse.Namespace, scenario: Any, topology: Any) -> Iterator[Any]:
    from rt_robot_os.features.wsn.radio.mac import MAC_PROFILES
    from rt_robot_os.features.wsn.simulator.air_log import AirLog
    from rt_robot_os.features.wsn.simulator.simulation import Simulation
    if arguments.pcap is None:
        yield Simulation(scenario, topology, with_host=arguments.host)
        return
    try:
        with arguments.pcap.open('wb') as file:
            log = AirLog(file, MAC_PROFILES[scenario.radio.mac], not arguments.no_fcs)
            yield Simulation(scenario, topology, log, arguments.host)
            log.flush()
    except OSError as error:
        raise RtRobotError(f'{arguments.pcap}: cannot be written: {error.strerror}') from None


class _Progress:
    """A progress line on the terminal."""

    def __init__(self, whole: float, quiet: bool, unit: str = 's simulated') -> None:
        self._whole = whole
        self._unit = unit
        self._shown = sys.stderr.isatty() and not quiet

    def show(self, done: float) -> None:
        if self._shown:
            part = 100.0 * done / self._whole
            text = f'\r{done:,.0f} of {self._whole:,.0f} {self._unit} ({part:.0f} %)'
            print(f'{text:<60}', end='', file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self._shown:
            print(f'\r{"":<60}\r', end='', file=sys.stderr, flush=True)


# ---- several runs ---------------------------------------------------------------------------


def _variants(arguments: argparse.Namespace, scenario: Any) -> list[Any]:
    from rt_robot_os.features.wsn.cli.runs import Variant
    from rt_robot_os.features.wsn.cli.runs import with_nodes
    from rt_robot_os.features.wsn.cli.runs import with_protocol
    from rt_robot_os.features.wsn.cli.runs import with_sink
    sinks = {None: [''], 'both': ['fixed', 'moving']}.get(arguments.sink, [arguments.sink])
    found = []
    for size in arguments.sizes or [0]:
        for protocol in arguments.protocols or [scenario.protocol]:
            for sink in sinks:
                one = with_protocol(scenario, protocol)
                one = with_nodes(one, size) if size else one
                one = with_sink(one, sink) if sink else one
                words = ([str(size)] if size else []) + (
                    [protocol] if arguments.protocols else []) + ([sink] if sink else [])
                found.append(Variant(' '.join(words) or scenario.name, one))
    return found


def _run_several(arguments: argparse.Namespace, scenario: Any) -> int:
    from rt_robot_os.features.wsn.cli.runs import run_all
    from rt_robot_os.features.wsn.cli.text_report import several
    for option in ('csv', 'pcap', 'picture'):
        if getattr(arguments, option) is not None:
            raise ConfigError([f'--{option}: is for a single run: omit --seeds, --sink, --sizes '
                               'and --protocols'])
    variants = _variants(arguments, scenario)
    progress = _Progress(len(variants) * arguments.seeds, arguments.quiet, 'runs')
    found, whole = run_all(variants, arguments.seeds, arguments.jobs,
                           lambda done, _: progress.show(done))
    progress.clear()
    if arguments.json:
        print(json.dumps({'columns': _summary(found), 'runs': {
            label: [one.as_json() for one in runs] for label, runs in found.items()}}, indent=1))
    else:
        print(f'{scenario.name}: {scenario.protocol}, {scenario.seconds:g} s each\n')
        print('\n'.join(several(found)))
    return OK if whole else INTERRUPTED


def _summary(found: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    from rt_robot_os.features.wsn.cli.text_report import FIGURES
    summary: dict[str, Any] = {}
    for label, runs in found.items():
        summary[label] = {}
        for title, unit, of, _ in FIGURES:
            values = [value for value in map(of, runs) if math.isfinite(value)]
            summary[label][title] = {
                'unit': unit, 'mean': statistics.fmean(values) if values else None,
                'stdev': statistics.stdev(values) if len(values) > 1 else None}
    return summary

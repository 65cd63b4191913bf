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

"""Command ``rehearse emergencies``: many random scenarios, each checked."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from collections.abc import Mapping
from functools import cache
from functools import partial
import json
import time
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.agent.edges import EDGES
from rt_robot_os.settings import from_json
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
from rt_robot_os.sim.scenarios.runner import run_scenarios
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.checks import check
from rt_robot_os.tools.rehearse.checks import CheckResult
from rt_robot_os.tools.rehearse.coverage import edges_taken
from rt_robot_os.tools.rehearse.coverage import name_of
from rt_robot_os.tools.rehearse.detectable import detectable_emergencies
from rt_robot_os.tools.rehearse.detectable import nodes_of
from rt_robot_os.tools.rehearse.options import add_settings
from rt_robot_os.tools.rehearse.options import settings_of
from rt_robot_os.tools.rehearse.scenario import CareScenario
from rt_robot_os.tools.rehearse.scenario import random_scenario
from rt_robot_os.tools.rehearse.scenario_run import RunRecord
from rt_robot_os.tools.rehearse.scenario_run import ScenarioRun

_PROBLEMS_SHOWN: Final = 20


def add_to(commands: Any) -> None:
    """Add the parser of the command."""
    parser = commands.add_parser(
        'emergencies', help='random emergencies and faults',
        description='Run random scenarios (falls, calls for help, illness, smoke; dead nodes, '
        'blocked paths, a killed core, a full disk ...) with the real modules of a robot in '
        'virtual time, and check whether each emergency was detected and each alarm came to an '
        'end: resolved, cancelled, escalated to the last step, or given up with a reason.')
    add_settings(parser)
    parser.add_argument('--stories', type=int, default=1000, metavar='N',
                        help='number of scenarios (%(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='seed of the first (%(default)s)')
    parser.add_argument('--tell', action='store_true',
                        help='run only the scenario of --seed, and print all its events')
    parser.add_argument('--jobs', type=int, default=1, metavar='N',
                        help='parallel processes (%(default)s)')
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """
    Run and check the scenarios.

    :raises ConfigError: the settings cannot be used.
    """
    settings = settings_of(arguments)
    scenario = _scenario(settings, arguments.seed)  # before any process starts
    if arguments.tell:
        return _show(settings, scenario)
    begin_s = time.monotonic()
    numbers = range(arguments.seed, arguments.seed + max(arguments.stories, 1))
    checked = partial(_run_checked, to_json(settings))
    found = _summary(list(run_scenarios(checked, numbers, arguments.jobs)), begin_s)
    if arguments.json:
        print(json.dumps(found, indent=1))
    else:
        _print(found)
    return FAILED if found['problems'] else OK


def _scenario(settings: RobotSettings, seed: int) -> CareScenario:
    world = World(settings.world)
    return random_scenario(seed, detectable_emergencies(settings, world), nodes_of(world))


class ScenarioOutcome(NamedTuple):
    """
    A scenario that was run and checked.

    :ivar result: of the checks.
    :ivar lasted_s: duration in virtual time.
    :ivar edges: edges taken of the agent's table, with their counts.
    """

    result: CheckResult
    lasted_s: float = 0.0
    edges: Mapping[str, int] = {}


def _run_checked(settings: str, seed: int) -> ScenarioOutcome:
    """
    Run a scenario and check it.

    :param settings: as JSON, for a separate process.
    """
    robot = _robot(settings)
    scenario = _scenario(robot, seed)
    try:
        record = ScenarioRun(robot, scenario).run()
    except AssertionError as error:
        return ScenarioOutcome(CheckResult(seed, {}, (str(error),), 0, 0, ()))
    edges = Counter(name_of(edge) for edge in edges_taken(record.transitions))
    return ScenarioOutcome(check(scenario, record), record.lasted_s, edges)


@cache
def _robot(settings: str) -> RobotSettings:
    return from_json(settings)


def _summary(outcomes: list[ScenarioOutcome], begin_s: float) -> dict[str, Any]:
    results = [each.result for each in outcomes]
    edges: Counter[str] = Counter()
    for each in outcomes:
        edges.update(each.edges)
    ends = Counter(end for result in results for end in result.ends.values())
    return {
        'stories': len(results),
        'virtual_s': round(sum(each.lasted_s for each in outcomes), 1),
        'wall_s': round(time.monotonic() - begin_s, 1),
        'emergencies': sum(each.noticed + each.hidden for each in results),
        'noticed': sum(each.noticed for each in results),
        'hidden': sum(each.hidden for each in results),
        'alarms': dict(sorted(ends.items())),
        'gave_up': dict(Counter(why for each in results for why in each.gave_up).most_common(12)),
        'edges': {name: edges[name] for name in map(name_of, EDGES)},
        'problems': [{'story': result.seed, 'problem': problem}
                     for result in results for problem in result.problems]}


def _print(found: dict[str, Any]) -> None:
    print(f'{found["stories"]} stories, {found["virtual_s"]:.0f} s in {found["wall_s"]:.0f} s')
    print(f'{found["emergencies"]} emergencies: {found["noticed"]} became alarms, '
          f'{found["hidden"]} could not be detected (the core, the sink or the node was dead)')
    print('alarms:', ', '.join(f'{count} {end}' for end, count in found['alarms'].items()))
    for why, count in found['gave_up'].items():
        print(f'  the robot gave up {count} times: {why}')
    never = [name for name, count in found['edges'].items() if not count]
    print(f'the agent took {len(found["edges"]) - len(never)} of its {len(found["edges"])} edges')
    problems = found['problems']
    for each in problems[:_PROBLEMS_SHOWN]:
        print(f'story {each["story"]}: {each["problem"]}')
    print(f'{len(problems)} problems' + ('; look at one with --seed STORY --tell'
                                         if problems else ''))


def _show(settings: RobotSettings, scenario: CareScenario) -> int:
    """Print all events of one scenario."""
    record = ScenarioRun(settings, scenario).run()
    for at_s, line in sorted(_lines(scenario, record), key=lambda each: each[0]):
        print(f'{at_s:8.2f}  {line}')
    result = check(scenario, record)
    print('\n'.join(result.problems) or 'no problems')
    return FAILED if result.problems else OK


def _lines(scenario: CareScenario, record: RunRecord) -> Iterator[tuple[float, str]]:
    for each in scenario.occurrences:
        lasts = f' for {each.for_s:.0f} s' if each.for_s else ''
        yield each.at_s, f'* {each.what} {each.who}{lasts} {each.answer}'.rstrip()
    for event in record.events:
        why = ' '.join(filter(None, (event.get('by'), event.get('why'))))
        yield event['t_ns'] / NS_PER_S, (
            f'  alarm {event["alarm"]} of {event["subject"]}: {event["event"]} '
            f'({event["state"]}) '
            f'{why}').rstrip()
    for step in record.transitions:
        yield step['t_ns'] / NS_PER_S, (
            f'    agent: {step["from"]} -> {step["to"]}: {step["cause"]}')

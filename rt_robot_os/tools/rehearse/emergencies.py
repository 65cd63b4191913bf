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

"""Command ``rehearse emergencies``: many random stories, each judged."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
import json
from multiprocessing import get_context
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
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.coverage import edges_taken
from rt_robot_os.tools.rehearse.coverage import name_of
from rt_robot_os.tools.rehearse.director import Director
from rt_robot_os.tools.rehearse.director import Record
from rt_robot_os.tools.rehearse.noticed import emergencies_of
from rt_robot_os.tools.rehearse.noticed import nodes_of
from rt_robot_os.tools.rehearse.options import add_settings
from rt_robot_os.tools.rehearse.options import settings_of
from rt_robot_os.tools.rehearse.story import draw
from rt_robot_os.tools.rehearse.story import Story
from rt_robot_os.tools.rehearse.verdict import judge
from rt_robot_os.tools.rehearse.verdict import Verdict

_PROBLEMS_SHOWN: Final = 20
# Of a process of the pool.
_HERE: Final[list[RobotSettings]] = []


def add_to(commands: Any) -> None:
    """Add the parser of the command."""
    parser = commands.add_parser(
        'emergencies', help='random emergencies, with all that goes wrong besides',
        description='Tell random stories (falls, calls for help, illness, smoke; dead nodes, '
        'blocked ways, a killed core, a full disk ...) to the real modules of a robot in virtual '
        'time, and judge whether each emergency was noticed and each alarm came to an end: '
        'resolved, cancelled, told to the last who can be told, or given up with a reason.')
    add_settings(parser)
    parser.add_argument('--stories', type=int, default=1000, metavar='N',
                        help='how many (%(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='number of the first (%(default)s)')
    parser.add_argument('--tell', action='store_true',
                        help='only the story of --seed, with all that happened')
    parser.add_argument('--jobs', type=int, default=1, metavar='N',
                        help='processes at a time (%(default)s)')
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """
    Tell and judge.

    :raises ConfigError: the settings cannot be used.
    """
    settings = settings_of(arguments)
    story = _story_of(settings, arguments.seed)
    if arguments.tell:
        return _tell(settings, story)
    begin_s = time.monotonic()
    numbers = range(arguments.seed, arguments.seed + max(arguments.stories, 1))
    found = _summary(list(_judged(settings, numbers, arguments.jobs)), begin_s)
    if arguments.json:
        print(json.dumps(found, indent=1))
    else:
        _print(found)
    return FAILED if found['problems'] else OK


def _story_of(settings: RobotSettings, number: int) -> Story:
    world = World(settings.world)
    return draw(number, emergencies_of(settings, world), nodes_of(world))


class Told(NamedTuple):
    """
    A story that was told and judged.

    :ivar verdict: on it.
    :ivar lasted_s: of virtual time.
    :ivar edges: of the agent's table that it took, and how often.
    """

    verdict: Verdict
    lasted_s: float = 0.0
    edges: Mapping[str, int] = {}


def judged(settings: RobotSettings, number: int) -> Told:
    """Tell one story and judge it."""
    story = _story_of(settings, number)
    try:
        record = Director(settings, story).tell()
    except AssertionError as error:
        return Told(Verdict(number, {}, (str(error),), 0, 0, ()))
    edges = Counter(name_of(edge) for edge in edges_taken(record.transitions))
    return Told(judge(story, record), record.lasted_s, edges)


def _judged(settings: RobotSettings, numbers: Iterable[int], jobs: int
            ) -> Iterator[Told]:
    if jobs < 2:
        yield from (judged(settings, number) for number in numbers)
        return
    with ProcessPoolExecutor(jobs, get_context('spawn'), _prepare, (to_json(settings),)) as pool:
        yield from pool.map(_judged_here, numbers, chunksize=4)


def _prepare(settings: str) -> None:
    """Give a process of the pool its robot."""
    _HERE.append(from_json(settings))


def _judged_here(number: int) -> Told:
    return judged(_HERE[-1], number)


def _summary(told: list[Told], begin_s: float) -> dict[str, Any]:
    verdicts = [each.verdict for each in told]
    edges: Counter[str] = Counter()
    for each in told:
        edges.update(each.edges)
    ends = Counter(end for verdict in verdicts for end in verdict.ends.values())
    return {
        'stories': len(verdicts),
        'virtual_s': round(sum(each.lasted_s for each in told), 1),
        'wall_s': round(time.monotonic() - begin_s, 1),
        'emergencies': sum(each.noticed + each.hidden for each in verdicts),
        'noticed': sum(each.noticed for each in verdicts),
        'hidden': sum(each.hidden for each in verdicts),
        'alarms': dict(sorted(ends.items())),
        'gave_up': dict(Counter(why for each in verdicts for why in each.gave_up).most_common(12)),
        'edges': {name: edges[name] for name in map(name_of, EDGES)},
        'problems': [{'story': verdict.number, 'problem': problem}
                     for verdict in verdicts for problem in verdict.problems]}


def _print(found: dict[str, Any]) -> None:
    print(f'{found["stories"]} stories, {found["virtual_s"]:.0f} s in {found["wall_s"]:.0f} s')
    print(f'{found["emergencies"]} emergencies: {found["noticed"]} became alarms, '
          f'{found["hidden"]} could not be noticed (the core, the sink or the node was dead)')
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


# ---- one story at length -----------------------------------------------------------------------

def _tell(settings: RobotSettings, story: Story) -> int:
    record = Director(settings, story).tell()
    for at_s, line in sorted(_lines(story, record), key=lambda each: each[0]):
        print(f'{at_s:8.2f}  {line}')
    verdict = judge(story, record)
    print('\n'.join(verdict.problems) or 'no problems')
    return FAILED if verdict.problems else OK


def _lines(story: Story, record: Record) -> Iterator[tuple[float, str]]:
    for scene in story.scenes:
        lasts = f' for {scene.for_s:.0f} s' if scene.for_s else ''
        yield scene.at_s, f'* {scene.what} {scene.who}{lasts} {scene.answer}'.rstrip()
    for each in record.events:
        why = ' '.join(filter(None, (each.get('by'), each.get('why'))))
        yield each['t_ns'] / NS_PER_S, (
            f'  alarm {each["alarm"]} of {each["subject"]}: {each["event"]} ({each["state"]}) '
            f'{why}').rstrip()
    for each in record.transitions:
        yield each['t_ns'] / NS_PER_S, (
            f'    agent: {each["from"]} -> {each["to"]}: {each["cause"]}')

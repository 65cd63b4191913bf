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

"""What is judged of a story: did each emergency become an alarm, and did each alarm end well."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.alarm_state import CLOSED_STATES
from rt_robot_os.tools.rehearse.director import is_settled
from rt_robot_os.tools.rehearse.director import Record
from rt_robot_os.tools.rehearse.story import EMERGENCIES
from rt_robot_os.tools.rehearse.story import Scene
from rt_robot_os.tools.rehearse.story import Story

# An emergency has become an alarm by then.
_NOTICED_S: Final = {'fall': 15.0, 'help': 10.0, 'sick': 240.0, 'smoke': 30.0, 'call': 5.0}
# What hides an emergency: nobody can hear what is not sent. A fall is felt by a device, the others
# are told by nodes, through the sink.
_HIDING: Final = {'fall': ('core_killed',), 'call': ('core_killed',)}
_HIDING_NODES: Final = ('core_killed', 'node_dies', 'node_reboots', 'sink_silent')
_AROUND_S: Final = 15.0
# An alarm of just before is of the same emergency.
_SAME_S: Final = 10.0
_SHOWN: Final = 3


class Verdict(NamedTuple):
    """
    How a story ended.

    :ivar number: of the story.
    :ivar ends: how each alarm ended, by its number: resolved, cancelled, escalated, technical.
    :ivar problems: what went wrong; empty when nothing did.
    :ivar noticed: emergencies that became alarms.
    :ivar hidden: emergencies that nobody could notice, for something was dead then.
    :ivar gave_up: why the agent gave up, each time.
    """

    number: int
    ends: dict[str, str]
    problems: tuple[str, ...]
    noticed: int
    hidden: int
    gave_up: tuple[str, ...]


def judge(story: Story, record: Record) -> Verdict:
    """Judge what became of a story."""
    alarms = record.alarms()
    ends = {number: _end(events) for number, events in alarms.items()}
    problems = [f'alarm {number} of {alarms[number][-1]["subject"]} hangs: '
                f'{alarms[number][-1]["state"]}' for number, end in ends.items() if end == 'hangs']
    problems += [f'{key} was shown {count} times' for key, count in record.shown.items()
                 if count > 1]
    noticed = hidden = 0
    for scene in story.scenes:
        if scene.what not in EMERGENCIES or scene in record.no_falls:
            continue
        if _is_noticed(scene, record.events):
            noticed += 1
        elif _is_hidden(scene, story):
            hidden += 1
        else:
            problems.append(f'{scene.what} of {scene.who} at {scene.at_s:.1f} s became no alarm')
    problems += _of_agent(record)
    return Verdict(story.number, ends, tuple(problems), noticed, hidden, tuple(
        str(each['cause']) for each in record.transitions if each['to'] == 'give_up'))


def _of_agent(record: Record) -> Iterator[str]:
    """Yield what the agent did that it should not, and what it left undone."""
    ends = ('idle', 'stay', 'return', *(('held', 'operator') if record.taken else ()))
    if record.agent_state not in ends:
        yield f'the agent ended in {record.agent_state}'
    yield from (f'the agent ordered {each}' for each in record.disobeyed[:_SHOWN])
    if not record.taken:
        yield from (f'the agent forgot alarm {each}' for each in record.forgotten())
    for each in record.transitions:
        if each['to'] == 'give_up' and not str(each['cause']).partition(': ')[2]:
            yield f'the agent gave up without a reason: {each["cause"]}'


def _end(events: list[dict[str, Any]]) -> str:
    last = events[-1]
    if last['state'] in CLOSED_STATES:
        return str(last['state'])
    if last['level'] == 'technical':
        return 'technical'
    return 'escalated' if is_settled(events) else 'hangs'


def _is_noticed(scene: Scene, events: Iterable[dict[str, Any]]) -> bool:
    """Return whether there was an alarm of that subject then, or soon after."""
    latest_ns = (scene.at_s + _NOTICED_S[scene.what]) * NS_PER_S
    told = [each for each in events if each['subject'] == scene.who
            and each['level'] != 'technical' and each['t_ns'] <= latest_ns]
    # Who falls while they lie, or presses twice, is told of already.
    return any(each['state'] not in CLOSED_STATES
               and each['t_ns'] >= (scene.at_s - _SAME_S) * NS_PER_S for each in told) or (
        bool(told) and told[-1]['state'] not in CLOSED_STATES)


def _is_hidden(scene: Scene, story: Story) -> bool:
    """Return whether something was dead when it happened, or right then."""
    until_s = scene.at_s + _NOTICED_S[scene.what] + _AROUND_S
    hiding = _HIDING.get(scene.what, _HIDING_NODES)
    return any(each.what in hiding and each.at_s <= until_s
               and (not each.for_s or each.at_s + each.for_s >= scene.at_s - _AROUND_S)
               for each in story.scenes)

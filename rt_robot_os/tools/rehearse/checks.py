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

"""The checks of a run: did each emergency become an alarm, and did each alarm come to an end."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.alarm_state import CLOSED_STATES
from rt_robot_os.tools.rehearse.scenario import CareScenario
from rt_robot_os.tools.rehearse.scenario import EMERGENCIES
from rt_robot_os.tools.rehearse.scenario import Occurrence
from rt_robot_os.tools.rehearse.scenario_run import is_settled
from rt_robot_os.tools.rehearse.scenario_run import RunRecord

# Time within which an emergency must become an alarm.
_NOTICED_S: Final = {'fall': 15.0, 'help': 10.0, 'sick': 240.0, 'smoke': 30.0, 'call': 5.0}
# Faults that hide an emergency. Falls are detected by a device, other emergencies by nodes, over
# the sink.
_HIDING: Final = {'fall': ('core_killed',), 'call': ('core_killed',)}
_HIDING_NODES: Final = ('core_killed', 'node_dies', 'node_reboots', 'sink_silent')
_AROUND_S: Final = 15.0
# An alarm up to this time before belongs to the same emergency.
_SAME_S: Final = 10.0
_SHOWN: Final = 3


class CheckResult(NamedTuple):
    """
    The result of the checks.

    :ivar seed: of the scenario.
    :ivar ends: end of each alarm by its number: resolved, cancelled, escalated, technical.
    :ivar problems: failed checks.
    :ivar noticed: emergencies that became alarms.
    :ivar hidden: emergencies that could not be detected, because of a fault.
    :ivar gave_up: the reason of each time the agent gave up.
    """

    seed: int
    ends: dict[str, str]
    problems: tuple[str, ...]
    noticed: int
    hidden: int
    gave_up: tuple[str, ...]


def check(scenario: CareScenario, record: RunRecord) -> CheckResult:
    """Check a run of a scenario."""
    alarms = record.alarms()
    ends = {number: _end(events) for number, events in alarms.items()}
    problems = [f'alarm {number} of {alarms[number][-1]["subject"]} hangs: '
                f'{alarms[number][-1]["state"]}' for number, end in ends.items() if end == 'hangs']
    problems += [f'{key} was shown {count} times' for key, count in record.shown.items()
                 if count > 1]
    noticed = hidden = 0
    for each in scenario.occurrences:
        if each.what not in EMERGENCIES or each in record.no_falls:
            continue
        if _is_noticed(each, record.events):
            noticed += 1
        elif _is_hidden(each, scenario):
            hidden += 1
        else:
            problems.append(
                f'{each.what} of {each.who} at {each.at_s:.1f} s did not become an alarm')
    problems += _of_agent(record)
    return CheckResult(scenario.seed, ends, tuple(problems), noticed, hidden, tuple(
        str(each['cause']) for each in record.transitions if each['to'] == 'give_up'))


def _of_agent(record: RunRecord) -> Iterator[str]:
    """Yield the forbidden and the missing actions of the agent."""
    ends = ('idle', 'stay', 'return', *(('held', 'operator') if record.overridden else ()))
    if record.agent_state not in ends:
        yield f'the agent ended in {record.agent_state}'
    yield from (f'the agent ordered {each}' for each in record.violations[:_SHOWN])
    if not record.overridden:
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


def _is_noticed(emergency: Occurrence, events: Iterable[dict[str, Any]]) -> bool:
    """Return whether an alarm of that subject was active then or soon after."""
    latest_ns = (emergency.at_s + _NOTICED_S[emergency.what]) * NS_PER_S
    alarmed = [each for each in events if each['subject'] == emergency.who
               and each['level'] != 'technical' and each['t_ns'] <= latest_ns]
    # A second fall or press during an alarm of the same person is part of that alarm.
    return any(each['state'] not in CLOSED_STATES
               and each['t_ns'] >= (emergency.at_s - _SAME_S) * NS_PER_S for each in alarmed) or (
        bool(alarmed) and alarmed[-1]['state'] not in CLOSED_STATES)


def _is_hidden(emergency: Occurrence, scenario: CareScenario) -> bool:
    """Return whether a fault hid it at its time or shortly after."""
    until_s = emergency.at_s + _NOTICED_S[emergency.what] + _AROUND_S
    hiding = _HIDING.get(emergency.what, _HIDING_NODES)
    return any(each.what in hiding and each.at_s <= until_s
               and (not each.for_s or each.at_s + each.for_s >= emergency.at_s - _AROUND_S)
               for each in scenario.occurrences)

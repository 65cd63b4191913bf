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

"""
What a robot may say about whom: the boundary between a robot's token and the data of people.

Records and live signals about a person are taken from the robots with which an administrator has
confirmed that the person lives (:mod:`rt_robot_os.monitor.security.residents`). Records about
others are set aside, and are filed when that is confirmed later.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from collections.abc import Mapping
import logging
from typing import Any
from typing import Final

from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.live.hub import Hub
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.security.residents import Household
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.store.person_name import PersonName
from rt_robot_os.monitor.store.unconfirmed import UNCONFIRMED

_LOG: Final = logging.getLogger('monitor')
#: How soon the server notes what another process has confirmed.
WATCH_S: Final = 1.0
#: A database that does not answer holds up the hello of a robot for at most this time.
GREET_S: Final = 5.0
_ABOUT_A_PERSON: Final = frozenset({'observation', 'news2', 'place'})


async def greet(services: Services, robot: RobotState, suggested: Collection[str]) -> None:
    """
    Take the people that a robot names in its hello: a suggestion.

    A robot whose household is known needs no database; with the database away one that is new is
    confirmed by :func:`watch` later.
    """
    robot.suggested = frozenset(suggested)
    if robot.people is None:
        try:
            found = await asyncio.wait_for(asyncio.to_thread(
                services.accounts.residents.greet, robot.id, robot.suggested), GREET_S)
        except (StoreError, asyncio.TimeoutError) as error:
            _LOG.warning('%s: its residents cannot be read: %s', robot.name, error)
        else:
            robot.lives_with(found.people, found.ever)
    unconfirmed = robot.suggested - (robot.people or frozenset())
    if unconfirmed:
        _LOG.warning('%s: names %d people who are not confirmed as its residents; what it sends '
                     'about them is set aside: monitor robot people %s shows them', robot.name,
                     len(unconfirmed), robot.name)


async def watch(services: Services) -> None:
    """Note each second what was confirmed, by the page or by another process, until cancelled."""
    is_first = True
    while True:
        try:
            found = await asyncio.to_thread(services.accounts.residents.all)
            changed = apply(services.hub, found)
            if changed:
                await asyncio.to_thread(services.store.forget_names)
            if changed or is_first:
                await asyncio.to_thread(services.store.file_confirmed)
                is_first = False
        except StoreError as error:
            _LOG.warning('residents of robots cannot be read: %s', error)
        await asyncio.sleep(WATCH_S)


def apply(hub: Hub, households: Mapping[str, Household]) -> list[RobotState]:
    """Take over what is confirmed; return the robots whose residents have changed."""
    changed = []
    for robot in hub.robots.values():
        found = households.get(robot.id)
        if found is not None and robot.ever - found.ever:
            # Nothing else takes a person out of the database.
            for person in robot.ever - found.ever:
                forget(hub, PersonName(person))
            changed.append(robot)
        if found is not None and (found.people, found.ever) != (robot.people, robot.ever):
            is_seen = found.people != robot.people
            robot.lives_with(found.people, found.ever)
            if is_seen:
                changed.append(robot)
    if changed:
        hub.residents_changed()
    return changed


def forget(hub: Hub, name: PersonName) -> None:
    """Take a person who was erased out of what is in memory of all robots."""
    for robot in hub.robots.values():
        robot.suggested = frozenset(each for each in robot.suggested if not name.is_of(each))
        robot.ever = frozenset(each for each in robot.ever if not name.is_of(each))
        robot.people = None if robot.people is None else robot.people & robot.ever
        robot.name = name.without(robot.name)
        robot.about = name.within(robot.about)
        robot.lost = name.within(robot.lost)
        robot.alarms = {key: name.within(each) for key, each in robot.alarms.items()
                        if not name.is_of(str(each.get('subject', '')))
                        and not name.is_in(key)}
        robot.drop_signals(lambda signal, value: name.is_in(signal) or name.within(value) != value)


def admitted(hub: Hub, robot: RobotState, record: Any) -> Any:
    """
    Return a record as it may be filed.

    One about a person who is not confirmed is of the type ``unconfirmed``, which the database
    sets aside. An alarm is never held back; it loses a subject that is a resident of other
    robots alone, so that it is filed and shown as an alarm of this robot.
    """
    content = record.get('content') if isinstance(record, dict) else None
    if not isinstance(content, dict):
        return record
    kind = record.get('type')
    if kind in _ABOUT_A_PERSON:
        if content.get('person') in (robot.people or ()):
            return record
        robot.count('records_unconfirmed')
        return {**record, 'type': UNCONFIRMED, 'content': {'type': kind, 'content': content}}
    subject = content.get('subject')
    if kind == 'alarm_event' and isinstance(subject, str) and subject not in (
            robot.people or ()) and hub.lives_elsewhere(subject, robot):
        robot.count('alarms_unconfirmed')
        return {**record, 'content': {**content, 'subject': '', 'claimed_subject': subject}}
    return record

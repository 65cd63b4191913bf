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
The people about whom a robot may send data: the boundary between robots and data of people.

Records and live signals about a person are accepted only from robots of which the person is a
confirmed resident (:mod:`rt_robot_os.monitor.security.residents`). Records about others are stored
aside, and filed when an administrator confirms the person later.
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
#: Period at which the server checks for confirmations by other processes.
WATCH_S: Final = 1.0
#: Longest delay of a robot's hello when the database does not answer.
GREET_S: Final = 5.0
_ABOUT_A_PERSON: Final = frozenset({'observation', 'news2', 'place'})


async def greet(services: Services, robot: RobotState, suggested: Collection[str]) -> None:
    """
    Store the people that a robot names in its hello as a suggestion.

    A robot with a known household needs no database; a new robot is confirmed later by
    :func:`watch` if the database is unavailable.
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
        _LOG.warning('%s: names %d people who are not confirmed as its residents; records '
                     'about them are stored aside: monitor robot people %s shows them', robot.name,
                     len(unconfirmed), robot.name)


async def watch(services: Services) -> None:
    """Read confirmations by the page or by other processes each second, until cancelled."""
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
    """Apply confirmed residents; return the robots whose residents have changed."""
    changed = []
    for robot in hub.robots.values():
        found = households.get(robot.id)
        if found is not None and robot.ever - found.ever:
            # Only an erasure removes a person from the database.
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
    """Remove an erased person from the memory of all robots."""
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
    Return a record in the form in which it may be filed.

    A record about an unconfirmed person gets the type ``unconfirmed``, which the database stores
    aside. An alarm is never held back; its subject is removed if that person is a resident of
    other robots only, so that it is filed and shown as an alarm of this robot.
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

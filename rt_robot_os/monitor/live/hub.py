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
The robots that are connected and the clients that watch them; for the event loop alone.

Alarms and states of robots go to every client that may see them, at once and in order; signals
go by watches (:mod:`rt_robot_os.monitor.live.fan_out`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
import time
from typing import Any
from typing import Final
from typing import Protocol

from rt_robot_os.monitor.live.fan_out import FanOut
from rt_robot_os.monitor.live.rights import Rights
from rt_robot_os.monitor.live.robot_state import encoded
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.stand_in import Actor
from rt_robot_os.monitor.stand_in import Permission

#: Heart-beats that may be missing before a robot is silent.
BEATS: Final = 3


class AwayError(Exception):
    """The robot cannot be asked now: it is not connected, or did not answer in time."""

    def __init__(self, text: str, remedy: str, is_late: bool = False) -> None:
        super().__init__(text)
        self.text = text
        self.remedy = remedy
        self.is_late = is_late


class Connection(Protocol):
    """What the hub needs of a robot's connection."""

    def say(self, kind: str, content: Mapping[str, Any]) -> bool:
        """Send a message; False when there is no room for it."""

    def close(self, code: int, reason: str) -> None:
        """Close it."""


class Client(Protocol):
    """What the hub needs of a browser's connection."""

    rights: Rights

    def say(self, text: str) -> bool:
        """Send something urgent."""

    def robot_came(self, robot: RobotState) -> None:
        """Watch a robot that is new to the hub."""


class Hub:
    """
    All robots and clients.

    :param heartbeat_s: a robot of which nothing is heard for three of these is silent.
    :param command_s: how long a command may wait for its answer.
    """

    def __init__(self, heartbeat_s: float, command_s: float) -> None:
        self.robots: dict[str, RobotState] = {}
        self.clients: dict[Client, None] = {}
        self.fan_out = FanOut()
        self._heartbeat_s = heartbeat_s
        self._command_s = command_s
        self._connections: dict[str, Connection] = {}
        self._answers: dict[str, tuple[str, asyncio.Future[dict[str, Any]]]] = {}
        self._commands = time.time_ns()

    @staticmethod
    def rights_of(actor: Actor) -> Rights:
        """Return what somebody may see."""
        return Rights(actor.people, actor.may(Permission.HEALTH))

    def robot(self, robot: str, name: str = '') -> RobotState:
        """Return a robot; one that is new becomes known to those who watch all."""
        found = self.robots.get(robot)
        if found is None:
            found = self.robots[robot] = RobotState(robot, name or robot)
            for each in list(self.clients):
                each.robot_came(found)
        return found

    def seen(self, actor_rights: Rights) -> list[RobotState]:
        """Return the robots that exist for those with these rights."""
        return [each for each in self.robots.values() if actor_rights.sees_robot(each.people)]

    # Robots

    def connect(self, robot: RobotState, connection: Connection, hello: Mapping[str, Any],
                now_ns: int) -> None:
        """Take a robot that has said hello; a connection that it had before is closed."""
        before = self._connections.get(robot.id)
        if before is not None and before is not connection:
            before.close(4000, 'the same robot has connected again')
        self._connections[robot.id] = connection
        gone_ns = robot.last_seen_ns
        robot.connected = True
        self.heard(robot, now_ns, quietly=True)
        self.tell_robot(robot)
        if gone_ns:
            self._tell(robot, {'kind': 'gap', 'robot': robot.id, 'from_ns': gone_ns,
                               'to_ns': now_ns})
        self.want(robot)

    def disconnect(self, robot: RobotState, connection: Connection) -> None:
        """Forget a connection of a robot; its commands fail at once."""
        if self._connections.get(robot.id) is not connection:
            return
        del self._connections[robot.id]
        robot.connected = False
        for whose, future in self._answers.values():
            if whose == robot.id and not future.done():
                future.set_exception(_away(robot.name))
        self.tell_robot(robot)

    def heard(self, robot: RobotState, now_ns: int, quietly: bool = False) -> None:
        """Note that something has come from a robot."""
        robot.heard = asyncio.get_running_loop().time()
        robot.last_seen_ns = now_ns
        if robot.silent:
            robot.silent = False
            if not quietly:
                self.tell_robot(robot)

    def look(self) -> None:
        """Look which robots are silent; call it about once a heart-beat."""
        now = asyncio.get_running_loop().time()
        for each in self.robots.values():
            if not each.silent and now - each.heard > BEATS * self._heartbeat_s:
                each.silent = True
                each.count('silences')
                self.tell_robot(each)

    def live(self, robot: RobotState) -> None:
        """Send what is new of a robot to whom it concerns."""
        self.fan_out.changed(robot)

    def alarm(self, robot: RobotState, event: Mapping[str, Any], utc_ns: int) -> None:
        """Take an event of an alarm, and tell everybody who may see it."""
        alarm = robot.take_alarm(event, utc_ns)
        if alarm is not None:
            self._tell_each(lambda rights: robot.alarm_shown(alarm, rights), 'alarm')

    def want(self, robot: RobotState) -> None:
        """Tell a robot how often its signals are wanted."""
        rate = self.fan_out.rate_hz(robot.id)
        connection = self._connections.get(robot.id)
        if connection is not None:
            connection.say('want', {'signals_hz': rate})

    # Commands

    async def command(self, robot: RobotState, do: str, args: Mapping[str, Any], by: str
                      ) -> dict[str, Any]:
        """
        Have a robot do something, once.

        :return: its answer: ``ok`` and ``text``.
        :raises AwayError: it is not connected, or did not answer in time.
        """
        connection = self._connections.get(robot.id)
        self._commands += 1
        number = f'{self._commands:x}'
        future: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        if connection is None:
            raise _away(robot.name)
        self._answers[number] = (robot.id, future)
        try:
            if not connection.say('command', {'id': number, 'do': do, 'args': args, 'by': by}):
                raise _away(robot.name)
            return await asyncio.wait_for(future, self._command_s)
        except asyncio.TimeoutError:
            raise AwayError(f'{robot.name} has not answered for {self._command_s:g} s; whether it '
                            'has done it is not known', 'look at its state before you try again',
                            is_late=True) from None
        finally:
            self._answers.pop(number, None)

    def answered(self, robot: RobotState, answer: Mapping[str, Any]) -> None:
        """Take the answer of a robot to a command; one to no command of its is counted."""
        whose, future = self._answers.get(str(answer.get('id')), ('', None))
        if future is None or whose != robot.id or future.done():
            robot.count('answers_late')
            return
        future.set_result({'ok': answer.get('ok') is True, 'text': str(answer.get('text', ''))})

    def say(self, robot: RobotState, kind: str, content: Mapping[str, Any]) -> bool:
        """Send a message to a robot; False when it is not connected or does not read."""
        connection = self._connections.get(robot.id)
        return connection is not None and connection.say(kind, content)

    # Clients

    def join(self, client: Client) -> None:
        """Tell a client the whole state; from now on it gets what changes."""
        client.say(encoded(self.state(client.rights)))
        self.clients[client] = None

    def leave(self, client: Client) -> None:
        """Forget a client."""
        self.clients.pop(client, None)

    def state(self, rights: Rights) -> dict[str, Any]:
        """Return all that those with these rights see at first."""
        robots = self.seen(rights)
        return {'kind': 'state', 'utc_ns': time.time_ns(),
                'robots': [each.shown(rights) for each in robots],
                'people': self.people(rights), 'alarms': self.alarms(rights)}

    def people(self, rights: Rights) -> list[dict[str, Any]]:
        """Return the people that they see, each with the robots they live with."""
        found: dict[str, list[str]] = {}
        for robot in self.robots.values():
            for person in filter(rights.sees_person, robot.people or ()):
                found.setdefault(person, []).append(robot.id)
        return [{'person': person, 'robots': found[person]} for person in sorted(found)]

    def alarms(self, rights: Rights) -> list[dict[str, Any]]:
        """Return the open alarms that they see."""
        every = ((robot, alarm) for robot in self.seen(rights)
                 for alarm in robot.alarms.values() if alarm['is_open'])
        shown: Iterable[dict[str, Any] | None] = (robot.alarm_shown(alarm, rights)
                                                  for robot, alarm in every)
        return [each for each in shown if each is not None]

    def tell_robot(self, robot: RobotState) -> None:
        """Tell whom it concerns that a robot has changed."""
        self._tell_each(lambda rights: robot.shown(rights) if rights.sees_robot(robot.people)
                        else None, 'robot')

    def _tell(self, robot: RobotState, message: Mapping[str, Any]) -> None:
        self._tell_each(lambda rights: {**message} if rights.sees_robot(robot.people) else None)

    def _tell_each(self, shown: Callable[[Rights], dict[str, Any] | None], kind: str = ''
                   ) -> None:
        texts: dict[Rights, str | None] = {}
        for client in list(self.clients):
            rights = client.rights
            if rights not in texts:
                found = shown(rights)
                if found is not None and kind:  # a kind of cause has that name in alarms
                    found = {**found, 'kind': kind}
                texts[rights] = None if found is None else encoded(found)
            text = texts[rights]
            if text is not None:
                client.say(text)


def _away(name: str) -> AwayError:
    return AwayError(f'{name} is not connected', 'wait until it is back: see its last sign of '
                     'life on the overview')

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

Alarms and states of robots are sent to every client that may see them, immediately and in order;
signals by watches (:mod:`rt_robot_os.monitor.live.fan_out`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
import time
from typing import Any
from typing import Final
from typing import Protocol
from uuid import uuid4

from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.uplink.commands import CommandAnswer
from rt_robot_os.messages.uplink.commands import RobotCommand
from rt_robot_os.messages.uplink.driving import DriveBeat
from rt_robot_os.messages.uplink.live import WantedSignals
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.voice import VoiceMessage
from rt_robot_os.monitor.live.fan_out import FanOut
from rt_robot_os.monitor.live.rights import Rights
from rt_robot_os.monitor.live.robot_state import encoded
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.live.turns import WatchQuota
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import Permission

#: Missing heartbeats after which a robot is silent.
BEATS: Final = 3
#: Shortest time between two messages to a robot about the watched signals.
WANT_S: Final = 0.5


class RobotUnavailable(Exception):
    """The robot is not connected, or did not answer in time."""

    def __init__(self, text: str, remedy: str, is_late: bool = False) -> None:
        super().__init__(text)
        self.text = text
        self.remedy = remedy
        self.is_late = is_late


class RobotPeer(Protocol):
    """The interface of a robot's connection for the hub."""

    def send(self, message: UplinkMessage) -> bool:
        """Send a message; False when the queue is full."""

    def send_urgent(self, message: UplinkMessage) -> None:
        """Send a message before all others; only the newest of a kind is sent."""

    def close(self, code: int, reason: str) -> None:
        """Close it."""


class Client(Protocol):
    """The interface of a browser's connection for the hub."""

    actor: Actor
    rights: Rights

    def close(self, code: int, reason: str) -> None:
        """Close it."""

    def send(self, text: str) -> bool:
        """Send an urgent message."""

    def robot_came(self, robot: RobotState) -> None:
        """Watch a robot that is new to the hub."""


class Hub:
    """
    All robots and clients.

    :param heartbeat_s: a robot that sends nothing for three of these is silent.
    :param command_s: how long a command may wait for its answer.
    """

    def __init__(self, heartbeat_s: float, command_s: float) -> None:
        self.robots: dict[str, RobotState] = {}
        self.clients: dict[Client, None] = {}
        self.fan_out = FanOut()
        self._heartbeat_s = heartbeat_s
        self._command_s = command_s
        self._connections: dict[str, RobotPeer] = {}
        self._answers: dict[str, tuple[str, asyncio.Future[CommandAnswer]]] = {}
        self._wants: dict[str, asyncio.TimerHandle] = {}
        self.turns = WatchQuota()

        self.counts: dict[str, int] = {'joined': 0, 'overrun': 0, 'revoked': 0, 'refused': 0,
                                       'watches_delayed': 0,
                                       'robots_refused': 0}
        #: Called with the id of a robot and its message, for each heartbeat.
        self.on_beat: list[Callable[[str, DriveBeat], object]] = []
        #: Called with the id of a robot and its message, for each signalling message of a call.
        self.on_voice: list[Callable[[str, VoiceMessage], object]] = []
        #: Called with the id of a robot and whether it is connected now.
        self.on_robot: list[Callable[[str, bool], object]] = []
        self._server: dict[str, Any] = {'storing': True, 'text': ''}

    @staticmethod
    def rights_of(actor: Actor) -> Rights:
        """Return what a user may see."""
        return Rights(actor.people, actor.may(Permission.HEALTH))

    def remember(self, robots: Iterable[Mapping[str, Any]],
                 alarms: Iterable[Mapping[str, Any]]) -> None:
        """Load the robots and open alarms from the database at the start."""
        for each in robots:
            robot = self.get_or_create(each['id'], each.get('name') or '')
            robot.last_seen_ns = each.get('last_seen_ns') or 0
        for each in alarms:
            self.get_or_create(each['robot']).alarms[each['id']] = dict(each)

    def get_or_create(self, robot: str, name: str = '') -> RobotState:
        """Return a robot; a new one is added and announced to clients that watch all."""
        found = self.robots.get(robot)
        if found is None:
            found = self.robots[robot] = RobotState(robot, name or robot)
            for each in list(self.clients):
                each.robot_came(found)
        return found

    @property
    def connected(self) -> int:
        """Return how many robots are connected."""
        return len(self._connections)

    def is_connected(self, robot: str) -> bool:
        """Return whether a robot is connected."""
        return robot in self._connections

    def robot(self, robot: str) -> dict[str, Any] | None:
        """Return a robot as shown with all rights; None when it does not exist."""
        found = self.robots.get(robot)
        return None if found is None else found.shown(Rights(None, True))

    def may_see_robot(self, actor: Actor, robot: str) -> bool:
        """Return whether a user may see a robot."""
        found = self.robots.get(robot)
        return found is not None and self.rights_of(actor).sees_robot(found.people)

    def seen(self, actor_rights: Rights) -> list[RobotState]:
        """Return the robots that are visible with these rights."""
        return [each for each in self.robots.values() if actor_rights.sees_robot(each.people)]

    # Robots

    def connect(self, robot: RobotState, connection: RobotPeer, now_ns: int) -> None:
        """Register the connection of a robot after its hello; the previous one is closed."""
        before = self._connections.get(robot.id)
        if before is not None and before is not connection:
            before.close(4000, 'the same robot has connected again')
        self._connections[robot.id] = connection
        gone_ns = robot.last_seen_ns
        robot.connected, robot.retired = True, False
        self.touch(robot, now_ns, quietly=True)
        robot.wanted = (-1.0, ())
        if robot.id in self._wants:  # of its previous connection
            self._wants.pop(robot.id).cancel()
        self.tell_robot(robot)
        self._tell_listeners(robot)
        if gone_ns:
            self._tell(robot, {'kind': 'gap', 'robot': robot.id, 'from_ns': gone_ns,
                               'to_ns': now_ns})
        self.want(robot)

    def disconnect(self, robot: RobotState, connection: RobotPeer) -> None:
        """Remove a connection of a robot; its commands fail immediately."""
        if self._connections.get(robot.id) is not connection:
            return
        del self._connections[robot.id]
        robot.connected = False
        for whose, future in self._answers.values():
            if whose == robot.id and not future.done():
                future.set_exception(_away(robot.name))
        self.tell_robot(robot)
        self._tell_listeners(robot)

    def retire(self, robots: Iterable[str]) -> None:
        """Mark robots whose token was revoked, until one connects with another token."""
        for robot in [self.robots[each] for each in robots if each in self.robots]:
            robot.retired = True
            self.tell_robot(robot)

    def touch(self, robot: RobotState, now_ns: int, quietly: bool = False) -> None:
        """Update the time at which a robot was last heard from."""
        robot.heard = asyncio.get_running_loop().time()
        robot.last_seen_ns = now_ns
        if robot.silent:
            robot.silent = False
            if not quietly:
                self.tell_robot(robot)

    def check_timeouts(self) -> None:
        """Detect silent robots; to be called about once per heartbeat."""
        now = asyncio.get_running_loop().time()
        for each in self.robots.values():
            if not each.silent and now - each.heard > BEATS * self._heartbeat_s:
                each.silent = True
                each.count('silences')
                self.tell_robot(each)

    def live(self, robot: RobotState) -> None:
        """Send changes of a robot to clients that watch it."""
        self.fan_out.changed(robot)

    def events(self, robot: RobotState, events: Iterable[tuple[Mapping[str, Any], int]],
               boot: str = '') -> None:
        """
        Apply events of alarms, and send the present state of each to clients that may see it.

        :param events: as they are in ``alarms/events``, each with its UTC in ns.
        :param boot: the start of the robot that made them.
        """
        changed: dict[str, dict[str, Any]] = {}
        for event, utc_ns in events:
            alarm = robot.take_alarm(event, utc_ns, boot)
            if alarm is not None:
                changed[alarm['id']] = alarm
        for each in changed.values():
            self._tell_each(partial(robot.alarm_shown, each), 'alarm')

    def beat(self, robot: RobotState, message: DriveBeat) -> None:
        """Pass a heartbeat to its listeners."""
        for each in self.on_beat:
            each(robot.id, message)

    def voice(self, robot: RobotState, message: VoiceMessage) -> None:
        """Pass a signalling message of a call to its listeners."""
        for each in self.on_voice:
            each(robot.id, message)

    def want(self, robot: RobotState) -> None:
        """Request the watched signals and their rate from a robot."""
        if robot.id not in self._wants:  # the first now, later ones together
            self._want(robot)

    def _want(self, robot: RobotState) -> None:
        self._wants.pop(robot.id, None)
        connection = self._connections.get(robot.id)
        wanted = self.fan_out.wanted(robot.id)
        if connection is not None and wanted != robot.wanted:
            robot.wanted = wanted
            connection.send(WantedSignals(wanted[0], wanted[1]))
            self._wants[robot.id] = asyncio.get_running_loop().call_later(
                WANT_S, self._want, robot)

    def storing(self, fault: str) -> None:
        """Notify every client whether records can be stored; ``fault`` is empty if so."""
        server = {'storing': not fault, 'text': fault}
        if server != self._server:
            self._server = server
            self._tell_each(lambda rights: server, 'server')

    # Commands

    async def command(self, robot: RobotState, do: str, args: Mapping[str, Any], by: str
                      ) -> CommandAnswer:
        """
        Send a command to a robot; it executes it once.

        :raises RobotUnavailable: it is not connected, or did not answer in time.
        """
        connection = self._connections.get(robot.id)
        # A gateway executes each id once: ids must not repeat after a restart of this server.
        number = uuid4().hex
        future: asyncio.Future[CommandAnswer] = asyncio.get_running_loop().create_future()
        if connection is None:
            raise _away(robot.name)
        self._answers[number] = (robot.id, future)
        try:
            if not connection.send(RobotCommand(number, do, args, by)):
                raise _away(robot.name)
            return await asyncio.wait_for(future, self._command_s)
        except asyncio.TimeoutError:
            raise RobotUnavailable(
                f'{robot.name} has not answered for {self._command_s:g} s; whether it has done it '
                'is not known', 'look at its state before you try again', is_late=True) from None
        finally:
            self._answers.pop(number, None)

    def answered(self, robot: RobotState, answer: CommandAnswer) -> None:
        """Receive the answer of a robot to a command; answers to unknown commands are counted."""
        whose, future = self._answers.get(answer.id, ('', None))
        if future is None or whose != robot.id or future.done():
            robot.count('answers_late')
            return
        codes = codes_of({'text': answer.text, 'codes': answer.codes}, ('text',))
        future.set_result(replace(answer, codes=codes))

    def send(self, robot: RobotState, message: UplinkMessage) -> bool:
        """Send a message to a robot; False when it is not connected or does not read."""
        connection = self._connections.get(robot.id)
        return connection is not None and connection.send(message)

    def drive(self, robot: str, message: UplinkMessage) -> bool:
        """
        Send a teleoperation message to a robot, before all queued ones.

        A message is dropped when the next of the same kind comes before it is sent.

        :return: whether the robot is connected.
        """
        connection = self._connections.get(robot)
        if connection is None:
            return False
        connection.send_urgent(message)
        return True

    def _tell_listeners(self, robot: RobotState) -> None:
        for each in self.on_robot:
            each(robot.id, robot.connected)

    # Clients

    def join(self, client: Client) -> None:
        """Send a client the whole state; from now on it gets changes."""
        self.counts['joined'] += 1
        client.send(encoded(self.state(client.rights)))
        self.clients[client] = None

    def leave(self, client: Client) -> None:
        """Remove a client."""
        self.clients.pop(client, None)

    def revoked(self, revoked: Any) -> None:
        """
        Close the connections of a session or a token that is no longer valid.

        :param revoked: with ``kind`` (``session`` or ``robot``), ``id``, ``code`` and ``text``.
        """
        if revoked.kind == 'robot' and revoked.id in self._connections:
            self._connections[revoked.id].close(revoked.code, revoked.text)
        if revoked.kind == 'robot':
            self.retire([revoked.id])
        for each in list(self.clients):
            if revoked.kind == 'session' and each.actor.session == revoked.id:
                self.counts['revoked'] += 1
                self.leave(each)
                each.close(revoked.code, revoked.text)

    def state(self, rights: Rights) -> dict[str, Any]:
        """Return the initial state for these rights."""
        robots = self.seen(rights)
        return {'kind': 'state', 'utc_ns': time.time_ns(),
                'robots': [each.shown(rights) for each in robots],
                'people': self.people(rights), 'alarms': self.alarms(rights),
                'server': self._server}

    def residents_changed(self) -> None:
        """Send every client the whole state, because residents of robots have changed."""
        for client in list(self.clients):
            if not client.send(encoded(self.state(client.rights))):
                self.counts['overrun'] += 1
                self.leave(client)

    def lives_elsewhere(self, person: str, robot: RobotState) -> bool:
        """Return whether a person is a confirmed resident of another robot."""
        return any(person in (each.people or ()) for each in self.robots.values()
                   if each is not robot)

    def people(self, rights: Rights) -> list[dict[str, Any]]:
        """Return the people visible with these rights, each with the robots they live with."""
        found: dict[str, list[str]] = {}
        for robot in self.robots.values():
            for person in filter(rights.sees_person, robot.people or ()):
                found.setdefault(person, []).append(robot.id)
        return [{'person': person, 'robots': found[person]} for person in sorted(found)]

    def alarms(self, rights: Rights) -> list[dict[str, Any]]:
        """Return the open alarms visible with these rights."""
        every = ((robot, alarm) for robot in self.seen(rights)
                 for alarm in robot.alarms.values() if alarm['is_open'])
        shown: Iterable[dict[str, Any] | None] = (robot.alarm_shown(alarm, rights)
                                                  for robot, alarm in every)
        return [each for each in shown if each is not None]

    def tell_robot(self, robot: RobotState) -> None:
        """Send the state of a robot to clients that may see it."""
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
                if found is not None and kind:  # 'kind' is used for causes in alarms
                    found = {**found, 'kind': kind}
                texts[rights] = None if found is None else encoded(found)
            text = texts[rights]
            if text is not None and not client.send(text):
                self.counts['overrun'] += 1
                self.leave(client)


def _away(name: str) -> RobotUnavailable:
    return RobotUnavailable(f'{name} is not connected', 'wait until it is back: see its last sign '
                            'of life on the overview')

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

"""Commands to robots: checked, written to the audit, executed once, answered."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
import math
from typing import Any
from typing import Final
from typing import Literal

from fastapi import APIRouter
from fastapi import Depends
from pydantic import BaseModel
from pydantic import Field
from rt_robot_os.messages.alarm_commands import ACKNOWLEDGE
from rt_robot_os.messages.alarm_commands import CANCEL
from rt_robot_os.messages.alarm_commands import CONFIRM
from rt_robot_os.messages.alarm_commands import NOTE
from rt_robot_os.messages.alarm_commands import RESOLVE
from rt_robot_os.messages.alarm_commands import SILENCE
from rt_robot_os.messages.alarm_commands import TEST
from rt_robot_os.monitor.api.answers import refusal
from rt_robot_os.monitor.api.answers import unknown
from rt_robot_os.monitor.live.hub import RobotUnavailable
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import lacking
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services

TEXT_CHARACTERS: Final = 400
#: Longest reason that the robot stores.
REASON_CHARACTERS: Final = 120
#: Answers that are stored for repeated requests.
KEPT: Final = 1000
_OF_AN_ALARM: Final = frozenset({ACKNOWLEDGE, RESOLVE, CANCEL, CONFIRM, NOTE, 'escalate'})
#: Limit of coordinates in m; larger than any building.
_FAR_M: Final = 10_000.0

#: Permissions of each command, any of which suffices.
NEEDS: Final[dict[str, tuple[Permission, ...]]] = {
    'alarm': (Permission.ACKNOWLEDGE,), 'stop': (Permission.ACKNOWLEDGE, Permission.DRIVE),
    'release': (Permission.DRIVE,), 'goal': (Permission.DRIVE,), 'cancel': (Permission.DRIVE,),
    'agent': (Permission.DRIVE,), 'answer': (Permission.TALK,), 'say': (Permission.TALK,),
    'snapshot': (Permission.CAMERA,)}
#: Commands of a locked session (decision 100): a stop leaves a robot at rest, whoever sends it;
#: all others are done in a user's name, and need the password.
WHEN_LOCKED: Final = frozenset({'stop'})


class CommandRequest(BaseModel):
    """
    A command to a robot.

    ``key`` is any string: a command that is repeated with the same key is not executed again, and
    gets the same answer.
    """

    do: Literal['alarm', 'goal', 'cancel', 'stop', 'release', 'agent', 'answer', 'snapshot', 'say']
    args: dict[str, Any] = Field(default_factory=dict, max_length=20)
    key: str = Field('', max_length=100)


class CommandResponse(BaseModel):
    """The robot's answer; ``codes`` has the code of its text, if it has one."""

    ok: bool
    text: str
    codes: dict[str, Any] = Field(default_factory=dict)


class CommandService:
    """
    The commands of a server.

    :ivar answers: answers to commands with a key, by user and robot.
    """

    def __init__(self, services: Services) -> None:
        self._services = services
        self._answers: OrderedDict[tuple[str, ...], asyncio.Future[CommandResponse]] = (
            OrderedDict())

    async def do(self, actor: Actor, robot: str, command: CommandRequest) -> CommandResponse:
        """Execute a command, or return the stored answer to the same one."""
        hub = self._services.hub
        if not hub.may_see_robot(actor, robot):
            raise unknown('robot')
        needed = NEEDS[command.do]
        if not any(map(actor.may, needed)) and not (
                command.do in WHEN_LOCKED and not actor.locked.isdisjoint(needed)):
            raise lacking(actor, *needed, what=command.do)
        state = hub.robots[robot]
        args = self._args(actor, state, command)
        if not command.key:
            return await self._done(actor, state, command.do, args)
        key = (actor.id, robot, command.do, command.key)
        before = self._answers.get(key)
        if before is None:
            before = asyncio.ensure_future(self._done(actor, state, command.do, args))
            self._answers[key] = before
            if len(self._answers) > KEPT:
                self._answers.popitem(last=False)
        return await asyncio.shield(before)

    async def _done(self, actor: Actor, robot: RobotState, do: str, args: dict[str, Any]
                    ) -> CommandResponse:
        # Written in parallel, not before: the audit must not delay a stop.
        note = self._services.audit.note_soon
        locked = {'locked': True} if actor.locked else {}
        note(actor, f'command.{do}', robot.id, **locked, **{
            f'arg_{key}': value for key, value in args.items()})
        try:
            found = await self._services.hub.command(robot, do, args, actor.name)
        except RobotUnavailable as error:
            note(actor, f'answer.{do}', robot.id, ok=False, text=error.text)
            raise refusal(504 if error.is_late else 409, error.text, error.remedy) from None
        note(actor, f'answer.{do}', robot.id, ok=found.ok, text=found.text)
        codes = {'codes': dict(found.codes)} if found.codes else {}
        return CommandResponse(ok=found.ok, text=found.text, **codes)

    def _args(self, actor: Actor, robot: RobotState, command: CommandRequest) -> dict[str, Any]:
        args = command.args
        if command.do == 'alarm':
            return {'text': self._alarm_text(actor, robot, args)}
        if command.do == 'goal':
            return {key: _number(args, key, limit) for key, limit in (
                ('x', _FAR_M), ('y', _FAR_M), ('yaw', 100.0))}
        if command.do in ('agent', 'answer', 'say'):
            return {'text': _text(args, 'text')}
        if command.do == 'snapshot':
            if not all(map(actor.may_see, robot.ever)):
                raise refusal(403, 'a camera sees whoever is there, and you may not see everybody '
                              'who lives there', 'ask an admin')
            return {'camera': _text(args, 'camera')} if 'camera' in args else {}
        return {}

    def _alarm_text(self, actor: Actor, robot: RobotState, args: dict[str, Any]) -> str:
        """Return the command in words; its author is always the logged-in user."""
        verb, reason = args.get('verb'), _text(args, 'reason', '', REASON_CHARACTERS)
        by = '_'.join(actor.name.split())
        if verb in (TEST, SILENCE):
            return f'{verb} by {by} {reason}'.strip()
        if verb not in _OF_AN_ALARM:
            raise refusal(422, f'verb is none of {", ".join(sorted(_OF_AN_ALARM))}, {SILENCE}, '
                          f'{TEST}', 'see docs/alarms.md')
        alarm = _text(args, 'alarm')
        found = robot.alarms.get(alarm)
        if found is None or robot.alarm_shown(found, self._services.hub.rights_of(actor)) is None:
            raise unknown('open alarm')
        return f'{verb} {alarm} by {by} {reason}'.strip()


def router(services: Services) -> APIRouter:
    """Return the endpoint."""
    found = APIRouter(prefix='/api', tags=['robots'])
    commands = CommandService(services)

    @found.post('/robots/{robot}/commands', response_model_exclude_unset=True)
    async def command(robot: str, command: CommandRequest,
                      actor: Actor = Depends(allowed(Permission.SEE))) -> CommandResponse:
        """Send a command to a robot; ``ok`` is false when the robot refuses."""
        return await commands.do(actor, robot, command)

    return found


def _text(args: dict[str, Any], key: str, default: str | None = None,
          most: int = TEXT_CHARACTERS) -> str:
    """Return a string of one line."""
    value = args.get(key, default)
    found = ' '.join(''.join(each if each.isprintable() else ' ' for each in value).split()
                     ) if isinstance(value, str) and len(value) <= most else ''
    if not found and (default is None or value):
        raise refusal(422, f'args.{key} must be a string of 1 to {most} characters',
                      f'give args.{key}')
    return found


def _number(args: dict[str, Any], key: str, limit: float) -> float:
    value = args.get(key, 0.0 if key == 'yaw' else None)
    if (not isinstance(value, int | float) or isinstance(value, bool)
            or not math.isfinite(value) or abs(value) > limit):
        raise refusal(422, f'args.{key} must be a number from {-limit:g} to {limit:g}',
                      f'give args.{key}')
    return float(value)

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
Commands of users of the server, each executed once and answered with the robot's reply.

``stop`` and ``release`` of the e-stop, ``goal`` and ``cancel``, ``alarm`` (in the words of
docs/alarms.md), ``agent``, ``answer``, ``say`` and ``snapshot``. The server records which user
sent the command.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
import json
import math
import time
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import LinkError
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Greeting
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.reading import Sample
from rt_robot_os.link.answers import answer_of
from rt_robot_os.link.conversions import pose_message
from rt_robot_os.messages.cdr import LITTLE_ENDIAN
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.cdr import string_message
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.uplink.commands import CommandAnswer
from rt_robot_os.messages.uplink.commands import RobotCommand
from rt_robot_os.messages.uplink.messages import UplinkMessage

#: Most remembered commands, so that none is executed twice.
REMEMBERED: Final = 512
#: Most commands in progress.
RUNNING_MOST: Final = 32
_TEXT_MOST: Final = 400
_STATE_S: Final = 1.5
_BOOL: Final = {False: LITTLE_ENDIAN + b'\0', True: LITTLE_ENDIAN + b'\1'}
_ALARM: Final = 'alarms/command'
_ANSWER: Final = 'alarms/answer'
_GOAL: Final = 'goal_pose'
_CANCEL: Final = 'trajectory_cancel'
_STOP: Final = 'estop'
_RELEASE: Final = 'estop_release'
_AGENT: Final = 'agent/command'
_PERSON: Final = 'agent/answer'
_SAY: Final = 'agent/say'
_OBSERVE: Final = 'agent/observe'
_OBSERVED: Final = 'agent/observed'
_STEERING: Final = 'steering'
_PLANNER: Final = 'planner/state'
_HELD: Final = 'e-stop'
_FAR_M: Final = 10_000.0
_PLANNED: Final = ('planned', 'done')
_REFUSED: Final = ('refused', 'waiting')


class RobotText(NamedTuple):
    """A text of the robot for which a command may wait."""

    topic: str
    stamp_ns: int
    text: str


class CommandResult(NamedTuple):
    """The result of a command."""

    ok: bool
    text: str


# Returns the result that a text of the robot means for a waiting command; None when it is about
# another one.
_Check = Callable[[RobotText], CommandResult | None]


class CommandPart(Part):
    """
    Execute commands.

    :ivar done: executed commands.
    :ivar repeated: repeated commands, which were not executed again.
    """

    receives = (RobotCommand,)

    def __init__(self, context: GatewayContext) -> None:
        super().__init__(context)
        self.done = self.repeated = self.refused = 0
        self._answers: OrderedDict[str, CommandResult | None] = OrderedDict()
        self._running: set[asyncio.Task[None]] = set()
        self._waiting: set[tuple[_Check, asyncio.Future[CommandResult]]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._do: dict[str, Callable[[Mapping[str, Any], str], Awaitable[CommandResult]]] = {
            'alarm': self._alarm, 'goal': self._goal, 'cancel': self._cancel, 'stop': self._stop,
            'release': self._release, 'agent': self._agent, 'answer': self._answer,
            'say': self._say, 'snapshot': self._snapshot}

    def reads(self) -> Sequence[Reads]:
        """Read the robot's replies to commands."""
        return (Reads(_ANSWER, self._take, every=True), Reads(_OBSERVED, self._take, every=True),
                Reads(_STEERING, self._take), Reads(_PLANNER, self._take))

    def publishes(self) -> Sequence[str]:
        """Publish the topics of commands."""
        return (_ALARM, _GOAL, _CANCEL, _STOP, _RELEASE, _AGENT, _PERSON, _SAY, _OBSERVE)

    def hello(self) -> Greeting:
        """Announce the commands for which this robot has topics."""
        needed = {'alarm': _ALARM, 'goal': _GOAL, 'cancel': _CANCEL, 'stop': _STOP,
                  'release': _RELEASE, 'agent': _AGENT, 'answer': _PERSON, 'say': _SAY,
                  'snapshot': _OBSERVE}
        return Greeting(tuple(do for do, topic in needed.items() if self.context.robot.has(topic)))

    async def run(self) -> None:
        """Store the event loop; commands are executed on arrival."""
        self._loop = asyncio.get_running_loop()
        try:
            await asyncio.Event().wait()
        finally:
            for each in list(self._running):
                each.cancel()

    # ---- from the server ---------------------------------------------------------------------

    def receive(self, message: UplinkMessage) -> None:
        """Receive a command; a repeated one gets the same answer again."""
        if not isinstance(message, RobotCommand):
            return
        key = message.id
        if key in self._answers:
            self.repeated += 1
            answer = self._answers[key]
            if answer is not None:
                self._say_answer(key, answer)
            return
        self._answers[key] = None
        while len(self._answers) > REMEMBERED:
            self._answers.popitem(last=False)
        if len(self._running) >= RUNNING_MOST:
            self._end(key, CommandResult(False, 'too many commands at a time'))
            return
        task = asyncio.ensure_future(self._run(key, message.do, message.args, message.by))
        self._running.add(task)
        task.add_done_callback(self._running.discard)

    async def _run(self, key: str, do: str, args: Mapping[str, Any], by: str) -> None:
        work = self._do.get(do)
        try:
            if work is None:
                raise ValueError(f'this robot has no command {do[:40]!r}; it has '
                                 f'{", ".join(self._do)}')
            answer = await work(args, by)
        except (LinkError, ValueError) as error:
            answer = CommandResult(False, str(error))
        self._end(key, answer)

    def _end(self, key: str, answer: CommandResult) -> None:
        self.done += answer.ok
        self.refused += not answer.ok
        if key in self._answers:
            self._answers[key] = answer
        self._say_answer(key, answer)

    def _say_answer(self, key: str, answer: CommandResult) -> None:
        codes = codes_of({'text': answer.text}, ('text',))
        self.context.server.send(CommandAnswer(key, answer.ok, answer.text, codes))

    # ---- from the robot ----------------------------------------------------------------------

    def _take(self, sample: Sample) -> None:
        loop = self._loop
        if loop is not None and self._waiting:
            loop.call_soon_threadsafe(self._heard, RobotText(
                sample.topic, sample.stamp_ns, string_in(sample.cdr)))

    def _heard(self, heard: RobotText) -> None:
        for check, future in list(self._waiting):
            answer = check(heard)
            if answer is not None and not future.done():
                future.set_result(answer)

    async def _await(self, publish: Callable[[], None], check: _Check, timeout_s: float
                     ) -> CommandResult | None:
        """Publish, and wait for the reply; None on a timeout."""
        future: asyncio.Future[CommandResult] = asyncio.get_running_loop().create_future()
        entry = check, future
        self._waiting.add(entry)
        try:
            publish()
            return await asyncio.wait_for(future, timeout_s)
        except (TimeoutError, asyncio.TimeoutError):
            return None
        finally:
            self._waiting.discard(entry)

    # ---- the commands ------------------------------------------------------------------------

    async def _alarm(self, args: Mapping[str, Any], by: str) -> CommandResult:
        text = _text(args)
        await self._check(_ALARM)
        asked_ns = time.monotonic_ns()

        def check(heard: RobotText) -> CommandResult | None:
            if heard.topic != _ANSWER or heard.stamp_ns < asked_ns:
                return None
            try:
                found = answer_of(string_message(heard.text))
            except ValueError:
                return None
            return CommandResult(found.ok, found.text) if found.is_to(text) else None

        answer = await self._await(lambda: self._publish(_ALARM, string_message(text)), check,
                                   self.context.settings.command_s)
        return answer or CommandResult(False, 'the robot does not answer; it may have been done '
                                              'all the same: look at the alarm')

    async def _goal(self, args: Mapping[str, Any], by: str) -> CommandResult:
        x, y, yaw = (_number(args, key) for key in ('x', 'y', 'yaw'))
        await self._check(_GOAL)
        asked_ns = time.monotonic_ns()

        def check(heard: RobotText) -> CommandResult | None:
            if heard.topic != _PLANNER or heard.stamp_ns < asked_ns:
                return None
            if heard.text.startswith(_PLANNED):
                return CommandResult(True, heard.text)
            return CommandResult(False, heard.text) if heard.text.startswith(_REFUSED) else None

        message = pose_message('map', (x, y, 0.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
                               time.time_ns())
        if _PLANNER not in self.context.robot.topics:
            self._publish(_GOAL, message)
            return CommandResult(True, 'the goal is given')
        answer = await self._await(lambda: self._publish(_GOAL, message), check,
                                   self.context.settings.command_s)
        return answer or CommandResult(True, 'the goal is given; the planner has not said yet '
                                             'whether there is a way')

    async def _cancel(self, args: Mapping[str, Any], by: str) -> CommandResult:
        await self._check(_CANCEL)
        self._publish(_CANCEL, _BOOL[True])
        return CommandResult(True, 'the goal is given up')

    async def _stop(self, args: Mapping[str, Any], by: str) -> CommandResult:
        answer = await self._await(
            lambda: self._publish(_STOP, _BOOL[True]),
            lambda heard: CommandResult(True, heard.text) if (
                heard.topic == _STEERING and _HELD in heard.text) else None, _STATE_S)
        return answer or CommandResult(True, 'the e-stop is pressed')

    async def _release(self, args: Mapping[str, Any], by: str) -> CommandResult:
        if not self.context.robot.has(_RELEASE):
            raise LinkError(f'this robot has no topic {_RELEASE}: its e-stop is released at the '
                            'robot')
        self._publish(_STOP, _BOOL[False])
        answer = await self._await(
            lambda: self._publish(_RELEASE, _BOOL[True]),
            lambda heard: CommandResult(_HELD not in heard.text, heard.text or 'released') if (
                heard.topic == _STEERING) else None, _STATE_S)
        return answer or CommandResult(True, 'the e-stop is released')

    async def _agent(self, args: Mapping[str, Any], by: str) -> CommandResult:
        text = _text(args)
        await self._check(_AGENT)
        self._publish(_AGENT, string_message(text))
        return CommandResult(True, 'the agent is told')

    async def _answer(self, args: Mapping[str, Any], by: str) -> CommandResult:
        text = _text(args)
        await self._check(_PERSON)
        self._publish(_PERSON, string_message(text))
        return CommandResult(True, 'the agent is told')

    async def _say(self, args: Mapping[str, Any], by: str) -> CommandResult:
        text = _text(args)
        await self._check(_SAY)
        self._publish(_SAY, string_message(text))
        return CommandResult(True, 'the robot says it')

    async def _snapshot(self, args: Mapping[str, Any], by: str) -> CommandResult:
        await self._check(_OBSERVE)
        asked_ns = time.monotonic_ns()
        order = json.dumps({'order': 'picture', 'alarm': 'asked', 'subject': ''})

        def check(heard: RobotText) -> CommandResult | None:
            if heard.topic != _OBSERVED or heard.stamp_ns < asked_ns:
                return None
            try:
                found = json.loads(heard.text)
            except ValueError:
                return None
            if not isinstance(found, dict) or found.get('alarm') != 'asked':
                return None
            problem = found.get('problem')
            text = str(problem or found.get('file', 'taken'))
            return CommandResult(not problem, text[:_TEXT_MOST])

        answer = await self._await(lambda: self._publish(_OBSERVE, string_message(order)), check,
                                   self.context.settings.command_s)
        return answer or CommandResult(False, 'the camera has not answered')

    async def _check(self, topic: str) -> None:
        """
        Check that a command has a reader. The e-stop is not checked, because it must not wait.

        :raises LinkError: it has no reader.
        """
        robot = self.context.robot
        if robot.has(topic) and not await asyncio.to_thread(robot.is_read, topic):
            raise LinkError(f'nothing in this robot or connected to it reads {topic}: nothing '
                            'was done')

    def _publish(self, topic: str, cdr: bytes) -> None:
        self.context.robot.publish(topic, cdr)

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        return {'commands': self.done, 'commands_refused': self.refused,
                'commands_repeated': self.repeated}


def _text(args: Mapping[str, Any]) -> str:
    text = args.get('text')
    if not isinstance(text, str) or not text.strip() or len(text) > _TEXT_MOST or '\0' in text:
        raise ValueError(f'text must be a string of 1 to {_TEXT_MOST} characters')
    return text.encode(errors='replace').decode()


def _number(args: Mapping[str, Any], key: str) -> float:
    value = args.get(key, 0.0 if key == 'yaw' else None)
    if (not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value)
            or abs(value) > _FAR_M):
        raise ValueError(f'{key} = {str(value)[:20]}: it must be a number')
    return float(value)

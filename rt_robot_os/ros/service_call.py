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
A call of a service that is answered from the core, by one of its modules or another process.

Before a command is published to another process, the core is asked whether a process that would
answer is connected. While the answer is awaited it is asked again, because that process may end.
An answer of the core itself needs no such request.
"""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Final
from typing import NamedTuple

from rclpy.task import Future

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.link.client import Question
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.readers import Readers
from rt_robot_os.link.readers import readers_of

#: How often it is checked whether the answering process is still connected.
CHECK_S: Final = 0.25
# An answer may arrive after the notice that its publisher has left.
_MISSES: Final = 2
_NOT_DONE: Final = 'nothing was published, so nothing was done'
_UNKNOWN: Final = 'it is not known whether it was done: check before you call again'

#: The possible answerers: clients of the core, and ROS nodes behind mirrors.
Answerers = frozenset[object]
ROS: Final = 'ros'


class Outcome(NamedTuple):
    """
    The result for the caller.

    :ivar known: the result of the command is known.
    :ivar answered: the text comes from an answer.
    """

    ok: bool
    text: str
    known: bool = True
    answered: bool = False


class Call:
    """
    A call that awaits its answer.

    :param command: the string that is published.
    :param wake: makes the executor resume its coroutines.
    :param in_ros: returns whether a ROS node answers, by mirrors of both topics.
    :ivar published_ns: on CLOCK_MONOTONIC; earlier answers do not count. 0: not published yet.
    """

    def __init__(self, command: str, wake: Callable[[], None], in_ros: Callable[[], bool]) -> None:
        self.command = command
        self.published_ns = 0
        self._answer: Future = Future()
        self._readers: Future = Future()
        self._wake = wake
        self._in_ros = in_ros
        self._first: Answerers = frozenset()
        self._names = 'the robot'
        self._misses = 0

    def end(self, outcome: Outcome) -> None:
        """Set the outcome; thread-safe, the first one counts."""
        for each in (self._readers, self._answer):
            if not each.done():
                each.set_result(outcome)
        self._wake()

    def time_out(self, timeout_s: float) -> None:
        """End because no answer was received."""
        self.fail(f'{self._names} did not answer {self.command!r} within {timeout_s:g} s' if (
            self.published_ns) else f'the core did not answer within {timeout_s:g} s')

    def fail(self, why: str) -> None:
        """End without an answer."""
        known = not self.published_ns
        self.end(Outcome(False, f'{why}; {_NOT_DONE if known else _UNKNOWN}', known))

    @property
    def is_open(self) -> bool:
        """Return whether it is published and not answered."""
        return bool(self.published_ns) and not self._answer.done()

    async def find(self, client: LinkClient, topic: str, answers: str) -> bool | Outcome:
        """
        Ask the core for possible answerers.

        :return: whether there are any; the outcome, if the call has ended meanwhile.
        :raises LinkError: the connection is closed.
        """
        self._ask(client, topic, answers, self._found)
        found = await self._readers
        if isinstance(found, Outcome):
            return found
        self._first = self._answerers(found)
        self._names = found.names() or self._names
        return bool(self._first)

    async def publish(self, publish: Callable[[], None]) -> Outcome:
        """
        Publish, and wait for the answer.

        :raises LinkError: it cannot be published.
        """
        self.published_ns = time.monotonic_ns()
        publish()
        outcome: Outcome = await self._answer
        return outcome

    def check(self, client: LinkClient, topic: str, answers: str) -> None:
        """Check whether an answerer is still connected; never blocks."""
        if not self.is_open or not self._first:
            return
        try:
            self._ask(client, topic, answers, self._check_answerers)
        except LinkError:
            pass  # a closed connection ends all calls; a time-out proves nothing

    # ---- in the reading thread ---------------------------------------------------------------

    def _ask(self, client: LinkClient, topic: str, answers: str,
             then: Callable[[Readers], None]) -> None:
        def receive(question: Question) -> None:
            if not question.answered():
                return
            question.drop()
            try:
                then(readers_of(decode_json(question.packets[-1][1])))
            except LinkError as error:
                self.fail(str(error))

        client.begin('readers', on_packet=receive, topic=topic, answers=answers)

    def _found(self, readers: Readers) -> None:
        if not self._readers.done():
            self._readers.set_result(readers)
            self._wake()

    def _check_answerers(self, readers: Readers) -> None:
        self._misses = 0 if self._first & self._answerers(readers) else self._misses + 1
        if self._misses >= _MISSES:
            self.fail(f'{self._names} ended before it answered {self.command!r}')

    def _answerers(self, readers: Readers) -> Answerers:
        found: set[object] = set(readers.clients)
        if readers.asker and self._in_ros():
            found.add(ROS)
        return frozenset(found)

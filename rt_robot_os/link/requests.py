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

"""The table of requests: each part of the core registers the requests that it answers."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from enum import Enum
from typing import Any

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.safe_text import encodable
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.link.protocol import decode_request
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import MORE
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.session import ClientSession

Arguments = dict[str, Any]
Answer = Callable[[ClientSession, Arguments], Arguments]
# A packet of an answer: JSON, or the bytes of a record of another kind.
Part = Arguments | tuple[PacketKind, bytes]
LongAnswer = Callable[[ClientSession, Arguments], Iterable[Part]]

_SHOWN_MAXIMUM = 200


class Requests:
    """
    Answer requests; called by the link's low-priority task.

    :ivar occupied_by: the owner of the code that an answer waits for, such as a module; empty
        otherwise.
    """

    def __init__(self) -> None:
        self.occupied_by = ''
        self._answers: dict[str, Answer] = {}
        self._long: dict[str, LongAnswer] = {}

    def add(self, do: str, answer: Answer) -> None:
        """
        Add a request that is answered by one packet; call it before the kernel runs.

        :param answer: gets the client and the arguments; its result is sent as JSON. An
            ``RtRobotError`` is sent as the reason of a refusal; any other exception disconnects
            the client.
        :raises LinkError: a request of that name exists.
        """
        self._check_new(do)
        self._answers[do] = answer

    def add_long(self, do: str, answer: LongAnswer) -> None:
        """
        Add a request that is answered by many packets, each made when the client can receive it.

        :param answer: as for :meth:`add`, but yields the packets.
        :raises LinkError: a request of that name exists.
        """
        self._check_new(do)
        self._long[do] = answer

    def _check_new(self, do: str) -> None:
        if do in self._answers or do in self._long:
            raise LinkError(f'request {do!r} exists already: choose another name')

    def answer(self, session: ClientSession, packet: bytes) -> None:
        """Answer one request; a malformed request disconnects the client."""
        try:
            arguments = decode_request(packet)
        except LinkError as error:
            session.gone = f'refused: {error}'
            return
        number = arguments.get('id')
        if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 1 << 63:
            session.gone = f'refused: a request with id {shown(number)}'
            return
        try:
            reply = self._reply(session, number, arguments)
        except RtRobotError as error:
            reply = {'error': str(error)}
        if reply is not None:
            session.post(encode_json(PacketKind.REPLY, reply, seq=number))

    def _reply(self, session: ClientSession, number: int, arguments: Arguments
               ) -> Arguments | None:
        do = str(arguments.get('do'))
        if do in self._long:
            session.post_all(_packets(self._long[do](session, arguments), number))
            return None
        if do not in self._answers:
            raise LinkError(f'unknown request {shown(do)}; known are '
                            f'{", ".join(sorted([*self._answers, *self._long]))}')
        return self._answers[do](session, arguments)


def _packets(parts: Iterable[Part], number: int) -> Iterator[bytes]:
    last: Arguments = {}
    try:
        for part in parts:
            if isinstance(part, tuple):
                yield header(part[0], MORE, seq=number) + part[1]
            else:
                yield encode_json(PacketKind.REPLY, part, seq=number, more=True, default=_plain)
    except RtRobotError as error:
        last = {'error': str(error)}
    except Exception as error:
        # Most packets are made long after the request: only the client can be informed.
        last = {'error': f'the answer ends early: {type(error).__name__}: {error}'}
    yield encode_json(PacketKind.REPLY, last, seq=number)


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f'{value!r} cannot be sent as JSON')


def shown(value: Any) -> str:
    """Return a value that a client has sent, which may be anything, for a message."""
    text = repr(value)
    return text if len(text) <= _SHOWN_MAXIMUM else f'{text[:_SHOWN_MAXIMUM]}...'


def string_argument(arguments: Arguments, key: str) -> str:
    """
    Return an argument that must be a string.

    :raises LinkError: it is not a string, or cannot be encoded.
    """
    value = arguments.get(key)
    if not isinstance(value, str) or not encodable(value):
        raise LinkError(f'{key} = {shown(value)}: must be a string')
    return value


def number_argument(arguments: Arguments, key: str, default: float) -> float:
    """
    Return an argument that must be a number from 0.

    :raises LinkError: it is not such a number.
    """
    value = arguments.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < 1e9:
        raise LinkError(f'{key} = {shown(value)}: must be a number from 0')
    return float(value)


def reason_argument(session: ClientSession, arguments: Arguments) -> str:
    """Return the reason that a client gives for its request."""
    return safe_line(str(arguments.get('reason', f'asked by {session.name}')))


def value_argument(arguments: Arguments) -> Any:
    """
    Return the value of a parameter, of any type.

    :raises LinkError: it is, or contains, a string that cannot be encoded.
    """
    value = arguments.get('value')
    for item in value if isinstance(value, list) else (value,):
        if isinstance(item, str) and not encodable(item):
            raise LinkError(f'value = {shown(value)}: must be a string that can be encoded')
    return value

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

"""The readers of a topic of the core: whether a command that is published there has a receiver."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import NamedTuple

from rt_robot_os.base.errors import LinkError


class ReadingClient(NamedTuple):
    """A client of the core; after a reconnection it is a different one."""

    name: str
    pid: int
    since_ns: int


class Readers(NamedTuple):
    """
    The readers of a topic; where answers are expected, only the clients that can answer.

    :ivar in_core: number of devices and modules of the core that read it.
    :ivar asker: the requesting client is itself one of the readers.
    :ivar clients: the other clients.
    """

    in_core: int
    asker: bool
    clients: frozenset[ReadingClient]

    def __bool__(self) -> bool:
        """Return whether there is any reader."""
        return bool(self.in_core or self.asker or self.clients)

    def names(self) -> str:
        """Return the names of the clients, for a message."""
        return ', '.join(sorted(f'{each.name} (pid {each.pid})' for each in self.clients))


def readers_of(answer: Mapping[str, Any]) -> Readers:
    """
    Parse the answer of the core to the request ``readers``.

    :raises LinkError: the core refuses, or the answer is not valid.
    """
    if 'error' in answer:
        raise LinkError(str(answer['error']))
    try:
        return Readers(int(answer['in_core']), bool(answer['asker']), frozenset(
            ReadingClient(str(name), int(pid), int(since_ns))
            for name, pid, since_ns in answer['clients']))
    except (KeyError, TypeError, ValueError) as error:
        raise LinkError('the answer of the core to the request for readers is not valid: '
                        f'{type(error).__name__} {error}') from None


def no_answer(topic: str, remedy: str) -> str:
    """
    Return the message for a command that no process answers.

    :param remedy: what to do about it.
    """
    return (f'nothing that answers on {topic} is connected to the robot: nothing was done; '
            f'{remedy}')

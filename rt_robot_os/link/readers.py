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

"""Who reads a topic of the core: whether a command that is published there can be answered."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import NamedTuple

from rt_robot_os.base.errors import LinkError


class ReadingClient(NamedTuple):
    """A client of the core; one that connects again is another."""

    name: str
    pid: int
    since_ns: int


class Readers(NamedTuple):
    """
    Who reads a topic; where answers are expected, of the clients only those that can answer.

    :ivar in_core: how many devices and modules of the core read it.
    :ivar asker: the client that asks is itself one of the readers.
    :ivar clients: the others.
    """

    in_core: int
    asker: bool
    clients: frozenset[ReadingClient]

    def __bool__(self) -> bool:
        """Return whether there is any."""
        return bool(self.in_core or self.asker or self.clients)

    def names(self) -> str:
        """Name the clients, as for a message."""
        return ', '.join(sorted(f'{each.name} (pid {each.pid})' for each in self.clients))


def readers_of(answer: Mapping[str, Any]) -> Readers:
    """
    Read what the core answers to the request ``readers``.

    :raises LinkError: it refuses, or answers something else.
    """
    if 'error' in answer:
        raise LinkError(str(answer['error']))
    try:
        return Readers(int(answer['in_core']), bool(answer['asker']), frozenset(
            ReadingClient(str(name), int(pid), int(since_ns))
            for name, pid, since_ns in answer['clients']))
    except (KeyError, TypeError, ValueError) as error:
        raise LinkError(f'the core does not say who reads: {type(error).__name__} {error}'
                        ) from None


def no_answer(topic: str, remedy: str) -> str:
    """
    Say that nothing answers what is published on a topic.

    :param remedy: what to do about it.
    """
    return (f'nothing that answers on {topic} is connected to the robot: nothing was done; '
            f'{remedy}')

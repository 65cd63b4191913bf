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

"""A client of the alarms of a core over the link: the open alarms, commands and answers."""

from __future__ import annotations

import time
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.answers import answer_of
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.readers import no_answer
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.cdr import string_message
from rt_robot_os.messages.command_answer import CommandAnswer
from rt_robot_os.messages.diagnostic_array import DiagnosticStatus
from rt_robot_os.messages.diagnostic_array import statuses_of

COMMAND: Final = 'alarms/command'
ANSWER: Final = 'alarms/answer'
EVENTS: Final = 'alarms/events'
LIST: Final = 'alarms/list'
# The list comes at least every five seconds.
LIST_TIMEOUT_S: Final = 12.0
_LOOK_S: Final = 0.05


def check_topics(client: LinkClient, *topics: str) -> None:
    """
    Check that a robot has alarms.

    :raises LinkError: it has none.
    """
    missing = [topic for topic in topics if topic not in client.topics]
    if missing:
        raise LinkError(f'this robot has no topic {missing[0]}: it has no alarms (its modules '
                        'need one of type alarms, and topics those that clients publish; see '
                        'docs/alarms.md)')


def open_alarms(client: LinkClient, timeout_s: float = LIST_TIMEOUT_S) -> list[DiagnosticStatus]:
    """
    Get the list of open alarms.

    :raises LinkError: the core is gone, has no alarms, or does not respond in time.
    """
    check_topics(client, LIST)
    found: list[list[DiagnosticStatus]] = []

    def take(stamp_ns: int, missed: int, cdr: memoryview) -> None:
        try:
            found.append(statuses_of(string_in(cdr)))
        except ValueError as error:
            raise LinkError(f'{LIST} is no list of alarms: {error}') from error

    client.sample_handlers[client.topics[LIST].channel] = take
    client.mirror(LIST, 'latest', initial=True)
    deadline = time.monotonic() + timeout_s
    while not found:
        if time.monotonic() > deadline:
            raise LinkError(f'no list of alarms came within {timeout_s:g} s: does its module '
                            'run (see top)?')
        client.pump(_LOOK_S)
    return found[-1]


def send_command(client: LinkClient, command: str, timeout_s: float) -> CommandAnswer:
    """
    Publish a command and wait for its answer.

    :raises LinkError: the core is gone, has no alarms, or does not answer in time.
    """
    check_topics(client, COMMAND, ANSWER)
    if not client.readers(COMMAND, ANSWER):
        raise LinkError(no_answer(ANSWER, 'the modules of the robot need one of type alarms '
                                  '(docs/alarms.md)'))
    found: list[CommandAnswer] = []
    asked_ns = time.monotonic_ns()

    def take(head: Header, cdr: memoryview) -> None:
        try:
            answer = answer_of(cdr)
        except ValueError:
            return
        if head.stamp_ns >= asked_ns and answer.is_to(command):
            found.append(answer)

    client.on_data = take
    client.mirror(ANSWER, patient=True)
    client.publish(client.advertise(COMMAND), string_message(command))
    deadline = time.monotonic() + timeout_s
    while not found:
        if time.monotonic() > deadline:
            raise LinkError(f'the robot did not answer {command!r} within {timeout_s:g} s; the '
                            'outcome is unknown: check with `alarms list`')
        client.pump(_LOOK_S)
    return found[0]

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
Commands as strings and their answers, on two topics of the core.

A command is a ``std_msgs/msg/String``. So is the answer, with the JSON ``{"command": "the
command", "ok": true, "text": "the result"}``; the caller recognises its answer by the command.
"""

from __future__ import annotations

import json
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.cdr import string_in

#: In an answer a longer command may be cut to this many characters.
ECHO_LEAST: Final = 60


class Answer(NamedTuple):
    """
    The result of a command.

    :ivar command: as it was received; the beginning of a long one.
    :ivar alarm: the id of the alarm that the command was for; empty for none.
    """

    command: str
    ok: bool
    text: str
    alarm: str = ''

    def is_to(self, command: str) -> bool:
        """Return whether this is the answer to a command."""
        return self.command == command or (
            len(self.command) >= ECHO_LEAST and command.startswith(self.command))


def answer_of(cdr: bytes | memoryview) -> Answer:
    """
    Parse an answer.

    :raises ValueError: the message is not a valid answer.
    """
    try:
        found = json.loads(string_in(cdr))
        made = Answer(found['command'], found['ok'], found.get('text', ''),
                      str(found.get('alarm', '')))
    except (RecursionError, LookupError, TypeError, AttributeError) as error:
        raise ValueError(f'not an answer: {type(error).__name__} {error}') from None
    if not (isinstance(made.command, str) and isinstance(made.ok, bool)
            and isinstance(made.text, str)):
        raise ValueError('not an answer: command and text must be strings, ok must be true or '
                         'false')
    # Replace what a ROS string cannot hold.
    return made._replace(text=made.text.encode(errors='replace').decode().replace('\0', ' '))

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
Commands in plain words, and what the core answers: texts on two topics of it.

A command is a ``std_msgs/msg/String``. So is the answer, which holds ``{"command": "the command",
"ok": true, "text": "what became of it"}``; whoever waits knows its own by the command.
"""

from __future__ import annotations

import json
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.cdr import string_in

#: Who answers may cut a longer command to this many letters.
ECHO_LEAST: Final = 60


class Answer(NamedTuple):
    """
    What became of a command.

    :ivar command: as it was heard; the beginning of a long one.
    :ivar alarm: the alarm that it was about; empty without.
    """

    command: str
    ok: bool
    text: str
    alarm: str = ''

    def is_to(self, command: str) -> bool:
        """Return whether it answers a command."""
        return self.command == command or (
            len(self.command) >= ECHO_LEAST and command.startswith(self.command))


def answer_of(cdr: bytes | memoryview) -> Answer:
    """
    Read an answer.

    :raises ValueError: it is none.
    """
    try:
        found = json.loads(string_in(cdr))
        made = Answer(found['command'], found['ok'], found.get('text', ''),
                      str(found.get('alarm', '')))
    except (RecursionError, LookupError, TypeError, AttributeError) as error:
        raise ValueError(f'no answer: {type(error).__name__} {error}') from None
    if not (isinstance(made.command, str) and isinstance(made.ok, bool)
            and isinstance(made.text, str)):
        raise ValueError('no answer: command and text must be texts, ok must be true or false')
    # What ROS cannot hold in a text.
    return made._replace(text=made.text.encode(errors='replace').decode().replace('\0', ' '))

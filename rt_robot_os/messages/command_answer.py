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
"""What became of a command that was published as text: JSON in a ``std_msgs/msg/String``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated
from typing import Any
from typing import Final

from rt_robot_os.messages.codec import Codec
from rt_robot_os.messages.fields import compact
from rt_robot_os.messages.fields import Flag
from rt_robot_os.messages.fields import parse_object
from rt_robot_os.messages.fields import Text

#: A longer command may be cut to this many characters in its answer.
ECHO_LEAST: Final = 60


@dataclass(frozen=True, slots=True)
class CommandAnswer:
    """
    What became of a command.

    :ivar command: as received; of a long one the beginning.
    :ivar ok: it was carried out.
    :ivar text: what was done, or why not.
    :ivar alarm: the alarm concerned; empty for none, and for several.
    """

    command: Annotated[str, Text(100_000)]
    ok: Annotated[bool, Flag()]
    text: Annotated[str, Text(100_000)] = ''
    alarm: Annotated[str, Text(200)] = ''

    def is_to(self, command: str) -> bool:
        """Return whether it answers a command."""
        return self.command == command or (
            len(self.command) >= ECHO_LEAST and command.startswith(self.command))

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        return {'command': self.command, 'ok': self.ok, 'text': self.text, 'alarm': self.alarm}

    def to_json(self) -> str:
        """Return it as JSON."""
        return compact(self.to_dict())

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> CommandAnswer:
        """
        Read what :meth:`to_dict` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        # Modules of others may give a number; a caller waits for the answer all the same.
        if not isinstance(alarm := found.get('alarm', ''), str):
            found = {**found, 'alarm': str(alarm)}
        return CODEC.read(found)

    @classmethod
    def from_json(cls, text: str) -> CommandAnswer:
        """
        Read what :meth:`to_json` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        return cls.from_dict(
            parse_object(text, '{"command": "...", "ok": true, "text": "..."}'))


CODEC: Final = Codec(CommandAnswer)

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

"""Commands of people to a robot, and what became of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.messages.uplink.fields import cut_text_in
from rt_robot_os.messages.uplink.fields import loose_object_in
from rt_robot_os.messages.uplink.fields import wrong
from rt_robot_os.messages.uplink.messages import UplinkMessage

ID_CHARACTERS: Final = 100
BY_CHARACTERS: Final = 80


@dataclass(frozen=True)
class RobotCommand(UplinkMessage):
    """
    Something that a robot is to do, once.

    :ivar id: never used for another one.
    :ivar do: such as ``stop``.
    :ivar args: of the command; checked by what does it.
    :ivar by: who commands it.
    """

    KIND: ClassVar[str] = 'command'

    id: str  # noqa: A003
    do: str
    args: Mapping[str, Any]
    by: str

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'id': self.id, 'do': self.do, 'args': dict(self.args), 'by': self.by}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> RobotCommand:
        """
        Read it.

        :raises ValueError: it has no id, or arguments that are not an object.
        """
        number, args = message.get('id'), message.get('args') or {}
        if not isinstance(number, (str, int)):
            raise wrong('id', number, 'a string or an integer')
        if not isinstance(args, dict):
            raise wrong('args', args, 'an object')
        return cls(str(number)[:ID_CHARACTERS], str(message.get('do')), args,
                   safe_line(str(message.get('by', '')))[:BY_CHARACTERS])


@dataclass(frozen=True)
class CommandAnswer(UplinkMessage):
    """
    What became of a command.

    :ivar codes: of ``text``, as the robot's release knows them.
    """

    KIND: ClassVar[str] = 'answer'

    id: str  # noqa: A003
    ok: bool
    text: str
    codes: Mapping[str, Any] = field(default_factory=dict)

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'id': self.id, 'ok': self.ok, 'text': self.text, 'codes': dict(self.codes)}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> CommandAnswer:
        """Read it; an answer that names no command belongs to none."""
        return cls(cut_text_in(message, 'id', ID_CHARACTERS), message.get('ok') is True,
                   str(message.get('text', '')), loose_object_in(message, 'codes'))

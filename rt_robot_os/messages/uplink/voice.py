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

"""What the two ends of a call say to set it up; the server passes it on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.messages.uplink.fields import text_in
from rt_robot_os.messages.uplink.messages import UplinkMessage

#: What ``do`` says: down, up, up, and both ways.
RING: Final = 'ring'
ANSWER: Final = 'answer'
STATE: Final = 'state'
END: Final = 'end'
CALL_CHARACTERS: Final = 64
SDP_CHARACTERS: Final = 64 << 10
_CUT: Final = {'by': 64, 'state': 32, 'why': 300}


@dataclass(frozen=True)
class VoiceMessage(UplinkMessage):
    """
    One step of a call; a field that a step does not have is None.

    :ivar call: its name.
    :ivar do: which step.
    :ivar sdp: the offer of a ring, or the answer to it.
    :ivar by: who rings.
    :ivar state: of the connection between browser and robot.
    :ivar why: it has ended.
    """

    KIND: ClassVar[str] = 'voice'

    call: str
    do: str
    sdp: str | None = None
    by: str | None = None
    state: str | None = None
    why: str | None = None

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        more = {'sdp': self.sdp, 'by': self.by, 'state': self.state, 'why': self.why}
        return {'call': self.call, 'do': self.do,
                **{name: value for name, value in more.items() if value is not None}}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> VoiceMessage:
        """
        Read it.

        :raises ValueError: it names no call or no step, or its description is malformed.
        """
        sdp = None if message.get('sdp') is None else text_in(message, 'sdp', SDP_CHARACTERS)
        found = cls(text_in(message, 'call', CALL_CHARACTERS),
                    text_in(message, 'do', CALL_CHARACTERS), sdp, *(
                        None if message.get(name) is None else str(message[name])[:most]
                        for name, most in _CUT.items()))
        if found.do in (RING, ANSWER) and found.sdp is None:
            raise ValueError(f'{found.do} without an sdp')
        return found

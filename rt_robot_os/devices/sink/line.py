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

"""What stands between the bytes of a port and the packets of a sink."""

from __future__ import annotations

from rt_robot_os.devices.device import Value
from rt_robot_os.wsn.packets.framing import Frame
from rt_robot_os.wsn.packets.framing import FrameReader
from rt_robot_os.wsn.packets.framing import Protocols
from rt_robot_os.wsn.packets.serial_link import Link


class SerialLine(FrameReader):
    """
    A serial line: frames with packets, and acknowledgements, which it deals with.

    :ivar link: of what is written.
    """

    def __init__(self, protocols: Protocols) -> None:
        """
        Begin with nothing.

        :param protocols: what is written; read are those of both generations.
        """
        super().__init__()
        self.link = Link(protocols)

    def feed(self, data: bytes) -> list[Frame]:
        """
        Take the next bytes of the line; never raises.

        :return: the frames with packets that they complete, in order.
        """
        link = self.link
        return [each for each in super().feed(data) if link.take(each)]

    def reset(self) -> None:
        """Begin anew: what is pending is rejected, what waits to be written is given up."""
        super().reset()
        self.link.reset()

    def report(self) -> dict[str, Value]:
        """Return the counters by name, for statistics and diagnostics."""
        link = self.link
        return {'acks_sent': link.answered, 'stray_acks': link.stray_acks,
                'acks_dropped': link.answers_dropped}

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


"""The robot's side of a simulated network: its model of it, beside the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.sensor_network.model import NetworkModel

_UART: Final = 0x7E


class Host:
    """
    Feeds the packets of a sink's serial line to the model that a robot has of its network.

    :param version: of TinyOS.
    :param sink: its address.
    :param nodes: how many there are.
    :ivar model: the robot's.
    :ivar duplicates: packets that it gave to the application once more.
    :ivar withheld: packets that it took for duplicates, and were not.
    """

    def __init__(self, version: int, sink: int, nodes: int) -> None:
        self.model = NetworkModel(sink_id=sink, max_nodes=nodes + 1)
        self.duplicates = 0
        self.withheld = 0
        self._version = version
        self._sink = sink
        self._decoder = PacketDecoder('tinyos1' if version == 1 else 'tinyos2')

    def take(self, am_type: int, payload: bytes, is_new: bool, now_ns: int) -> None:
        """
        Take a packet from the serial line.

        :param is_new: it comes for the first time, in truth.
        """
        if self._version == 1:
            packet = TelosMsg(_UART, am_type, payload).pack()
        else:
            packet = SerialAm(self._sink, self._sink, am_type, payload).pack()
        taken = self.model.update(self._decoder.decode(packet), now_ns)
        self.duplicates += taken and not is_new
        self.withheld += is_new and not taken

    def as_json(self, truly_lost: Mapping[int, int]) -> dict[str, Any]:
        """
        Return what it counted, and where that is not the truth.

        :param truly_lost: by node, packets lost before the last one that came: of those after it
            nothing can be known.
        """
        lost = {each: node.lost for each, node in sorted(self.model.nodes.items())}
        wrong = {each: {'host': lost.get(each, 0), 'truth': count}
                 for each, count in truly_lost.items() if lost.get(each, 0) != count}
        return {'duplicates_to_application': self.duplicates, 'withheld': self.withheld,
                'lost_by_node': lost, 'losses_that_differ': wrong}

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


"""The robot's model of a simulated network, for comparison with the true counts."""

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
    Passes the packets of a sink's serial line to the network model of a robot.

    :param version: of TinyOS.
    :param sink: its address.
    :param nodes: number of nodes.
    :ivar model: the network model of the robot.
    :ivar duplicates: packets passed to the application again.
    :ivar withheld: packets that the model wrongly treated as duplicates.
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
        Process a packet from the serial line.

        :param is_new: whether it is really the first copy.
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
        Return its counts, and the nodes for which they differ from the true ones.

        :param truly_lost: by node, packets lost before the last one delivered; the model cannot
            know of later losses.
        """
        lost = {each: node.lost for each, node in sorted(self.model.nodes.items())}
        wrong = {each: {'host': lost.get(each, 0), 'truth': count}
                 for each, count in truly_lost.items() if lost.get(each, 0) != count}
        return {'duplicates_to_application': self.duplicates, 'withheld': self.withheld,
                'lost_by_node': lost, 'losses_that_differ': wrong}

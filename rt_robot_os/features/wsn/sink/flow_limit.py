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
A rate limit of the packets of important classes from one node, by the relay that delivered them.

Addresses on the radio are not authenticated: a node can send alarms in the name of another and
fill the queue of their class. The limit applies to each pair of origin and relay, so that a flood
in the name of a node does not affect packets of this node through another relay.

The algorithm is the generic cell rate algorithm (ITU-T I.371, virtual scheduling).
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from rt_robot_os.base.units import NS_PER_S

#: Number of pairs of origin and relay stored; the least recently used is removed.
FLOWS_MAXIMUM: Final = 4096
#: After a silence a node may send a burst of as many packets as its rate gives in this time.
BURST_S: Final = 2


class FlowLimit:
    """
    Limits packets by origin and relay, in bounded memory; safe in the loop.

    :ivar refused: packets beyond the rate.
    :ivar origin: origin of the last one, according to the packet; -1 for none.
    :ivar relay: node that delivered it; -1 if unknown.
    """

    __slots__ = ('refused', 'origin', 'relay', '_interval_ns', '_burst_ns', '_due_ns')

    def __init__(self, rate_hz: float) -> None:
        """
        Create an unused limit.

        :param rate_hz: accepted packets per second of each pair; 0 accepts all.
        """
        self.refused = 0
        self.origin = self.relay = -1
        self._interval_ns = round(NS_PER_S / rate_hz) if rate_hz else 0
        # At least one packet after a silence, whatever the rate.
        self._burst_ns = max(BURST_S * NS_PER_S - self._interval_ns, 0)
        self._due_ns: OrderedDict[tuple[int, int], int] = OrderedDict()

    @property
    def flows(self) -> int:
        """Return the number of pairs stored."""
        return len(self._due_ns)

    def accepts(self, origin: int, relay: int, now_ns: int) -> bool:
        """
        Return whether a packet is within the rate.

        :param origin: node that made it; -1 if unknown.
        :param relay: node that delivered it; -1 if unknown.
        """
        if not self._interval_ns:
            return True
        flows = self._due_ns
        flow = origin, relay
        due_ns = max(flows.get(flow, now_ns), now_ns)
        if due_ns - now_ns > self._burst_ns:
            self.refused += 1
            self.origin, self.relay = flow
            return False
        if flow not in flows and len(flows) >= FLOWS_MAXIMUM:
            flows.popitem(last=False)
        flows[flow] = due_ns + self._interval_ns
        flows.move_to_end(flow)
        return True

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

"""The state of one node of a network."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.battery_life import BatteryLife
from rt_robot_os.features.wsn.battery_life import Curve
from rt_robot_os.features.wsn.sensor_network.node_position import LinkLog
from rt_robot_os.features.wsn.sensor_network.node_position import PositionEstimate
from rt_robot_os.features.wsn.sensor_network.sequence_account import SequenceAccount
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState

#: As a parent: unknown.
NO_NODE: Final = -1
# Recent values cover one to two of these intervals.
_RECENT_NS: Final = 60 * NS_PER_S
# Height of a node whose position is estimated.
_USUAL_HEIGHT_M: Final = 1.0
# Largest number of packets by which a packet may be late.
_LATE_PACKETS: Final = 16


class NetworkNode:
    """
    A node, as its packets describe it.

    :ivar id: its id.
    :ivar name: from the survey; otherwise derived from its id.
    :ivar known: it is in the survey.
    :ivar surveyed: its position is known, too (no wearable): ``x``, ``y``, ``z`` in m.
    :ivar place: estimated position of a node that is not surveyed; None while unknown.
    :ivar account: of its packets by a counter in them; None without one.
    :ivar sink_account: the same, from the reports of the sink's own mote.
    :ivar plain: account by a number that identifies packets but does not count them.
    :ivar unnumbered: packets without a sequence number.
    :ivar parent: next node on the route to the sink.
    :ivar via: last node before the sink on the route of its last packet.
    :ivar parent_ns: time of the last report of the parent.
    :ivar delivered_ns: time of its last packet at the sink.
    :ivar heard_ns: time of the last packet; -1 for none.
    :ivar packets: packets with this node as their origin or sender.
    """

    __slots__ = ('id', 'name', 'known', 'surveyed', 'x', 'y', 'z', 'place', 'links', 'account',
                 'sink_account', 'plain', 'unnumbered', 'parent', 'via', 'parent_ns',
                 'delivered_ns', 'hops', 'cost', 'cost_ns', 'battery', 'heard_ns', 'first_ns',
                 'packets', 'asleep', 'claims_sink_ns', 'in_loop', 'state', 'set_period_ns',
                 '_clock', '_interval_ns', '_data_ns', '_recent', '_recent_ns')

    def __init__(self, number: int, name: str, curve: Curve) -> None:
        self.id = number
        self.name = name
        self.known = self.surveyed = False
        self.x = self.y = self.z = math.nan
        self.place: PositionEstimate | None = None
        self.links = LinkLog()
        self.account: SequenceAccount | None = None
        self.sink_account: SequenceAccount | None = None
        self.plain: SequenceAccount | None = None
        self.unnumbered = 0
        self.parent = self.via = NO_NODE
        self.parent_ns = self.delivered_ns = -1
        self.hops = NO_NODE
        self.cost = NO_NODE
        self.cost_ns = -1
        self.battery = BatteryLife(curve)
        self.heard_ns = self.first_ns = -1
        self.packets = 0
        self.asleep = False
        self.claims_sink_ns = -1
        self.in_loop = False
        self.state = NodeState.UNHEARD
        self.set_period_ns = 0
        self._clock = -1
        self._interval_ns = 0
        self._data_ns = -1
        # Received and lost, one and two intervals ago.
        self._recent = ((0, 0), (0, 0))
        self._recent_ns = -1

    # ---- packets -----------------------------------------------------------------------------

    def on_packet(self, now_ns: int) -> None:
        """Note a packet of any kind."""
        self.packets += 1
        self.heard_ns = now_ns
        if self.first_ns < 0:
            self.first_ns = now_ns

    def on_data(self, now_ns: int) -> None:
        """Note a packet with data, for the period of nodes whose packets have no counter."""
        if self._data_ns >= 0:
            passed_ns = now_ns - self._data_ns
            self._interval_ns += (passed_ns - self._interval_ns) // 8 if self._interval_ns else (
                passed_ns)
        self._data_ns = now_ns

    def clock_went_back(self, clock: int) -> bool:
        """Note a counter that only grows while the node runs; return whether it went back."""
        back = self._clock - clock & 0xFFFF
        if self._clock >= 0 and back < 1 << 15:
            if back <= _LATE_PACKETS:
                return False
            self._clock = clock
            return True
        self._clock = clock
        return False

    @property
    def exact(self) -> SequenceAccount | None:
        """Return the account that can count losses; None without one."""
        return self.account or self.sink_account

    @property
    def received(self) -> int:
        """Return the number of packets received, without duplicates."""
        counted = sum(each.received for each in (self.account, self.plain) if each)
        if not counted and self.sink_account:
            counted = self.sink_account.received
        return counted + self.unnumbered

    @property
    def duplicates(self) -> int:
        """Return the number of duplicates."""
        found = sum(each.duplicates for each in (self.account, self.plain) if each)
        if not found and self.sink_account and not self.plain:
            return self.sink_account.duplicates
        return found

    @property
    def lost(self) -> int:
        """Return the number of packets lost, as far as it is known."""
        return self.exact.lost if self.exact else 0

    @property
    def delivery(self) -> float:
        """Return the share of its packets that were received; NaN when unknown."""
        return self.exact.delivery if self.exact else math.nan

    @property
    def period_ns(self) -> int:
        """Return the usual time between its packets; 0 when unknown."""
        learned = self.exact.period_ns if self.exact else 0
        return max(self.set_period_ns, learned or self._interval_ns)

    def recent(self, now_ns: int) -> float:
        """Return the share of its packets received in the last minutes; NaN when unknown."""
        if self.exact is None:
            return math.nan
        now = self.exact.received, self.exact.lost
        if self._recent_ns < 0 or now_ns - self._recent_ns >= _RECENT_NS:
            self._recent = now if self._recent_ns < 0 else self._recent[1], now
            self._recent_ns = now_ns
        before = self._recent[0]
        came, lost = now[0] - before[0], now[1] - before[1]
        return max(0.0, min(1.0, came / (came + lost))) if came + lost > 0 else math.nan

    # ---- rows --------------------------------------------------------------------------------

    def row(self, now_ns: int) -> NodeRow:
        """Return its row for publication."""
        place = self.place
        if self.surveyed:
            x, y, z, stddev_m = self.x, self.y, self.z, 0.0
        elif place is not None:
            x, y, z, stddev_m = place.x, place.y, _USUAL_HEIGHT_M, place.stddev_m
        else:
            x = y = z = stddev_m = math.nan
        return NodeRow(
            self.id, x, y, z, stddev_m, self.parent if self.parent >= 0 else self.via,
            self.hops if self.hops >= 0 else math.nan, self.cost if self.cost >= 0 else math.nan,
            self.state, self.battery.volts, self.battery.days_left(), self.delivery,
            self.recent(now_ns), self.received, self.lost, self.duplicates,
            self.exact.reboots if self.exact else 0,
            (now_ns - self.heard_ns) / NS_PER_S if self.heard_ns >= 0 else math.nan)

    def summary(self) -> str:
        """Return a line for the diagnostics."""
        words = [NodeState(self.state).name.lower(), f'{self.received} packets']
        if self.exact:
            words.append(f'delivery {self.delivery:.3f}')
        if self.parent >= 0:
            words.append(f'parent {self.parent}')
        if self.battery.volts == self.battery.volts:
            words.append(f'{self.battery.volts:.2f} V')
        return ', '.join(words)

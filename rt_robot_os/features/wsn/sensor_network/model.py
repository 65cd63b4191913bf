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
A model of a sensor network, from the packets that arrive at the sink.

Its inputs are decoded packets and times; there is no bus and no clock. For each node it keeps its
route, its losses, its battery and its position. Everything is bounded, nothing raises, and packets
that cannot be used are counted with their problem. Safe in the real-time loop.
"""

from __future__ import annotations

from collections.abc import Iterable
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.battery_life import Curve
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.debug import CollectionDebug
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.sensor_network.counters import ModelCounters
from rt_robot_os.features.wsn.sensor_network.counters import ProblemCounts
from rt_robot_os.features.wsn.sensor_network.counters import TypeCounts
from rt_robot_os.features.wsn.sensor_network.node import NetworkNode
from rt_robot_os.features.wsn.sensor_network.node import NO_NODE
from rt_robot_os.features.wsn.sensor_network.node_position import lqi_of_beacon_share
from rt_robot_os.features.wsn.sensor_network.node_position import lqi_of_etx
from rt_robot_os.features.wsn.sensor_network.node_position import lqi_of_link_cost
from rt_robot_os.features.wsn.sensor_network.sequence_account import DUPLICATE
from rt_robot_os.features.wsn.sensor_network.sequence_account import SequenceAccount
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.quantities import QUANTITIES
from rt_robot_os.messages.survey import HIGHEST_ID
from rt_robot_os.messages.survey import SurveyedNode

_UART: Final = 0x7E  # in TinyOS 1.x, where no node has this id
# Costs of MultiHopLQI and CTP from here on mean that there is no route.
_NO_ROUTE: Final = 0xFFFE
_MOST_HOPS: Final = 0xFE
# A parent's cost older than this does not describe the present link.
_COST_AGE_NS: Final = 70 * NS_PER_S
# Links of a wearable node older than this belong to another position.
_WORN_NS: Final = 20 * NS_PER_S
_MOST_NEIGHBOURS: Final = 16


class NetworkModel:
    """
    A network of nodes.

    :ivar nodes: by id, without the sink.
    :ivar counters: see :class:`ModelCounters`.
    :ivar unknown_types: AM types without a declaration.
    :ivar problems: problems of packets.
    :ivar sink_place: x, y and z of the sink in m; NaN while unknown.
    """

    def __init__(self, survey: Iterable[SurveyedNode] = (), *, sink_id: int = 0,
                 group: int | None = None, max_nodes: int = 256, since_ns: int = 0,
                 curve: Curve | None = None) -> None:
        """
        Create the surveyed nodes.

        :param sink_id: id of the sink's own mote.
        :param group: of this network; packets of other groups are only counted. None accepts
            all groups.
        :param max_nodes: largest number of nodes besides those of the survey.
        :param since_ns: earliest possible time of the first packet.
        :param curve: discharge curve of the batteries.
        """
        self.sink_id = sink_id
        self.group = group
        self.max_nodes = max_nodes
        self.nodes: dict[int, NetworkNode] = {}
        self.counters = ModelCounters()
        self.unknown_types = TypeCounts()
        self.problems = ProblemCounts()
        self.sink_place = math.nan, math.nan, math.nan
        self.last_ns = -1
        self._since_ns = since_ns
        self._curve = curve or Curve()
        self._surveyed = 0
        for each in survey:
            if each.id == sink_id:
                self.sink_place = each.x, each.y, each.z
                continue
            node = self.nodes[each.id] = NetworkNode(each.id, each.name, self._curve)
            node.known = True
            if each.person:
                node.links.age_ns = _WORN_NS
            else:
                node.surveyed = True
                node.x, node.y, node.z = each.x, each.y, each.z
            self._surveyed += 1

    # ---- input -------------------------------------------------------------------------------

    def update(self, packet: Packet, now_ns: int) -> bool:
        """
        Update the model with a packet; never raises.

        :return: whether it is new to the application: False for duplicates and for packets
            without data.
        """
        counters = self.counters
        counters.packets += 1
        self.last_ns = now_ns
        if self.group is not None and packet.group not in (self.group, -1):
            counters.foreign_groups += 1
            return False
        if packet.problem:
            counters.problems += 1
            self.problems.add(packet.problem)
        kind = packet.kind
        if kind == 'data':
            counters.data += 1
            return self._data(packet, now_ns)
        if kind == 'beacon':
            counters.beacons += 1
            if not packet.problem:
                self._beacon(packet, now_ns)
        elif kind == 'debug':
            counters.debug += 1
            if not packet.problem:
                self._debug(packet, now_ns)
        elif kind == 'command':
            counters.commands += 1
        else:
            counters.unknown += 1
            if packet.am_type >= 0:
                self.unknown_types.add(packet.am_type)
        return False

    def sink_at(self, x: float, y: float, z: float = 0.0) -> None:
        """Set the present position of the sink, in m."""
        self.sink_place = x, y, z

    def command(self, text: str) -> None:
        """Note a command to nodes: a node that is put to sleep is not silent."""
        words = text.split()
        if len(words) < 2:
            return
        meant = [node for node in self.nodes.values() if words[1] in (
            str(node.id), node.name, 'all', '65535', '0xFFFF', '0xffff')]
        for node in meant:
            if words[0] in ('sleep', 'wake'):
                node.asleep = words[0] == 'sleep'
            elif words[0] == 'rate' and len(words) == 3 and words[2].isascii() and (
                    words[2].isdigit()):
                node.set_period_ns = int(words[2][:9]) * 1_000_000

    def node(self, number: int) -> NetworkNode | None:
        """Return a node, created if new; None when there is no room or the id is not valid."""
        found = self.nodes.get(number)
        if found is not None or not 0 <= number <= HIGHEST_ID or number == self.sink_id:
            return found
        if len(self.nodes) - self._surveyed >= self.max_nodes and not self._evict_node():
            self.counters.nodes_refused += 1
            return None
        found = self.nodes[number] = NetworkNode(number, f'node_{number}', self._curve)
        return found

    def rows(self, now_ns: int) -> list[NodeRow]:
        """Return a row for the sink, then one for each node, sorted by id."""
        x, y, z = self.sink_place
        nan = math.nan
        age_s = nan if self.last_ns < 0 else (now_ns - self.last_ns) / NS_PER_S
        sink = NodeRow(self.sink_id, x, y, z, 0.0, NO_NODE, 0, 0, NodeState.SINK, nan, nan, nan,
                       nan, 0, 0, 0, 0, age_s)
        return [sink, *(self.nodes[number].row(now_ns) for number in sorted(self.nodes))]

    # ---- kinds of packets --------------------------------------------------------------------

    def _data(self, packet: Packet, now_ns: int) -> bool:
        node = self.node(packet.origin) if packet.origin >= 0 else None
        if node is None:
            self.counters.without_origin += packet.origin < 0
            return packet.origin == self.sink_id
        node.on_packet(now_ns)
        node.on_data(now_ns)
        verdict = self._account(node, packet, now_ns)
        if packet.problem:
            return False
        self._learn_route(node, packet, now_ns)
        volts = packet.readings.get('battery')
        if verdict != DUPLICATE and volts is not None and QUANTITIES['battery'].plausible(volts):
            node.battery.add(volts, now_ns)
        return verdict != DUPLICATE

    def _account(self, node: NetworkNode, packet: Packet, now_ns: int) -> int:
        if packet.count_bits:
            account = node.account
            if account is None or account.bits != packet.count_bits:
                account = node.account = SequenceAccount(packet.count_bits, self._since_ns)
            renewed = packet.name == 'oscilloscope' and node.clock_went_back(
                packet.fields['count'])
            return account.add(packet.count, _fingerprint(packet), now_ns, renewed)
        if packet.origin_seqno >= 0:
            if node.plain is None:
                node.plain = SequenceAccount(16, now_ns)
            return node.plain.add(packet.origin_seqno, _fingerprint(packet), now_ns)
        node.unnumbered += 1
        return 0

    def _learn_route(self, node: NetworkNode, packet: Packet, now_ns: int) -> None:
        """Learn the route of a data packet."""
        if packet.parent >= 0:
            self._set_parent(node, packet.parent, now_ns)
        hops = packet.hops
        so_far = packet.am_type == CtpData.AM_TYPE and packet.stack == 'tinyos2'
        if hops >= 0 and (not so_far or packet.destination == self.sink_id):
            node.hops = hops if 0 < hops <= _MOST_HOPS else NO_NODE
        source, destination = packet.source, packet.destination
        if source < 0 or source == self.sink_id:
            node.delivered_ns = now_ns
            return  # the sink's own mote put its id there
        sender = node if source == node.id else self.node(source)
        if sender is None:
            return
        if sender is not node:
            sender.on_packet(now_ns)
        if destination <= HIGHEST_ID and not (destination == _UART and packet.stack == 'tinyos1'):
            self._set_parent(sender, destination, now_ns)
        if destination == self.sink_id:
            node.via = source
            node.delivered_ns = now_ns
        self._note_sink_link(sender, now_ns)

    def _beacon(self, packet: Packet, now_ns: int) -> None:
        number = packet.source if packet.source >= 0 else packet.origin
        node = self.node(number) if number >= 0 else None
        if node is None:
            self.counters.without_origin += number < 0
            return
        node.on_packet(now_ns)
        self._route(node, packet.parent, packet.hops, packet.cost, now_ns,
                    packet.am_type == CtpBeacon.AM_TYPE and packet.stack == 'tinyos2')
        if node.parent != self.sink_id:
            self._note_sink_link(node, now_ns)
        for each in packet.fields.get('neighbours', ())[:_MOST_NEIGHBOURS]:
            other = self.nodes.get(each['address'])
            if other is not None and other is not node:
                self._link(node, other, now_ns, lqi_of_beacon_share(each['quality'] / 250))

    def _debug(self, packet: Packet, now_ns: int) -> None:
        fields, is_ctp = packet.fields, packet.am_type == CollectionDebug.AM_TYPE
        if packet.origin >= 0 and packet.origin != self.sink_id:
            node = self.node(packet.origin)
            if node is not None:
                node.on_packet(now_ns)
                if packet.name == 'new_parent':
                    self._route(node, packet.parent, packet.hops, packet.cost, now_ns, is_ctp)
            return
        if packet.name == 'received':
            self._reported(fields['message'], fields['origin'], fields['other'], is_ctp, now_ns)
        elif packet.name == 'beacon_received':
            node = self.node(fields['parent'])
            if node is not None:
                node.on_packet(now_ns)
                self._note_sink_link(node, now_ns)
                self._cost(node, fields['metric'], now_ns)
        elif packet.name == 'loop':
            self.counters.loops_told += 1

    def _reported(self, number: int, origin: int, last: int, is_ctp: bool, now_ns: int) -> None:
        """Evaluate a report of the sink's own mote on a packet that it received."""
        node = self.node(origin)
        if node is None:
            return
        if node.sink_account is None:
            node.sink_account = SequenceAccount(8 if is_ctp else 16, self._since_ns)
        node.sink_account.add(number, number, now_ns)
        node.delivered_ns = now_ns
        if not is_ctp:
            return
        node.via = last
        if last == origin:
            self._set_parent(node, self.sink_id, now_ns)
            node.hops = 1
        elif node.parent == self.sink_id:
            node.parent = node.hops = NO_NODE

    # ---- routes ------------------------------------------------------------------------------

    def _route(self, node: NetworkNode, parent: int, hops: int, cost: int, now_ns: int,
               is_ctp: bool) -> None:
        """Learn the route that a node reports."""
        if cost == 0 or parent == node.id:
            node.claims_sink_ns = now_ns
            return
        node.parent = parent if 0 <= parent <= HIGHEST_ID else NO_NODE
        node.parent_ns = now_ns
        node.hops = hops if 0 < hops <= _MOST_HOPS else NO_NODE
        self._cost(node, cost, now_ns)
        if node.parent < 0 or node.cost < 0:
            return
        other = self.nodes.get(node.parent)
        before = 0
        if node.parent != self.sink_id:
            if other is None or other.cost < 0 or now_ns - other.cost_ns > _COST_AGE_NS:
                return
            before = other.cost
        if node.cost > before:
            link = node.cost - before
            self._link(node, other, now_ns, (
                lqi_of_etx(link / 10) if is_ctp else lqi_of_link_cost(link)))

    def _cost(self, node: NetworkNode, cost: int, now_ns: int) -> None:
        node.cost = cost if 0 < cost < _NO_ROUTE else NO_NODE
        node.cost_ns = now_ns
        if cost == 0:
            node.claims_sink_ns = now_ns

    def _set_parent(self, node: NetworkNode, parent: int, now_ns: int) -> None:
        known = 0 <= parent <= HIGHEST_ID and parent != node.id
        node.parent = parent if known else NO_NODE
        node.parent_ns = now_ns
        if known and not node.surveyed:
            other = self.nodes.get(parent)
            if other is not None or parent == self.sink_id:
                self._link(node, other, now_ns)

    def _note_sink_link(self, node: NetworkNode, now_ns: int) -> None:
        """Note that the sink receives a node; its present position helps to locate the node."""
        if not node.surveyed:
            self._link(node, None, now_ns)

    def _link(self, node: NetworkNode, other: NetworkNode | None, now_ns: int,
              lqi: float | None = None) -> None:
        """
        Use a link between two nodes to estimate their positions.

        :param other: None for the sink.
        :param lqi: None where only the existence of the link is known.
        """
        if other is None:
            x, y, _ = self.sink_place
            if not node.surveyed and x == x and y == y:
                node.links.note((round(x), round(y)), x, y, now_ns, lqi)
        elif other.surveyed and not node.surveyed:
            node.links.note(other.id, other.x, other.y, now_ns, lqi)
        elif node.surveyed and not other.surveyed:
            other.links.note(node.id, node.x, node.y, now_ns, lqi)

    def _evict_node(self) -> bool:
        """Remove the node that sent one packet, longest ago: probably a damaged address."""
        once = [node for node in self.nodes.values()
                if not node.known and node.packets <= 1 and node.heard_ns < self.last_ns]
        if not once:
            return False
        del self.nodes[min(once, key=lambda node: node.heard_ns).id]
        self.counters.nodes_forgotten += 1
        return True


def _fingerprint(packet: Packet) -> int:
    """Return a hash that is the same for each copy of a packet, whatever its route."""
    fields = packet.fields
    return hash((packet.name, *((name, value) for name, value in fields.items() if type(
        value) is int and name not in _PER_HOP), *packet.readings.values()))


# Fields of headers that change at each hop.
_PER_HOP: Final = frozenset(('seqno', 'options', 'thl', 'etx'))

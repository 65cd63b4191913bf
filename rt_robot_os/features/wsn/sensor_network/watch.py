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
Evaluates a network: a text for each trouble, and the state of each node.

An evaluation takes a few us per node and is intended for once a second. Safe in the real-time
loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.sensor_network.model import NetworkModel
from rt_robot_os.features.wsn.sensor_network.node import NetworkNode
from rt_robot_os.messages.network_rows import NodeState

#: Largest number of troubles in the warning; the others are counted.
MOST_REPORTED: Final = 5
# How long an event is reported.
_EVENT_NS: Final = 60 * NS_PER_S
# Least number of packets for a meaningful share.
_ENOUGH: Final = 10
# Number of evaluations between two position estimates of a node.
_PLACE_ROUNDS: Final = 10


@dataclass
class NetworkLimits:
    """
    Limits of the evaluation.

    :ivar silent_periods: number of a node's own periods without a packet until it is silent.
    :ivar silent_s: least time in s until it is silent; ten times that while its period is
        unknown.
    :ivar delivery: share of packets received below which a node is weak.
    :ivar battery_v: voltage below which its battery is nearly empty.
    :ivar days: remaining days below which its battery is nearly empty.
    """

    silent_periods: float = 10.0
    silent_s: float = 10.0
    delivery: float = 0.8
    battery_v: float = 2.2
    days: float = 3.0


class Trouble(NamedTuple):
    """
    A problem of a node or of the network.

    :ivar kind: such as ``silent``; with ``node`` it identifies the trouble.
    :ivar node: id of the node; -1 for the network.
    :ivar text: description for the diagnostics.
    """

    kind: str
    node: int
    text: str


class NetworkWatch:
    """
    Evaluates the nodes of a network.

    :ivar limits: see :class:`NetworkLimits`; may be changed at any time.
    :ivar troubles: of the last evaluation.
    :ivar silent: number of silent nodes, as are ``weak``, ``good`` and ``unheard``.
    """

    def __init__(self, model: NetworkModel, limits: NetworkLimits | None = None) -> None:
        self.limits = limits or NetworkLimits()
        self.troubles: tuple[Trouble, ...] = ()
        self.good = self.weak = self.silent = self.unheard = 0
        self._model = model
        self._rounds = 0
        self._since_ns = -1
        self._counts: dict[int, tuple[int, int]] = {}
        self._events: dict[tuple[str, int], tuple[int, str]] = {}

    def evaluate(self, now_ns: int) -> None:
        """Evaluate every node."""
        model = self._model
        found: list[Trouble] = []
        states = dict.fromkeys(NodeState, 0)
        for node in model.nodes.values():
            node.in_loop = False
        found += self._loops()
        for node in model.nodes.values():
            if self._rounds % _PLACE_ROUNDS == node.id % _PLACE_ROUNDS and not node.surveyed:
                node.place = node.links.place(now_ns) or node.place
            self._note_events(node, now_ns)
            node.state, own = self._evaluate_node(node, now_ns)
            states[node.state] += 1
            found += own
        self._counts = {number: each for number, each in self._counts.items()
                        if number in model.nodes}
        self._events = {key: each for key, each in self._events.items()
                        if now_ns - each[0] <= _EVENT_NS and key[1] in model.nodes}
        found += (Trouble(kind, number, text)
                  for (kind, number), (_, text) in self._events.items())
        if self._since_ns < 0:
            self._since_ns = now_ns
        found += self._evaluate_network(now_ns)
        self._rounds += 1
        self.good, self.weak = states[NodeState.GOOD], states[NodeState.WEAK]
        self.silent, self.unheard = states[NodeState.SILENT], states[NodeState.UNHEARD]
        self.troubles = tuple(found)

    def warning(self) -> str:
        """Return the troubles as one text; empty when there are none."""
        told = [each.text for each in self.troubles[:MOST_REPORTED]]
        if len(self.troubles) > MOST_REPORTED:
            told.append(f'and {len(self.troubles) - MOST_REPORTED} more')
        return '; '.join(told)

    # ---- one node ----------------------------------------------------------------------------

    def _evaluate_node(self, node: NetworkNode, now_ns: int) -> tuple[NodeState, list[Trouble]]:
        name, limits = name_of(node), self.limits
        found: list[Trouble] = []
        state = NodeState.GOOD
        if node.heard_ns < 0:
            return NodeState.UNHEARD, found
        volts = node.battery.volts
        days = node.battery.days_left()
        if volts < limits.battery_v:
            found.append(Trouble('battery', node.id, f'{name} has a battery voltage of '
                                                     f'{volts:.2f} V: change its battery'))
        elif days < limits.days:
            found.append(Trouble('battery', node.id, f'the battery of {name} will be empty in '
                                                     f'{days:.1f} days: change it'))
        recent = node.recent(now_ns)
        if recent < limits.delivery and node.received + node.lost >= _ENOUGH:
            found.append(Trouble('delivery', node.id, f'{name} loses {100 * (1 - recent):.0f} % '
                                 'of its packets: its route to the sink is bad or overloaded'))
        if found:
            state = NodeState.WEAK
        if node.in_loop:
            state = NodeState.DOUBTFUL
        if (doubt := self._address_conflict(node, now_ns)) is not None:
            state = NodeState.DOUBTFUL
            found.insert(0, doubt)
        if node.asleep:
            return NodeState.ASLEEP, []
        silent_ns = now_ns - node.heard_ns
        if silent_ns > self._silence_ns(node):
            return NodeState.SILENT, [Trouble(
                'silent', node.id, f'no packet from {name} for {silent_ns / NS_PER_S:.0f} s: '
                'check that it is on, and within range of the others')]
        return state, found

    def _address_conflict(self, node: NetworkNode, now_ns: int) -> Trouble | None:
        account = node.exact
        if account is not None and account.twins and now_ns - account.twin_ns <= _EVENT_NS:
            return Trouble('twins', node.id, f'two nodes have the id {node.id} ({node.name}): '
                           'their packets have two counters; give one of them another id')
        if node.claims_sink_ns >= 0 and now_ns - node.claims_sink_ns <= _EVENT_NS:
            return Trouble('claims', node.id, f'{name_of(node)} claims to be the sink (its cost '
                           f'is 0), which is {self._model.sink_id}: packets sent to it are lost')
        return None

    def _silence_ns(self, node: NetworkNode) -> int:
        limits = self.limits
        if not node.period_ns:
            return round(10 * limits.silent_s * NS_PER_S)
        return max(round(limits.silent_s * NS_PER_S), round(limits.silent_periods
                                                            * node.period_ns))

    def _note_events(self, node: NetworkNode, now_ns: int) -> None:
        """Note reboots and jumps, which are reported for some time."""
        account = node.exact
        if account is None:
            return
        before = self._counts.get(node.id)
        now = account.reboots, account.jumps
        self._counts[node.id] = now
        if before is None or now == before:
            return
        if now[0] > before[0]:
            self._events['reboot', node.id] = now_ns, (
                f'{name_of(node)} rebooted ({now[0]} times so far): check its battery')
        if now[1] > before[1]:
            self._events['jump', node.id] = now_ns, (
                f'the counter of {name_of(node)} jumped ({now[1]} times so far): the losses '
                'are unknown')

    # ---- the network -------------------------------------------------------------------------

    def _loops(self) -> list[Trouble]:
        """Find nodes whose parents lead back to themselves."""
        nodes, found = self._model.nodes, []
        done: set[int] = set()
        for start in nodes:
            way: dict[int, int] = {}
            number = start
            while number in nodes and number not in done and number not in way:
                way[number] = len(way)
                number = nodes[number].parent
            if number in way:
                ring = list(way)[way[number]:]
                done.update(way)
                # Packets from within it show that the parents were reported at different times.
                if max(nodes[each].delivered_ns for each in ring) >= min(
                        nodes[each].parent_ns for each in ring):
                    continue
                for each in ring:
                    nodes[each].in_loop = True
                told = ' > '.join(map(str, [*ring[:8], '...' if len(ring) > 8 else ring[0]]))
                found.append(Trouble('loop', min(ring), f'routing loop {told}: the packets of '
                                     'these nodes do not reach the sink'))
            done.update(way)
        return found

    def _evaluate_network(self, now_ns: int) -> list[Trouble]:
        model = self._model
        counters, found = model.counters, []
        silent_ns = round(self.limits.silent_s * NS_PER_S)
        if not counters.packets and now_ns - self._since_ns >= silent_ns:
            found.append(Trouble('nothing', -1, 'no packet so far: check that the sink is '
                                                'connected'))
        if counters.nodes_refused:
            found.append(Trouble('refused', -1, f'{counters.nodes_refused} packets of further '
                                 'nodes outside the survey are not used: increase max_nodes, '
                                 f'{model.max_nodes}, or set group'))
        if counters.packets and counters.foreign_groups == counters.packets:
            found.append(Trouble('group', -1, 'every packet is of another group than '
                                 f'{model.group}: set group'))
        return found


def name_of(node: NetworkNode) -> str:
    """Return the name of a node for texts."""
    return f'node {node.id}' if not node.known else f'{node.name} (node {node.id})'

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
What is wrong in a network: a text for each trouble, and the state of each node.

A round over all nodes, some us each; meant for once a second. Safe in the real-time loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.sensor_network.model import NetworkModel
from rt_robot_os.features.wsn.sensor_network.node import NetworkNode
from rt_robot_os.messages.network_rows import NodeState

#: Troubles that are told at once, at most; the rest are counted.
MOST_REPORTED: Final = 5
# How long something that happened once is told.
_EVENT_NS: Final = 60 * NS_PER_S
# Below so many packets a share says little.
_ENOUGH: Final = 10
# The place of a node is estimated anew so often, in rounds.
_PLACE_ROUNDS: Final = 10


@dataclass
class NetworkLimits:
    """
    What counts as trouble.

    :ivar silent_periods: so many of a node's own periods without a packet are silence.
    :ivar silent_s: the same in s, at least; for nodes whose period is not known, ten times that.
    :ivar delivery: share of packets below which a node is weak.
    :ivar battery_v: volts below which its battery is nearly empty.
    :ivar days: days left below which it is, too.
    """

    silent_periods: float = 10.0
    silent_s: float = 10.0
    delivery: float = 0.8
    battery_v: float = 2.2
    days: float = 3.0


class Trouble(NamedTuple):
    """
    Something that is wrong.

    :ivar kind: such as ``silent``; with ``node`` it tells one trouble from another.
    :ivar node: its number; -1 when it is none of a node.
    :ivar text: for people.
    """

    kind: str
    node: int
    text: str


class NetworkWatch:
    """
    Look after a network.

    :ivar limits: see :class:`NetworkLimits`; may be changed at any time.
    :ivar troubles: of the last round, the worst first.
    :ivar silent: how many nodes are silent now; so are ``weak``, ``good`` and ``unheard``.
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
        """Judge every node."""
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
            found.append(Trouble('battery', node.id, f'{name} has {volts:.2f} V left: change its '
                                                     'battery'))
        elif days < limits.days:
            found.append(Trouble('battery', node.id, f'the battery of {name} lasts {days:.1f} '
                                                     'days more: change it'))
        recent = node.recent(now_ns)
        if recent < limits.delivery and node.received + node.lost >= _ENOUGH:
            found.append(Trouble('delivery', node.id, f'{name} loses {100 * (1 - recent):.0f} % '
                                 'of its packets: its way to the sink is bad, or overloaded'))
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
                'silent', node.id, f'nothing has been heard of {name} for '
                f'{silent_ns / NS_PER_S:.0f} s: is it on, and within reach of the others?')]
        return state, found

    def _address_conflict(self, node: NetworkNode, now_ns: int) -> Trouble | None:
        account = node.exact
        if account is not None and account.twins and now_ns - account.twin_ns <= _EVENT_NS:
            return Trouble('twins', node.id, f'two nodes have the number {node.id} ({node.name}): '
                           'their packets count side by side; give one of them another number')
        if node.claims_sink_ns >= 0 and now_ns - node.claims_sink_ns <= _EVENT_NS:
            return Trouble('claims', node.id, f'{name_of(node)} claims to be the sink (its cost '
                           f'is 0), which is {self._model.sink_id}: what goes there is lost')
        return None

    def _silence_ns(self, node: NetworkNode) -> int:
        limits = self.limits
        if not node.period_ns:
            return round(10 * limits.silent_s * NS_PER_S)
        return max(round(limits.silent_s * NS_PER_S), round(limits.silent_periods
                                                            * node.period_ns))

    def _note_events(self, node: NetworkNode, now_ns: int) -> None:
        """Notice reboots and jumps: they are told for a while."""
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
                f'{name_of(node)} began anew ({now[0]} times so far): look at its battery')
        if now[1] > before[1]:
            self._events['jump', node.id] = now_ns, (
                f'the counter of {name_of(node)} jumped ({now[1]} times so far): what was lost '
                'there is not known')

    # ---- the whole ---------------------------------------------------------------------------

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
                # What comes from within it shows that parents were only said at different times.
                if max(nodes[each].delivered_ns for each in ring) >= min(
                        nodes[each].parent_ns for each in ring):
                    continue
                for each in ring:
                    nodes[each].in_loop = True
                told = ' > '.join(map(str, [*ring[:8], '...' if len(ring) > 8 else ring[0]]))
                found.append(Trouble('loop', min(ring), f'the parents of nodes lead in a circle, '
                                     f'{told}: what they send does not reach the sink'))
            done.update(way)
        return found

    def _evaluate_network(self, now_ns: int) -> list[Trouble]:
        model = self._model
        counters, found = model.counters, []
        silent_ns = round(self.limits.silent_s * NS_PER_S)
        if not counters.packets and now_ns - self._since_ns >= silent_ns:
            found.append(Trouble('nothing', -1, 'no packet has come yet: is the sink connected?'))
        if counters.nodes_refused:
            found.append(Trouble('refused', -1, f'{counters.nodes_refused} packets came of more '
                                 f'than max_nodes {model.max_nodes} nodes that nobody surveyed: '
                                 'set it higher, or set group'))
        if counters.packets and counters.foreign_groups == counters.packets:
            found.append(Trouble('group', -1, 'every packet is of another group than '
                                 f'{model.group}: set group'))
        return found


def name_of(node: NetworkNode) -> str:
    """Return what a node is called in texts."""
    return f'node {node.id}' if not node.known else f'{node.name} (node {node.id})'

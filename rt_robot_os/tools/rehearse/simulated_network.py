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

"""The sensor network in scenarios: the nodes of the world send real packets to the sink."""

from __future__ import annotations

from functools import partial
import math
from random import Random
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.packets.conversions import battery_raw
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.simulator.live_readings import NodeReadings
from rt_robot_os.messages.quantities import ALARMS
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.wireless import WirelessNode
from rt_robot_os.tools.rehearse.fixture import CoreFixture
from rt_robot_os.topics import Publisher

_UART: Final = 0x7E
_VOLTS: Final = 3.0
_ALARM_KINDS: Final = frozenset({Kind.ALARM, Kind.SMOKE, Kind.WATER})
_VITAL_KINDS: Final = frozenset({
    Kind.PULSE, Kind.RESPIRATION, Kind.SPO2, Kind.BODY_TEMPERATURE})
# Time between two packets of a node whose button is pressed.
_URGENT_NS: Final = NS_PER_S


class _Mote:
    """The state of a node between two packets."""

    def __init__(self, node: WirelessNode, readings: NodeReadings, number: int, first_ns: int
                 ) -> None:
        self.node, self.readings, self.number = node, readings, number
        self.turn = 0
        self.next_ns = first_ns
        self.alarms: dict[str, int] = {}
        self.boots = 1


class SimulatedNetwork:
    """
    Simulates sink and radio: readings arrive as packets of the paper, and some are lost.

    :param world: the world with the nodes.
    :param loss: share of packets that are lost.
    :param period_ns: time between two packets of a fixed node.
    :param worn_ns: time between two packets of a worn node.
    :ivar silent: the sink sends nothing.
    :ivar sent: packets that arrived.
    """

    def __init__(self, world: World, random: Random, loss: float = 0.02,
                 period_ns: int = 10 * NS_PER_S, worn_ns: int = 2 * NS_PER_S) -> None:
        self._random = random
        self._loss = loss
        self._period_ns, self._worn_ns = period_ns, worn_ns
        self.silent = False
        self.sent = 0
        self._nodes = world.wireless.nodes
        self._motes = [
            _Mote(node, NodeReadings(node, world, random, partial(self._nearest, node)),
                  node.surveyed.id,
                  int(random.random() * self._period(node)))
            for node in self._nodes]

    def _nearest(self, node: WirelessNode) -> int:
        """Return the number of the nearest fixed node, with a random error of a third."""
        x, y, _ = node.position_m
        fixed = [each for each in self._nodes if each.person is None and each.on]
        return min(fixed, default=node, key=lambda each: self._random.uniform(1.0, 1.4) * (
            math.dist((x, y), each.position_m[:2]))).surveyed.id

    def _period(self, node: WirelessNode) -> int:
        return self._worn_ns if node.person is not None else self._period_ns

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics of the classes."""
        self._topics = {name: fixture.publisher(f'wsn/packets/{name}')
                        for name in ('alarm', 'vital', 'rest')}

    def step(self, now_ns: int) -> None:
        """Send packets that are due."""
        for mote in self._motes:
            node = mote.node
            if not node.on:
                continue
            if node.alarms != mote.alarms:
                mote.alarms = node.alarms
                mote.next_ns, mote.turn = now_ns, -1
            if now_ns >= mote.next_ns:
                self._send(mote, now_ns)

    def _send(self, mote: _Mote, now_ns: int) -> None:
        node = mote.node
        quantities = node.surveyed.quantities
        urgent = [each for each in quantities if each in ALARMS]
        pressed = [each for each in urgent if node.alarms.get(each)] or urgent
        if node.boots != mote.boots:
            mote.boots, mote.turn = node.boots, 0
        if urgent and (mote.turn == -1 or node.alarms and mote.turn % 2):
            quantity = pressed[0]
        else:
            quantity = quantities[mote.turn % len(quantities)]
        mote.turn += 1
        mote.next_ns = now_ns + (_URGENT_NS if node.alarms else self._period(node))
        kind, raw = mote.readings.raw(quantity, now_ns / NS_PER_S, _VOLTS)
        if self.silent or self._random.random() < self._loss:
            return
        topic = self._topics['alarm' if kind in _ALARM_KINDS else
                             'vital' if kind in _VITAL_KINDS else 'rest']
        if topic is not None:
            self.sent += 1
            _publish(topic, mote, kind, raw)


def _publish(topic: Publisher, mote: _Mote, kind: Kind, raw: int) -> None:
    number = mote.turn & 0x7FFF
    data = DataMsg(0, raw, 0, mote.turn & 0xFFFFFFFF, kind, battery_raw(_VOLTS)).pack()
    packet = TelosMsg(_UART, DataMsg.AM_TYPE, MultihopMsg(
        0, mote.number, number, number, 1, data).pack(), 0x7D).pack()
    topic.fill(memoryview(packet))
    topic.publish()

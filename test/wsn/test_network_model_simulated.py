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

"""The model of a network against the truth of simulated ones: what was lost, exactly."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
import math
import random

import pytest
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.radio.mac import TINYOS1
from rt_robot_os.features.wsn.radio.mac import TINYOS2
from rt_robot_os.features.wsn.radio.path_loss import PathLoss
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.routing.least_cost import LeastCost
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi1
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi2
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.sensor_network.model import NetworkModel
from rt_robot_os.features.wsn.sensor_network.watch import NetworkWatch
from rt_robot_os.features.wsn.simulator.air import Link
from rt_robot_os.features.wsn.simulator.link_medium import LinkMedium
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.mote import Traffic
from rt_robot_os.features.wsn.simulator.network import Network
from rt_robot_os.features.wsn.simulator.path_loss_medium import PathLossMedium
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.survey import survey_of

S = 1_000_000_000
PERIOD_NS = 800 * S // 1024

PROTOCOLS: dict[str, tuple[bool, Callable[[Node, bool], Router]]] = {
    'paper': (True, LeastCost),
    'multihop_lqi_1': (True, lambda node, root: MultiHopLqi1(node, root, 4 * S)),
    'multihop_lqi_2': (False, lambda node, root: MultiHopLqi2(node, root, 4 * S)),
    'ctp': (False, Ctp)}


class Truth:
    """What applications made and what came, and a model that sees only the packets."""

    def __init__(self, protocol: str, rate: float, seed: int = 1) -> None:
        self.protocol = protocol
        self.is_t1, factory = PROTOCOLS[protocol]
        medium = LinkMedium(TINYOS1 if self.is_t1 else TINYOS2)
        for near, far in ((0, 1), (1, 2), (2, 3), (0, 4), (4, 5), (1, 4)):
            medium.set_link(near, far, Link(rate, -80, 100))
            medium.set_link(far, near, Link(rate, -80, 100))
        self.network = Network(medium, factory, mac=TINYOS1 if self.is_t1 else TINYOS2, seed=seed)
        self.model, self.decoder = NetworkModel(), PacketDecoder()
        self.made: dict[int, list[int]] = defaultdict(list)
        self.came: dict[int, set[tuple[int, int]]] = defaultdict(set)
        self.copies = self.new = 0
        self.watch = NetworkWatch(self.model)
        self._lives: dict[int, tuple[int, int]] = {}
        self.network.on_deliver = self._deliver
        for address in range(6):
            self.network.add(address, is_root=address == 0, traffic=Traffic(
                PERIOD_NS, self._build) if address else None, boot_ns=address * S // 7)

    def _build(self, mote: Mote, number: int) -> bytes:
        """Make a packet; its number counts from the mote's start, as on motes."""
        if self._lives.get(mote.address, (0, 0))[0] != mote.boots:
            self._lives[mote.address] = mote.boots, number
        number -= self._lives[mote.address][1]
        if self.is_t1:
            parent = mote.router.parent
            return DataMsg(0, 100 * mote.boots, 0xFFFF if parent is None else parent, number,
                           Kind.PULSE, 3800).pack()
        return Oscilloscope(mote.boots, 800, mote.address, number & 0xFFFF, bytes(10)).pack()

    def _deliver(self, mote: Mote, am_type: int, payload: bytes, origin: int,
                 application: bytes) -> None:
        if self.is_t1:
            message = DataMsg.unpack(application)
            life, number = message.reading // 100, message.seq_no
            packet = TelosMsg(0x7E, am_type, payload).pack()
        else:
            said = Oscilloscope.unpack(application)
            life, number = said.version, said.number
            packet = SerialAm(0, 0, am_type, payload).pack()
        is_new = (life, number) not in self.came[origin]
        self.came[origin].add((life, number))
        taken = self.model.update(self.decoder.decode(packet), self.network.queue.now_ns)
        assert taken == is_new, (origin, life, number)
        self.copies += not is_new
        self.new += is_new

    def lost(self, origin: int) -> int:
        """
        Return what was lost before the last packet that came, of each life.

        Of CTP without what the protocol had no room for: it gives that no number, and tells the
        application.
        """
        lives: dict[int, list[int]] = defaultdict(list)
        for life, number in self.came[origin]:
            lives[life].append(number)
        lost = sum(max(numbers) + 1 - len(numbers) for numbers in lives.values())
        return lost - (self.network.motes[origin].refused if self.protocol == 'ctp' else 0)

    def check(self) -> None:
        """Compare the model with the truth."""
        for origin in range(1, 6):
            node = self.model.nodes[origin]
            assert (node.received, node.lost) == (len(self.came[origin]), self.lost(origin))
            assert node.exact is not None and not node.exact.twins
            assert node.exact.reboots == len({life for life, _ in self.came[origin]}) - 1
        assert sum(node.duplicates for node in self.model.nodes.values()) == self.copies


@pytest.mark.parametrize('rate', [1.0, 0.7])
@pytest.mark.parametrize('protocol', PROTOCOLS)
def test_losses_of_each_origin_are_those_of_the_truth(protocol: str, rate: float) -> None:
    truth = Truth(protocol, rate)
    truth.network.run_until(150 * S)
    assert truth.new > 500
    truth.check()


@pytest.mark.parametrize('protocol', PROTOCOLS)
def test_nodes_that_fail_and_begin_again_are_accounted_for(protocol: str) -> None:
    truth = Truth(protocol, 0.9, seed=4)
    for address, at_s, down_s in ((3, 40, 5), (2, 90, 30), (5, 150, 2)):
        truth.network.at(at_s * S, truth.network.motes[address].kill)
        truth.network.at((at_s + down_s) * S, truth.network.motes[address].boot)
    truth.network.run_until(250 * S)
    truth.check()


def test_a_node_that_dies_is_silent_and_its_child_has_another_parent() -> None:
    truth = Truth('paper', 1.0)
    truth.network.run_until(60 * S)
    truth.watch.evaluate(60 * S)
    assert truth.model.nodes[5].parent == 4 and not truth.watch.troubles
    truth.network.motes[4].kill()
    truth.network.run_until(90 * S)
    truth.watch.evaluate(90 * S)
    states = {number: node.state for number, node in truth.model.nodes.items()}
    # 5 had no other way than through 4.
    assert states == {1: NodeState.GOOD, 2: NodeState.GOOD, 3: NodeState.GOOD,
                      4: NodeState.SILENT, 5: NodeState.SILENT}


def test_a_sink_that_drives_round_finds_nodes_that_nobody_surveyed() -> None:
    medium = PathLossMedium(PathLoss(exponent=3.2), [-96] * 10, TINYOS1)
    network = Network(medium, LeastCost, mac=TINYOS1, seed=1)
    chance = random.Random(1)
    places = {number: (chance.uniform(0, 12), chance.uniform(0, 9), 1.0)
              for number in range(1, 13)}
    model = NetworkModel(survey_of([f'n{number} {x} {y} {z}' for number, (x, y, z) in list(
        places.items())[:9]]))
    watch, decoder = NetworkWatch(model), PacketDecoder('tinyos1')

    def build(mote: Mote, number: int) -> bytes:
        parent = mote.router.parent
        return DataMsg(0, 6000, 0xFFFF if parent is None else parent, number, 1, 3800).pack()

    network.add(0, (1.0, 1.0, 0.3), is_root=True, power_dbm=-25.0)
    for number, place in places.items():
        network.add(number, place, power_dbm=-25.0, traffic=Traffic(PERIOD_NS, build))
    network.on_deliver = lambda mote, am_type, payload, origin, application: model.update(
        decoder.decode(TelosMsg(0x7E, am_type, payload).pack()), network.queue.now_ns)
    for second in range(1, 100):
        x = 6.0 + 5.0 * math.cos(0.04 * second)
        y = 4.5 + 3.5 * math.sin(0.08 * second)
        network.move(0, (x, y, 0.3))
        model.sink_at(x, y)
        network.run_until(second * S)
        watch.evaluate(second * S)
    errors = []
    for number in (10, 11, 12):
        found = model.nodes[number].place
        assert found is not None
        errors.append(math.dist(found[:2], places[number][:2]))
        assert errors[-1] < 3.0 * found.stddev_m
    # Half a room, not half a house.
    assert sorted(errors)[1] < 5.0

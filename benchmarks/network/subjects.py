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

"""What the case network measures: simulated sensor networks, and the queue of their events."""

from __future__ import annotations

from random import Random
from time import process_time_ns

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.radio.mac import TINYOS2
from rt_robot_os.features.wsn.radio.noise import quiet
from rt_robot_os.features.wsn.radio.path_loss import PathLoss
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi2
from rt_robot_os.features.wsn.simulator.events import Event
from rt_robot_os.features.wsn.simulator.events import EventQueue
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.mote import Traffic
from rt_robot_os.features.wsn.simulator.network import Network
from rt_robot_os.features.wsn.simulator.path_loss_medium import PathLossMedium
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement

_SPACING_M = 35.0
_NODES_PER_SINK = 1000
_PAYLOAD_BYTES = 18
_NOISE_SAMPLES = 1 << 16
_WARM_UP_S = 100
_STEP_NS = NS_PER_S // 4


def _reading(mote: Mote, number: int) -> bytes:
    return number.to_bytes(_PAYLOAD_BYTES, 'big')


def grid(nodes: int, period_ns: int) -> Network:
    """
    Make a network on a grid, one sink for a thousand nodes.

    :param period_ns: of each node's readings.
    """
    random = Random(1)
    medium = PathLossMedium(
        PathLoss(one_metre_db=40.0, exponent=3.0), quiet(random, _NOISE_SAMPLES), TINYOS2)
    network = Network(medium, MultiHopLqi2, seed=1)
    columns = max(1, round(nodes ** 0.5))
    first_sink = min(nodes, _NODES_PER_SINK) // 2 + columns // 2
    for address in range(nodes):
        row, column = divmod(address, columns)
        network.add(address, (_SPACING_M * column, _SPACING_M * row, 1.5),
                    is_root=address % _NODES_PER_SINK == first_sink % nodes,
                    boot_ns=int(random.random() * NS_PER_S),
                    traffic=Traffic(period_ns, _reading, jitter_ns=period_ns // 2))
    return network


def simulate(harness: Harness) -> Measurement:
    """Run a network, first until it has its tree."""
    nodes = harness.arguments['nodes']
    begun_ns = process_time_ns()
    network = grid(nodes, int(harness.arguments['period_s'] * NS_PER_S))
    set_up_ns = process_time_ns() - begun_ns
    queue, outcomes = network.queue, network.medium.outcomes
    network.run_until(_WARM_UP_S * NS_PER_S)
    harness.prepare(freeze=True)
    events, decided = queue.executed, sum(outcomes)
    begun_ns, simulated_ns = process_time_ns(), queue.now_ns
    while process_time_ns() - begun_ns < harness.arguments['measure_ns']:
        network.run_until(queue.now_ns + _STEP_NS)
    spent_ns = process_time_ns() - begun_ns
    events = queue.executed - events
    return Measurement({}, {
        'times_real_time': (queue.now_ns - simulated_ns) / spent_ns,
        'event_us': spent_ns / 1000 / max(1, events),
        'decided_us': spent_ns / 1000 / max(1, sum(outcomes) - decided),
        'set_up_s': set_up_ns / NS_PER_S,
        'routed': 100 * sum(mote.is_root or mote.router.parent not in (None, 0xFFFF)
                            for mote in network.motes.values()) / nodes})


def own_queue(harness: Harness) -> Measurement:
    """Plan events again and again."""
    queue, random = EventQueue(), Random(1).random

    class Node:
        """Plans itself."""

        __slots__ = ('event',)

        def __init__(self) -> None:
            self.event = Event(self.go)
            self.go()

        def go(self) -> None:
            """Be planned for some time within a second."""
            queue.at(queue.now_ns + int(random() * NS_PER_S) + 1, self.event)

    for _ in range(harness.arguments['nodes']):
        Node()
    harness.prepare(freeze=True)
    step_ns = max(1, 20_000 * NS_PER_S // (2 * harness.arguments['nodes']))
    queue.run_until(step_ns)
    events, begun_ns = queue.executed, process_time_ns()
    while process_time_ns() - begun_ns < harness.arguments['measure_ns']:
        queue.run_until(queue.now_ns + step_ns)
    spent_ns = process_time_ns() - begun_ns
    return Measurement({}, {'event_us': spent_ns / 1000 / (queue.executed - events)})

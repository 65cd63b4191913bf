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
A simulated network around a robot, in the robot's time: its motes are the nodes of a world.

Its owner calls :meth:`LiveNetwork.advance` with the current time; the network then runs up to it.
The sink has the robot's position, the nodes have those of the world. Walls and people attenuate
signals.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
import math
from random import Random
from typing import Final

from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.radio.mac import MAC_PROFILES
from rt_robot_os.features.wsn.radio.noise import heavy
from rt_robot_os.features.wsn.radio.noise import quiet
from rt_robot_os.features.wsn.radio.path_loss import PathLoss
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.simulator.air import ACK
from rt_robot_os.features.wsn.simulator.air import Radio
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.base_station import BaseStation
from rt_robot_os.features.wsn.simulator.base_station import Outgoing
from rt_robot_os.features.wsn.simulator.base_station import Station
from rt_robot_os.features.wsn.simulator.energy import PowerModel
from rt_robot_os.features.wsn.simulator.live_application import command_router
from rt_robot_os.features.wsn.simulator.live_application import Flood
from rt_robot_os.features.wsn.simulator.live_application import NodeApplication
from rt_robot_os.features.wsn.simulator.live_readings import Environment
from rt_robot_os.features.wsn.simulator.live_readings import LiveNode
from rt_robot_os.features.wsn.simulator.live_readings import NodeReadings
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.network import Network
from rt_robot_os.features.wsn.simulator.network import RouterFactory
from rt_robot_os.features.wsn.simulator.path_loss_medium import PathLossMedium
from rt_robot_os.features.wsn.simulator.scenario import Scenario

Position = tuple[float, float, float]

_NS_PER_S: Final = 1_000_000_000
# Period of checks of the nodes, and of the people between them.
_LOOK_NS: Final = _NS_PER_S // 10
_SHADOWS_NS: Final = _NS_PER_S
# Movements below this distance change no link.
_STEP_M: Final = 0.1
# After a longer suspension of the process the network continues at the current time.
_CATCH_UP_NS: Final = 5 * _NS_PER_S
_BOOT_SPREAD_NS: Final = _NS_PER_S
_PERSON_RADIUS_M: Final = 0.25
_PAIRS_KEPT: Final = 20_000
# Charge that batteries have used at the start.
_USED_SHARE: Final = 0.3
_NOISE_LENGTH: Final = 1 << 14
# Error of a radio's measurement of signal strength.
_STRENGTH_DB: Final = 2.0


class Obstacles:
    """
    Attenuation by walls and people between two positions.

    :param walls: counts the walls between two positions (x, y, x, y in m); None: no walls.
    :param wall_db: loss in each wall.
    :param people: returns the positions of people in m.
    :param person_db: loss by each person in between.
    """

    def __init__(self, walls: Callable[[float, float, float, float], int] | None, wall_db: float,
                 people: Callable[[], Sequence[tuple[float, float]]], person_db: float) -> None:
        self._walls = walls
        self._wall_db = wall_db
        self._people = people
        self._person_db = person_db
        self._standing: Sequence[tuple[float, float]] = people()
        self._known: dict[tuple[float, float, float, float], float] = {}

    def update(self) -> bool:
        """Update people's positions; return whether one has moved enough to change a link."""
        now = self._people()
        moved = any(math.dist(a, b) > _STEP_M for a, b in zip(now, self._standing))
        if moved:
            self._standing = now
        return moved

    def loss_db(self, ax: float, ay: float, bx: float, by: float) -> float:
        """Return the loss by walls and people between two positions."""
        loss = self._walls_db(ax, ay, bx, by)
        for x, y in self._standing:
            if _stands_between(x, y, ax, ay, bx, by):
                loss += self._person_db
        return loss

    def _walls_db(self, ax: float, ay: float, bx: float, by: float) -> float:
        if self._walls is None:
            return 0.0
        key = (ax, ay, bx, by) if (ax, ay) < (bx, by) else (bx, by, ax, ay)
        found = self._known.get(key)
        if found is None:
            if len(self._known) >= _PAIRS_KEPT:
                self._known.clear()
            found = self._known[key] = self._wall_db * self._walls(*key)
        return found


def _stands_between(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether a person is in between; the wearer of an end is not."""
    along_x, along_y = bx - ax, by - ay
    length = along_x * along_x + along_y * along_y
    if length == 0.0:
        return False
    part = ((x - ax) * along_x + (y - ay) * along_y) / length
    reach = _PERSON_RADIUS_M / math.sqrt(length)
    if not reach < part < 1.0 - reach:
        return False
    beside = (x - ax) * along_y - (y - ay) * along_x
    return beside * beside < _PERSON_RADIUS_M ** 2 * length


def _air_and_network(scenario: Scenario, protocol: RouterFactory, obstacles: Obstacles,
                     random: Random, times: float) -> tuple[PathLossMedium, Network]:
    """Create the medium, and a network without nodes."""
    radio, energy = scenario.radio, scenario.energy
    mac = MAC_PROFILES[radio.mac or 'tinyos1']
    noise = (heavy if radio.noise == 'heavy' else quiet)(random, _NOISE_LENGTH)
    medium = PathLossMedium(PathLoss(
        radio.loss_1m_db, radio.exponent, radio.shadowing_db, radio.asymmetry_db,
        radio.fading_db, radio.fading_s, obstacles.loss_db), noise, mac)

    def router(node: Node, is_root: bool) -> Router:
        return command_router(protocol(node, is_root))

    return medium, Network(
        medium, router, mac=mac, seed=scenario.seed, drift_ppm=scenario.drift_ppm or 0.0,
        power=PowerModel(capacity_mah=energy.battery_mah, acceleration=times,
                         listening_share=energy.duty))


class LiveNetwork:
    """
    A network in the time of its owner; only one thread at a time may use it.

    :ivar network: the simulated network.
    :ivar station: the serial side of the sink.
    :ivar root: the mote of the sink.
    """

    def __init__(self, nodes: Sequence[LiveNode], scenario: Scenario, protocol: RouterFactory,
                 station: Station, *, environment: Environment, obstacles: Obstacles,
                 sink_position: Callable[[], Position], to_host: Callable[[bytes, int], object],
                 baud: int = 0, group: int = -1, root: int = 0, times: float = 1.0,
                 payload: Payload | None = None) -> None:
        """
        Create the network; nothing runs before the first :meth:`advance`.

        :param nodes: all except the sink; they may change at any time.
        :param scenario: with all defaults set: radio, traffic, seed; its topology is not used.
        :param protocol: factory of the routing protocol of the scenario.
        :param station: the program on the sink's mote.
        :param sink_position: returns the position of the sink.
        :param to_host: called with bytes for the serial line, and the start of their transmission
            in the time of :meth:`advance`.
        :param root: the sink's address.
        :param times: factor by which batteries discharge faster.
        :param payload: of the nodes' packets; None: that of the scenario.
        """
        self._nodes = tuple(nodes)
        self._obstacles = obstacles
        self._sink_position = sink_position
        self._to_host = to_host
        self._offset_ns: int | None = None
        self._applications: dict[int, NodeApplication] = {}
        self._boots: dict[int, int] = {}
        self._alarms: dict[int, Mapping[str, int]] = {}
        random = Random(f'{scenario.seed} live')
        self._medium, self.network = _air_and_network(
            scenario, protocol, obstacles, random, times)
        self.network.on_deliver = self._delivered
        self.network.on_note = self._noted
        self.root = self.network.add(
            root, sink_position(), is_root=True, power_dbm=scenario.radio.power_dbm)
        self._flood = Flood(self.root, self.network.mac.version > 1)
        self._raw = self.root.sender(self._raw_is_through)
        self.station = BaseStation(
            station, self._serial, self._send, baud, group,
            Oscilloscope.AM_TYPE if payload is None else payload.am_type)
        self._payload = payload or scenario.traffic.payload or 'data'
        for each in self._nodes:
            self._add(each, scenario, environment, random)
        if station.sniffs:
            self._medium.overhears = True
            self._medium.trace = self._heard
        self.network.at(_LOOK_NS, self._update_environment)
        self.network.at(_SHADOWS_NS, self._look_at_people)

    def _add(self, node: LiveNode, scenario: Scenario, environment: Environment, random: Random
             ) -> None:
        surveyed = node.surveyed
        mote = self.network.add(
            surveyed.id, node.position_m, power_dbm=scenario.radio.power_dbm,
            boot_ns=int(random.random() * _BOOT_SPREAD_NS),
            used_mah=random.random() * _USED_SHARE * scenario.energy.battery_mah)
        self._applications[surveyed.id] = NodeApplication(
            mote, surveyed.quantities,
            NodeReadings(node, environment, Random(f'{scenario.seed} sensors {surveyed.id}'),
                         self._strongest(mote, Random(f'{scenario.seed} nearest {surveyed.id}'))),
            self._payload, scenario.period_ns, self.network.mac.version > 1)
        self._boots[surveyed.id] = 1
        self._alarms[surveyed.id] = {}

    def _strongest(self, mote: Mote, random: Random) -> Callable[[], int]:
        """Return a callable that returns the fixed node with the strongest signal at a mote."""
        def strongest() -> int:
            heard = []
            near = {other.address for other in self._medium.links_of(mote.radio)}
            for each in self._nodes:
                if each.surveyed.id not in near:
                    continue
                strength_dbm = self._medium.links_of(
                    self.network.motes[each.surveyed.id].radio).get(mote.radio)
                if strength_dbm is not None and each.on and not each.worn and (
                        each.surveyed.id != mote.address):
                    heard.append((strength_dbm + random.gauss(0.0, _STRENGTH_DB),
                                  each.surveyed.id))
            return max(heard)[1] if heard else 0

        return strongest

    # ---- time --------------------------------------------------------------------------------

    def advance(self, now_ns: int) -> None:
        """
        Run up to a time.

        :param now_ns: absolute, such as CLOCK_MONOTONIC; the first one is the start.
        """
        if self._offset_ns is None:
            self._offset_ns = now_ns
        late_ns = now_ns - self._offset_ns - self.network.queue.now_ns - _CATCH_UP_NS
        if late_ns > 0:
            self._offset_ns += late_ns + _CATCH_UP_NS
        self.network.run_until(now_ns - self._offset_ns)
        self.network.latencies_ns.clear()

    def _update_environment(self) -> None:
        """Apply changes of the nodes and of the sink."""
        network = self.network
        for node in self._nodes:
            number = node.surveyed.id
            mote = network.motes[number]
            if not node.on:
                mote.kill()
            elif node.boots != self._boots[number]:
                mote.boot()
            self._boots[number] = node.boots
            if node.alarms != self._alarms[number]:
                before, self._alarms[number] = self._alarms[number], node.alarms
                self._applications[number].alarm(before, node.alarms)
            self._follow(mote, node.position_m)
        self._follow(self.root, self._sink_position())
        network.at(network.queue.now_ns + _LOOK_NS, self._update_environment)

    def _follow(self, mote: Mote, position: Position) -> None:
        if mote.position != position and math.dist(mote.position, position) > _STEP_M:
            self.network.move(mote.address, position)

    def _look_at_people(self) -> None:
        network = self.network
        if self._obstacles.update():
            for mote in network.motes.values():
                network.move(mote.address, mote.position)
        network.at(network.queue.now_ns + _SHADOWS_NS, self._look_at_people)

    # ---- the serial line ---------------------------------------------------------------------

    def from_host(self, data: bytes) -> None:
        """Receive bytes from the host, at the time of the last :meth:`advance`."""
        if self.root.is_on:
            self.station.take(data, self.network.queue.now_ns)

    def power(self, on: bool) -> None:
        """Switch the sink on or off; its queued packets are lost."""
        if on == self.root.is_on:
            return
        self.station.reset()
        if on:
            self.root.boot()
        else:
            self.root.kill()

    def _serial(self, data: bytes, start_ns: int) -> None:
        self._to_host(data, start_ns + (self._offset_ns or 0))

    def _delivered(self, mote: Mote, am_type: int, payload: bytes, origin: int,
                   application: bytes) -> None:
        self.station.delivered(am_type, payload, application, self.network.queue.now_ns)

    def _noted(self, now_ns: int, mote: Mote, event: str, numbers: tuple[int, ...]) -> None:
        if mote is self.root:
            self.station.noted(event, numbers, now_ns)

    def _heard(self, frame: Transmission, receivers: list[Radio]) -> None:
        radio = self.root.radio
        if frame.am_type != ACK and self.root.is_on and (
                radio in receivers or frame.sender is radio):
            self.station.heard(frame.destination, frame.sender.address, frame.am_type,
                               frame.payload, frame.dsn, frame.acknowledge,
                               self.network.queue.now_ns)

    def _send(self, packet: Outgoing) -> bool:
        """Send a packet of the host: commands by flooding, others unmodified."""
        if packet.am_type == SurgeCmd.AM_TYPE:
            self._flood.begin(packet.destination, packet.payload)
            return True
        return self._raw.send(packet.destination, packet.am_type, packet.payload, False)

    def _raw_is_through(self, acknowledged: bool) -> None:
        self.station.radio_ready()

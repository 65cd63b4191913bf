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


"""Runs the network of a scenario, and collects the results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from collections.abc import Mapping
from functools import partial
import math
from random import Random
from time import perf_counter
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.radio.cc2420 import TURNAROUND_NS
from rt_robot_os.features.wsn.radio.mac import MAC_PROFILES
from rt_robot_os.features.wsn.radio.mac import MacProfile
from rt_robot_os.features.wsn.radio.mac import TINYOS2
from rt_robot_os.features.wsn.radio.noise import closest_pattern
from rt_robot_os.features.wsn.radio.noise import heavy
from rt_robot_os.features.wsn.radio.noise import quiet
from rt_robot_os.features.wsn.radio.noise import read_trace
from rt_robot_os.features.wsn.radio.noise import SERIES_LENGTH
from rt_robot_os.features.wsn.radio.noise import TOSSIM_LEARNS
from rt_robot_os.features.wsn.radio.path_loss import PathLoss
from rt_robot_os.features.wsn.radio.path_loss import Walls
from rt_robot_os.features.wsn.simulator.air import ACK
from rt_robot_os.features.wsn.simulator.air import Link
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.energy import PowerModel
from rt_robot_os.features.wsn.simulator.faults import Fault
from rt_robot_os.features.wsn.simulator.faults import fault
from rt_robot_os.features.wsn.simulator.faults import nodes_of
from rt_robot_os.features.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.features.wsn.simulator.host import Host
from rt_robot_os.features.wsn.simulator.link_medium import LinkMedium
from rt_robot_os.features.wsn.simulator.medium import Medium
from rt_robot_os.features.wsn.simulator.medium import OUTCOMES
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.mote import Traffic
from rt_robot_os.features.wsn.simulator.network import Network
from rt_robot_os.features.wsn.simulator.packet_statistics import PacketStatistics
from rt_robot_os.features.wsn.simulator.path_loss_medium import PathLossMedium
from rt_robot_os.features.wsn.simulator.results import GAP_PACKETS
from rt_robot_os.features.wsn.simulator.results import latencies_in_ms
from rt_robot_os.features.wsn.simulator.results import Results
from rt_robot_os.features.wsn.simulator.router_factory import router_factory
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.topology import Topology
from rt_robot_os.features.wsn.simulator.topology import WallCount
from rt_robot_os.features.wsn.simulator.traffic import application
from rt_robot_os.motion.grid_map import GridMap

#: AM types of beacons, with position and byte order of the cost in them.
_BEACONS: Final = {0x73: (8, 'big'), 0x70: (5, 'big'), 250: (12, 'little')}
_ACK_DELAYS_NS: Final = {'hardware': TURNAROUND_NS, 'software': TINYOS2.ack_delay_ns}
_SLICES: Final = 200
_SHORTEST_NOISE: Final = 1 << 14

#: Called periodically with the simulated time in s.
Progress = Callable[[float], None]
#: Called at the end of each frame, including acknowledgements.
OnFrame = Callable[[Transmission], None]
#: Changes of the tree: time, node, parent, cost, hops.
TreeChange = tuple[int, int, int | None, int, int]


class Simulation:
    """
    The simulation of a scenario.

    :param scenario: with all defaults set.
    :param topology: of the scenario.
    :param on_frame: see ``OnFrame``.
    :param with_host: run the robot's model of the network as well.
    :raises ConfigError: the recorded noise cannot be read.
    :ivar network: the simulated network.
    :ivar statistics: true counts of the packets.
    :ivar tree: changes of the tree, if :meth:`run` records them.
    """

    def __init__(self, scenario: Scenario, topology: Topology,
                 on_frame: OnFrame | None = None, with_host: bool = False) -> None:
        self.scenario = scenario
        self.topology = topology
        self.statistics = PacketStatistics(
            each for each in topology.places if each not in topology.sinks)
        self.tree: list[TreeChange] = []
        self._happened: Counter[str] = Counter()
        self._data: Counter[int] = Counter()
        self._beacons = 0
        self._said: dict[int, int] = {}
        self._all_said: dict[int, set[int]] = {each: set() for each in topology.places}
        self._parents: dict[int, set[int]] = {each: set() for each in topology.places}
        self._on_frame = on_frame
        self._seen: dict[int, tuple[int | None, int, int]] = {}
        self._wall_s = 0.0
        self._mac = _mac(scenario)
        if with_host and len(topology.sinks) > 1:
            raise ConfigError([f'--host: {len(topology.places):,} nodes are '
                               f'{len(topology.sinks)} networks, and a robot has a model of one'])
        self._host = Host(self._mac.version, topology.sink,
                          len(topology.places)) if with_host else None
        self.medium = _medium(scenario, topology, self._mac)
        self.medium.on_end = self._count
        energy = scenario.energy
        self.network = Network(
            self.medium, router_factory(scenario, self._sink_speed), mac=self._mac,
            seed=scenario.seed, drift_ppm=scenario.drift_ppm or 0.0, power=PowerModel(
                capacity_mah=energy.battery_mah if energy.empty else 1e12,
                listening_share=energy.duty, wake_interval_s=energy.wake_interval_s))
        self.network.on_deliver = self._delivered
        self.network.on_note = self._noted
        self._random = Random(f'{scenario.seed} scenario')
        self._add_motes()
        self._plan_changes()
        self._plan_way()
        for text in scenario.faults:
            self._plan_fault(fault(text))

    # ---- before it runs -----------------------------------------------------------------------

    def _add_motes(self) -> None:
        scenario, topology = self.scenario, self.topology
        sources = set(scenario.traffic.sources or topology.places).difference(topology.sinks)
        late = {node: round(one.at_s * NS_PER_S) for one in map(fault, scenario.faults)
                if one.kind == 'boot' for node in self._who(one)}
        for each, place in topology.places.items():
            boot_s = scenario.boot_s + self._random.random() * (
                scenario.boot_spread_s or 0.0)
            pan, address = divmod(each, topology.pan_nodes) if topology.pan_nodes else (0, each)
            self.network.add(
                address, (place.x, place.y, place.z), is_root=each in topology.sinks,
                power_dbm=scenario.radio.power_dbm,
                boot_ns=late.get(each, round(boot_s * NS_PER_S)),
                traffic=self._traffic(each) if each in sources else None, pan=pan, number=each)

    def _traffic(self, node: int) -> Traffic:
        scenario = self.scenario
        build = application(scenario.traffic.payload or '', self.topology.places[node].quantities,
                            scenario.period_ns)
        statistics, network_now = self.statistics, self._now_ns

        def made(mote: Mote, number: int) -> bytes:
            packet = build(mote, number)
            statistics.add_generated(node, packet, network_now())
            return packet

        return Traffic(scenario.period_ns, made, scenario.start_ns,
                       round(scenario.traffic.jitter_ms * 1e6))

    def _now_ns(self) -> int:
        return self.network.queue.now_ns

    def _plan_changes(self) -> None:
        medium = self.medium
        for change in self.topology.changes:
            assert isinstance(medium, LinkMedium)
            link = Link(change.link.prr, round(change.link.rssi_dbm), change.link.lqi)
            self.network.at(change.at_ns, partial(
                medium.set_link, change.source, change.destination, link))

    def _plan_way(self) -> None:
        way = self.topology.route
        if way is None or way.round_s <= 0.0:
            return
        step_ns = round(self.scenario.sink.step_m / self.scenario.sink.speed_m_s * NS_PER_S)
        height = self.topology.places[self.topology.sink].z

        def drive() -> None:
            now_ns = self._now_ns()
            x, y = way.at_s(now_ns / NS_PER_S)
            position = (x, y, height)
            if position != self.network.motes[self.topology.sink].position:
                self.network.move(self.topology.sink, position)
            self.network.at(now_ns + step_ns, drive)

        self.network.at(round(self.scenario.sink.start_s * NS_PER_S), drive)

    def _sink_speed(self) -> float:
        """Return the mean speed of the sink over the last second, in m/s."""
        way, now_s = self.topology.route, self._now_ns() / NS_PER_S
        if way is None:
            return 0.0
        return math.dist(way.at_s(now_s), way.at_s(max(0.0, now_s - 1.0)))

    def _who(self, one: Fault) -> list[int]:
        # The same nodes at each call.
        random = Random(f'{self.scenario.seed} {one}')
        return list(nodes_of(one, self.topology.places, self.topology.sinks, random))

    def _plan_fault(self, one: Fault) -> None:
        at_ns, end_ns = round(one.at_s * NS_PER_S), round((one.at_s + one.for_s) * NS_PER_S)
        if one.kind == 'noise':
            if isinstance(self.medium, GainMedium):
                self.network.at(at_ns, partial(self.medium.add_noise, round(one.numbers[0])))
                self.network.at(end_ns, partial(self.medium.add_noise, -round(one.numbers[0])))
            return
        for node in self._who(one):
            mote = self.network.motes[node]
            if one.kind in ('kill', 'reboot', 'sleep'):
                self.network.at(at_ns, mote.kill)
            if one.kind in ('reboot', 'sleep'):
                self.network.at(end_ns, mote.boot)
            if one.kind == 'silence':
                self.network.at(at_ns, partial(setattr, mote, 'traffic', None))
                if one.for_s:
                    self.network.at(end_ns, partial(setattr, mote, 'traffic', mote.traffic))
            if one.kind == 'move':
                x, y = one.numbers
                place = (x, y, self.topology.places[node].z)
                self.network.at(at_ns, partial(self.network.move, node, place))

    # ---- while it runs ------------------------------------------------------------------------

    def _count(self, frame: Transmission) -> None:
        am_type = frame.am_type
        if am_type in _BEACONS:
            self._beacons += 1
            node = frame.sender.number
            self._said[node] = cost = _cost(am_type, frame.payload)
            self._all_said[node].add(cost)
        elif am_type != ACK:
            self._data[frame.sender.number] += 1
        if self._on_frame is not None:
            self._on_frame(frame)

    def _delivered(self, mote: Mote, am_type: int, payload: bytes, origin: int,
                   packet: bytes) -> None:
        now_ns = self._now_ns()
        is_new = self.statistics.add_delivered(
            self.network.number_of(origin, mote), packet, now_ns)
        if self._host is not None:
            self._host.take(am_type, payload, is_new, now_ns)

    def _noted(self, now_ns: int, mote: Mote, event: str, numbers: tuple[int, ...]) -> None:
        self._happened[event] += 1
        if event == 'parent' and numbers:
            self._parents[mote.number].add(self.network.number_of(numbers[0], mote))

    def run(self, progress: Progress | None = None, watch_tree: bool = False) -> None:
        """
        Run to the end of the scenario.

        KeyboardInterrupt is not caught; after it the results so far are available.
        """
        end_ns = round(self.scenario.seconds * NS_PER_S)
        begin_ns, began_s = self._now_ns(), perf_counter()
        try:
            for number in range(1, _SLICES + 1):
                self.network.run_until(begin_ns + (end_ns - begin_ns) * number // _SLICES)
                if watch_tree:
                    self._look_at_tree()
                if progress is not None:
                    progress(self._now_ns() / NS_PER_S)
        finally:
            self._wall_s += perf_counter() - began_s

    def _look_at_tree(self) -> None:
        now_ns = self._now_ns()
        for node, mote in self.network.motes.items():
            router = mote.router
            now = (self._parent(mote) if mote.is_on else None, router.cost, router.hops)
            if node not in self.topology.sinks and self._seen.get(node) != now:
                self._seen[node] = now
                self.tree.append((now_ns, node, *now))

    # ---- afterwards ---------------------------------------------------------------------------

    def results(self) -> Results:
        """Return the results so far."""
        scenario, sinks = self.scenario, self.topology.sinks
        now_ns = self._now_ns()
        motes = {each: mote for each, mote in self.network.motes.items() if each not in sinks}
        routed = {each: mote for each, mote in motes.items()
                  if mote.is_on and mote.router.parent is not None}
        counters: Counter[str] = Counter()
        for mote in self.network.motes.values():
            counters.update(mote.router.counters)
        return Results(
            scenario=scenario.name, protocol=scenario.protocol, seed=scenario.seed,
            seconds=scenario.seconds, ended_s=now_ns / NS_PER_S, nodes=len(self.network.motes),
            sinks=tuple(sorted(sinks)),
            generated=self.statistics.generated, delivered=self.statistics.delivered,
            duplicates=self.statistics.duplicates + self.statistics.unknown,
            data_by_node={each: self._data[each] for each in motes}, beacons=self._beacons,
            acks=sum(mote.radio.sent_acks for mote in self.network.motes.values()),
            latencies_ms=latencies_in_ms(self.statistics.latencies_ns),
            parents={each: self._parent(mote) if each in routed else None
                     for each, mote in motes.items()},
            costs={each: mote.router.cost for each, mote in routed.items()},
            hops={each: mote.router.hops for each, mote in routed.items()},
            beacon_costs=dict(sorted(self._said.items())),
            costs_said={each: frozenset(said) for each, said in self._all_said.items()},
            parents_had={each: frozenset(had) for each, had in self._parents.items()},
            used_mah={each: self._used_mah(mote, now_ns) for each, mote in motes.items()},
            battery_mah=scenario.energy.battery_mah,
            gaps=self.statistics.gaps(GAP_PACKETS, now_ns),
            beacon_period_s=(0.0 if scenario.protocol == 'ctp'
                             else scenario.beacon_period_ns / NS_PER_S),
            outcomes=dict(zip(OUTCOMES, self.medium.outcomes)), counters=dict(sorted(
                counters.items())), happenings=dict(sorted(self._happened.items())),
            host=self._counted_by_host(), events=self.network.queue.executed, wall_s=self._wall_s)

    def _parent(self, mote: Mote) -> int | None:
        parent = mote.router.parent
        return None if parent is None else self.network.number_of(parent, mote)

    def _counted_by_host(self) -> Mapping[str, Any]:
        if self._host is None:
            return {}
        # CTP does not number packets that its queue refuses, and informs the application.
        unnumbered = self.scenario.protocol == 'ctp'
        return self._host.as_json({
            each: self.statistics.lost_before_last(each) - (mote.refused if unnumbered else 0)
            for each, mote in self.network.motes.items() if each not in self.topology.sinks})

    @staticmethod
    def _used_mah(mote: Mote, now_ns: int) -> float:
        battery = mote.battery
        if battery is None:
            return 0.0
        battery.account(now_ns, mote.radio)
        return battery.used_mah


def _cost(am_type: int, payload: bytes) -> int:
    place, order = _BEACONS[am_type]
    return int.from_bytes(payload[place:place + 2], 'big' if order == 'big' else 'little')


def _mac(scenario: Scenario) -> MacProfile:
    profile = MAC_PROFILES[scenario.radio.mac or 'tinyos2']
    if profile.is_tossim:
        return profile
    return profile._replace(
        ack_delay_ns=_ACK_DELAYS_NS[scenario.radio.acknowledge or 'software'],
        keeps_cut_off=scenario.radio.cut_off_frames == 'kept')


def _noise(scenario: Scenario) -> list[int]:
    radio, random = scenario.radio, Random(f'{scenario.seed} noise')
    # Short runs need only a short series.
    length = min(SERIES_LENGTH, max(_SHORTEST_NOISE, round(1000 * scenario.seconds)))
    if radio.noise_file:
        try:
            trace = read_trace(radio.noise_file)
            learned = radio.noise_learned
            if learned is None and radio.mac == 'tossim':
                learned = TOSSIM_LEARNS
            return closest_pattern(trace[:learned or len(trace)], random, length)
        except OSError as error:
            why = error.strerror or str(error)
            raise ConfigError([f'radio.noise_file = {radio.noise_file}: cannot be read: {why}'
                               ]) from None
        except ValueError as error:
            raise ConfigError([f'radio.noise_file: {error}']) from None
    return (heavy if radio.noise == 'heavy' else quiet)(random, length)


def _medium(scenario: Scenario, topology: Topology, mac: MacProfile) -> Medium:
    radio = scenario.radio
    if topology.links is not None:
        links = LinkMedium(mac)
        for (source, destination), one in topology.links.items():
            links.set_link(source, destination, Link(one.prr, round(one.rssi_dbm), one.lqi))
        return links
    if topology.gains is not None:
        gains = GainMedium(_noise(scenario), mac)
        for (source, destination), gain_db in topology.gains.items():
            gains.set_gain(source, destination, gain_db)
        return gains
    walls = None if topology.walls is None else _walls(topology.walls, radio.wall_db)
    return PathLossMedium(PathLoss(
        radio.loss_1m_db, radio.exponent, radio.shadowing_db, radio.asymmetry_db,
        radio.fading_db, radio.fading_s, walls), _noise(scenario), mac)


def _walls(grid: GridMap, wall_db: float) -> Walls:
    count = WallCount(grid)

    def loss_db(ax: float, ay: float, bx: float, by: float) -> float:
        return wall_db * count.between(ax, ay, bx, by)

    return loss_db

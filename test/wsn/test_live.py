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

"""The network beside the robot: what the nodes of a world say comes out at the sink's line."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.packets.commands import command_packet
from rt_robot_os.features.wsn.packets.commands import parse_command
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.routing.least_cost import LeastCost
from rt_robot_os.features.wsn.simulator.base_station import STATIONS
from rt_robot_os.features.wsn.simulator.live import LiveNetwork
from rt_robot_os.features.wsn.simulator.live import Obstacles
from rt_robot_os.features.wsn.simulator.network import RouterFactory
from rt_robot_os.features.wsn.simulator.scenario import RadioSettings
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.scenario import settled
from rt_robot_os.features.wsn.simulator.scenario import TrafficSettings
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings

PERIOD_MS = 500.0
# In a row, so that each needs the one before; somebody walks with one beside it.
ROW = WorldSettings(
    map='open', people=('anna 0 9 1',), temperature_c=20.0, heat=('24 0 9 1',), light_lux=100.0,
    nodes=('near 8 0 1', 'middle 16 0 1', 'far 24 0 1 temperature water battery',
           'wrist 0 0 1 on anna pulse_per_min acceleration_g alarm'))
# Without chance, so that a node hears its neighbours and nobody else.
CLEAR = RadioSettings(power_dbm=-25.0, shadowing_db=0.0, asymmetry_db=0.0, fading_db=0.0)
NEAR, MIDDLE, FAR, WRIST = 1, 2, 3, 4


class House:
    """A world with a network, and what a host hears."""

    def __init__(self, settings: WorldSettings = ROW, station: str = 'surge',
                 protocol: RouterFactory = LeastCost, step_ns: int = 20 * NS_PER_MS
                 ) -> None:
        self.world = World(settings)
        self.packets: list[Packet] = []
        self.raw: list[bytes] = []
        self.step_ns = step_ns
        self.protocols = STATIONS[station].protocols
        self._reader = FrameReader()
        self._decoder = PacketDecoder(self.protocols.name)
        self.now_ns = 5 * NS_PER_S
        self.acks = 0
        version = self.protocols.name[-1]
        self.live = LiveNetwork(
            self.world.wireless.nodes,
            settled(Scenario(
                protocol='multihoplqi', tinyos=int(version), radio=CLEAR, traffic=TrafficSettings(
                    period_ms=PERIOD_MS, payload='data' if version == '1' else 'oscilloscope'))),
            protocol, STATIONS[station], environment=self.world,
            obstacles=Obstacles(None, 6.0, self._people, 4.0), sink_position=self._sink,
            to_host=self._take, baud=57600)
        self.world.advance(self.now_ns)
        self.live.advance(self.now_ns)

    def _people(self) -> list[tuple[float, float]]:
        return [(each.x, each.y) for each in self.world.people]

    def _sink(self) -> tuple[float, float, float]:
        return (*self.world.base.pose[:2], 1.0)

    def _take(self, data: bytes, start_ns: int) -> None:
        assert start_ns >= self.now_ns - self.step_ns
        self.raw.append(data)
        for each in self._reader.feed(data):
            if each.protocol == self.protocols.ack:
                self.acks += 1
            else:
                self.packets.append(self._decoder.decode(each.packet))

    def run(self, seconds: float) -> list[Packet]:
        """Let time pass; return what came meanwhile."""
        before = len(self.packets)
        until_ns = self.now_ns + round(seconds * NS_PER_S)
        while self.now_ns < until_ns:
            self.now_ns = min(self.now_ns + self.step_ns, until_ns)
            self.world.advance(self.now_ns)
            self.live.advance(self.now_ns)
        return self.packets[before:]

    def until(self, done: Callable[[Packet], bool], seconds: float = 30.0) -> Packet:
        """Let time pass until a packet comes."""
        for _ in range(round(seconds * 10)):
            for packet in self.run(0.1):
                if done(packet):
                    return packet
        raise AssertionError('it did not come')

    def command(self, text: str) -> None:
        packet = command_packet(parse_command(text), self.protocols.name)
        self.live.from_host(frame(self.protocols.acked, b'\x01' + packet))


def of(packets: list[Packet], node: int) -> list[Packet]:
    return [each for each in packets if each.origin == node]


@pytest.fixture(scope='module')
def told() -> tuple[House, list[Packet]]:
    house = House()
    house.run(10)
    return house, house.run(20)


def test_each_node_is_heard_with_what_it_measures_where_it_is(
        told: tuple[House, list[Packet]]) -> None:
    _, packets = told
    readings: dict[int, dict[str, float]] = {}
    for each in packets:
        assert each.problem == ''
        readings.setdefault(each.origin, {}).update(each.readings)
    assert {*readings} == {NEAR, MIDDLE, FAR, WRIST}
    assert {*readings[NEAR]} == {'temperature', 'humidity', 'light', 'battery'}
    assert {*readings[WRIST]} == {'pulse_per_min', 'acceleration_g', 'alarm', 'battery'}
    assert readings[NEAR]['temperature'] == pytest.approx(20.0, abs=1.0)
    assert readings[FAR]['temperature'] == pytest.approx(29.0, abs=1.0)
    assert readings[NEAR]['light'] == pytest.approx(100.0, rel=0.2)
    assert 0.3 < readings[NEAR]['humidity'] < 0.6
    assert 50 < readings[WRIST]['pulse_per_min'] < 95
    assert readings[WRIST]['alarm'] == 0 == readings[FAR]['water']
    assert readings[WRIST]['acceleration_g'] == pytest.approx(1.0, abs=0.1)
    assert all(2.0 < each['battery'] < 3.3 for each in readings.values())


def test_packets_come_over_several_hops_and_in_the_period(
        told: tuple[House, list[Packet]]) -> None:
    house, packets = told
    assert of(packets, FAR)[-1].hops == 3
    assert len(of(packets, FAR)) == pytest.approx(20 / (PERIOD_MS / 1000), abs=3)
    counts = [each.count for each in of(packets, FAR)]
    assert counts == sorted(counts)
    assert house.live.network.duplicates == 0


def test_the_same_comes_however_often_somebody_looks() -> None:
    one, other = House(step_ns=20 * NS_PER_MS), House(step_ns=100 * NS_PER_MS)
    one.run(8)
    other.run(8)
    assert one.raw == other.raw != []


def test_when_a_node_dies_data_find_another_way_and_it_comes_back_anew() -> None:
    house = House(WorldSettings(map='open', nodes=('a 8 2 1', 'b 8 -2 1', 'far 16 0 1')))
    house.run(10)
    first = house.until(lambda packet: packet.origin == 3)
    relay = {1: 'a', 2: 'b'}[first.parent]
    house.world.inject(['node', relay, 'off'])
    house.run(12)
    later = house.run(5)
    assert {each.parent for each in of(later, 3)} == {3 - first.parent}
    assert not of(later, first.parent)
    house.world.inject(['node', relay, 'on'])
    again = house.until(lambda packet: packet.origin == first.parent)
    assert again.count < 5, 'it counts from the start'


def test_the_sink_is_where_the_robot_is() -> None:
    house = House()
    house.run(12)
    assert of(house.run(3), FAR)[-1].hops == 3
    house.world.inject('kidnap 25 1 0'.split())
    house.run(12)
    later = house.run(3)
    assert (of(later, FAR)[-1].hops, of(later, NEAR)[-1].hops) == (1, 3)


def test_an_alarm_comes_at_once_and_ends() -> None:
    house = House()
    house.run(8)
    house.world.inject('alarm anna 4'.split())
    pressed = house.run(1.0)
    assert any(each.readings.get('alarm') == 1 for each in of(pressed, WRIST))
    assert sum('alarm' in each.readings for each in of(house.run(2.5), WRIST)) >= 2
    house.run(0.4)
    assert house.until(lambda packet: packet.readings.get('alarm') == 0, 1.0)


def test_commands_of_the_host_reach_nodes_that_do_not_hear_the_sink() -> None:
    house = House()
    house.run(8)
    house.command('sleep 3')
    house.run(2)
    assert house.acks == 1
    quiet = house.run(4)
    assert not of(quiet, FAR) and of(quiet, MIDDLE)
    house.command('wake 3')
    house.command('rate 2 100')
    house.run(2)
    loud = house.run(2)
    assert of(loud, FAR) and len(of(loud, MIDDLE)) > 15 > len(of(loud, NEAR))
    house.command('focus 3')
    house.run(2)
    focused = house.run(3)
    assert len(of(focused, FAR)) > 4 * len(of(focused, NEAR))


def test_commands_that_make_no_sense_are_borne() -> None:
    house = House()
    house.run(6)
    for payload in (b'', b'\x02', bytes(6), SurgeCmd(2, 0).pack(), SurgeCmd(99, 5).pack(),
                    SurgeCmd(5, 0xFFFFFFFF).pack() + bytes(40)):
        house.live.from_host(frame(0x42, TelosMsg(0xFFFF, 18, payload).pack()))
        house.run(1)
    later = house.run(4)
    assert {NEAR, MIDDLE, FAR, WRIST} == {each.origin for each in later}


def test_without_power_the_sink_is_silent_and_begins_again() -> None:
    house = House()
    house.run(8)
    house.live.power(False)
    house.command('sleep 3')
    assert not house.run(3) and house.acks == 0
    house.live.power(True)
    assert house.until(lambda packet: packet.origin == FAR)


def test_a_sniffer_hears_beacons_and_each_hop() -> None:
    house = House(station='tosbase')
    packets = house.run(12)
    assert {each.kind for each in packets} == {'beacon', 'data'}
    assert {each.source for each in packets} >= {0, NEAR}
    assert not any(each.destination == 0x7E for each in packets)


@pytest.mark.parametrize('station', ['multihop_oscilloscope', 'base_station'])
def test_motes_under_tinyos_2_are_heard_as_well(station: str) -> None:
    house = House(station=station, protocol=Ctp)
    packets = house.run(15)
    assert {NEAR, FAR} <= {each.origin for each in packets if each.kind == 'data'}
    assert {each.problem for each in packets} == {''}
    if station == 'multihop_oscilloscope':
        assert {each.am_type for each in packets} <= {0x93, 0x72}


def test_who_stands_between_two_nodes_weakens_their_link() -> None:
    people = [(3.0, 0.1)]
    obstacles = Obstacles(lambda *places: 2, 6.0, lambda: list(people), 4.0)
    assert obstacles.loss_db(0, 0, 6, 0) == 16.0
    assert obstacles.loss_db(0, 2, 6, 2) == 12.0
    assert obstacles.loss_db(3.0, 0.1, 6, 0) == 12.0, 'who wears a node is not in its way'
    people[0] = (3.0, 2.0)
    assert obstacles.update() and not obstacles.update()
    assert obstacles.loss_db(0, 2, 6, 2) == 16.0


def test_after_a_long_halt_it_goes_on_at_the_present_time() -> None:
    house = House()
    house.run(8)
    house.now_ns += 3600 * NS_PER_S
    assert len(house.run(0.1)) < 10
    assert house.until(lambda packet: packet.origin == FAR)

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

"""The sink's driver with its simulated device: packets, commands, faults."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.packets.commands import command_packet
from rt_robot_os.features.wsn.packets.commands import parse_command
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.payload_text import parse_payloads
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.sink.driver import Sink
from rt_robot_os.features.wsn.sink.simulated import SimulatedSink
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.world.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing import Rig
from rt_robot_os.testing import rig

FLAT = WorldSettings(map='open', people=('anna 0 2 1',), nodes=(
    'kitchen 3 1 1.4', 'wrist 0 0 1 on anna pulse_per_min alarm battery'))
SOIL = ('soil 0x42 origin:H seqno:H moisture:H[0.1%]=soil_moisture_percent,0.1 '
        'air:H=temperature,sht1x_temperature supply:H=battery,battery_volts')
QUICK = {'period_ms': 250.0}


@contextmanager
def connected(folder: Path, sim: dict[str, Any] | None = None, world: World | None = None,
              **changes: Any) -> Iterator[Rig]:
    with rig(folder, SimulatedSink, Sink, sim={**QUICK, **(sim or {})}, world=world,
             **changes) as made:
        yield made


def run(made: Rig, seconds: float) -> None:
    """Let time pass, the driver at 20 Hz."""
    sink: Any = made.device

    def each(now_ns: int) -> None:
        sink.receive(now_ns, True)
        sink.idle(now_ns)
        sink.write(now_ns)

    made.run(seconds * 1000, 50.0, each)


def packets(made: Rig, stack: str = 'tinyos1') -> dict[str, list[Packet]]:
    """Return what was published, by class."""
    decoder = PacketDecoder(stack)
    return {name: [decoder.decode(bytes(sample.data)) for sample in publisher.samples]
            for name, publisher in zip(('alarm', 'vital', 'rest'), made.publishers)}


def test_the_nodes_of_the_world_come_by_importance(tmp_path: Path) -> None:
    world = World(FLAT)
    with connected(tmp_path, world=world) as made:
        run(made, 8)
        world.inject(['alarm', 'anna'])
        run(made, 4)
        found = packets(made)
        assert made.device.statistics().rejected_frames == 0
    assert all(not each.problem for each in [*found['alarm'], *found['vital'], *found['rest']])
    assert {each.origin for each in found['rest']} == {1, 2}
    assert {name for each in found['rest'] for name in each.readings} == {
        'temperature', 'humidity', 'light', 'battery'}
    assert {name for each in found['vital'] for name in each.readings} >= {'pulse_per_min'}
    assert 1.0 in {each.readings.get('alarm') for each in found['alarm']}


def test_without_a_world_there_is_a_network_of_its_own(tmp_path: Path) -> None:
    with connected(tmp_path) as made:
        run(made, 12)
        found = packets(made)
    assert {each.origin for each in found['rest']} == {1, 2, 3, 4, 5}
    assert max(each.hops for each in found['rest'] if each.hops < 255) > 1


@pytest.mark.parametrize(('stack', 'mode', 'protocol', 'types'), [
    ('tinyos1', 'root', 'multihoplqi', {17}), ('tinyos1', 'sniffer', 'paper', {17, 250}),
    ('tinyos2', 'root', 'ctp', {0x93, 0x72}), ('tinyos2', 'root', 'multihoplqi', {0x93, 0x75}),
    ('tinyos2', 'sniffer', 'multihoplqi', {0x73, 0x74})])
def test_it_speaks_as_the_driver_expects(
        tmp_path: Path, stack: str, mode: str, protocol: str, types: set[int]) -> None:
    sim = {'stack': stack, 'mode': mode, 'protocol': protocol}
    if protocol == 'multihoplqi':
        sim['beacon_period_ms'] = 1000.0
    with connected(tmp_path, sim, stack=stack, mode=mode) as made:
        run(made, 8)
        found = packets(made, stack)
        statistics = made.device.statistics()
    seen = Counter(each.am_type for name in found for each in found[name])
    assert set(seen) <= types and len(seen) >= len(types) - (protocol == 'ctp')
    assert not any(each.problem for name in found for each in found[name])
    assert (statistics.rejected_frames, statistics.more['other_stack']) == (0, 0)


def test_the_node_with_the_number_of_the_sink_is_the_sink(tmp_path: Path) -> None:
    with connected(tmp_path, {'root': 2}, world=World(FLAT), root=2) as made:
        run(made, 6)
        found = packets(made)
    assert {each.origin for each in found['rest']} == {1} and not found['vital']


def test_its_group_and_place_are_those_of_the_driver(tmp_path: Path) -> None:
    device = {'stack': 'tinyos1', 'mode': 'sniffer', 'groups': [-1, 17], 'baud': 0}
    simulated = SimulatedSink.made_for('sink', {}, RobotSite(tmp_path, World(FLAT)), device)
    assert isinstance(simulated, SimulatedSink)
    simulated.pump(0)
    simulated.live.from_host(frame(0x42, TelosMsg(1, 99, b'ab', group=17).pack()))
    simulated.live.from_host(frame(0x42, TelosMsg(1, 99, b'ab').pack()))
    assert (simulated.live.station.taken, simulated.live.station.refused) == (1, 1)
    simulated.close()


def test_a_command_is_acknowledged_and_obeyed(tmp_path: Path) -> None:
    with connected(tmp_path, world=World(FLAT)) as made:
        run(made, 6)
        sink: Any = made.device
        sink._line.send(command_packet(parse_command('sleep 1'), 'tinyos1'))
        run(made, 2)
        assert sink.input_counters()['acknowledged_commands'] == 1
        before = len(made.publishers[2].samples)
        run(made, 2)
        later = packets(made)['rest'][before:]
    assert later and {each.origin for each in later} == {2}


def test_without_power_the_mote_is_silent_and_then_begins_anew(tmp_path: Path) -> None:
    with connected(tmp_path, world=World(FLAT)) as made:
        run(made, 6)
        made.simulated.inject('reset', 3.0)
        run(made, 0.1)
        before = len(made.publishers[2].samples)
        run(made, 2)
        assert len(made.publishers[2].samples) == before
        run(made, 8)
        assert len(made.publishers[2].samples) > before


@pytest.mark.parametrize(('stack', 'mode', 'protocol'), [
    ('tinyos1', 'root', 'paper'), ('tinyos1', 'root', 'multihoplqi'), ('tinyos2', 'root', 'ctp'),
    ('tinyos2', 'root', 'multihoplqi'), ('tinyos2', 'sniffer', 'ctp'),
    ('tinyos1', 'sniffer', 'paper')])
def test_nodes_send_a_payload_of_somebodys_own(
        tmp_path: Path, stack: str, mode: str, protocol: str) -> None:
    sim = {'stack': stack, 'mode': mode, 'protocol': protocol, 'payloads': [SOIL],
           'payload': 'soil'}
    if protocol == 'multihoplqi':
        sim['beacon_period_ms'] = 1000.0
    nodes = 'pot 3 1 0.2 soil_moisture_percent temperature', 'hall 1 1 1'
    world = World(replace(FLAT, nodes=nodes))
    with connected(tmp_path, sim, world=world, stack=stack, mode=mode) as made:
        run(made, 8)
        decoder = PacketDecoder(stack, parse_payloads([SOIL]))
        found = [decoder.decode(bytes(sample.data)) for each in made.publishers
                 for sample in each.samples]
    pots = [each for each in found if each.name == 'soil' and each.origin == 1]
    assert len(pots) > 10 and not any(each.problem for each in found)
    assert pots[-1].readings['temperature'] == pytest.approx(21.0, abs=1.0)
    assert 20.0 < pots[-1].readings['soil_moisture_percent'] < 80.0
    assert 2.0 < pots[-1].readings['battery'] < 3.3


@pytest.mark.parametrize('fault', ['garbage', 'corrupt', 'short', 'baud', 'wrong'])
def test_faults_of_the_line_give_no_packet_that_was_not_sent(tmp_path: Path, fault: str) -> None:
    with connected(tmp_path, {'corrupt_probability': 0.2, 'faults': [f'{fault} at 0 for 6']},
                   world=World(FLAT)) as made:
        run(made, 5)
        broken = sum(len(each.samples) for each in made.publishers)
        assert bool(broken) == (fault == 'short')
        run(made, 8)
        found = packets(made)
    assert len(found['rest']) > 10
    assert {each.origin for name in found for each in found[name]} == {1, 2}


@pytest.mark.parametrize(('sim', 'problem'), [
    ({'protocol': 'ctp'}, "protocol = 'ctp': motes under tinyos1 have paper or multihoplqi"),
    ({'protocol': 'paper', 'stack': 'tinyos2'}, 'motes under tinyos2 have ctp or multihoplqi'),
    ({'payload': 'soil'},
     "payload = 'soil': must be data, surge or one of the user-defined payloads"),
    ({'platform': 'mica'}, 'simulated motes are of the family telos: set it')])
def test_what_cannot_be_is_told(tmp_path: Path, sim: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        SimulatedSink('sink', sim, PtyPort(tmp_path / 'sink'))

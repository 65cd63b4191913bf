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

"""The readings of sensor nodes on their topics."""

from __future__ import annotations

import math
from pathlib import Path

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.sensor_readings import SensorReadings
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench
from wsn_packets import data_msg
from wsn_packets import Sink

NODES = ['hall 3.0 1.5 2.2', 'bed 1 2 0.8 id 12 pulse_per_min spo2_percent battery']


def test_a_reading_is_on_the_topic_of_its_node_in_its_own_message() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        bench.add(SensorReadings, nodes=NODES)
        temperature, battery = bench.watch('wsn/hall/temperature'), bench.watch('wsn/hall/battery')
        humidity, pulse = bench.watch('wsn/hall/humidity'), bench.watch('wsn/bed/pulse_per_min')
        sink.at(1.0, data_msg(1, 0, Kind.TEMPERATURE, 6100))
        sink.at(2.0, data_msg(1, 1, Kind.HUMIDITY, 1200))
        sink.at(3.0, data_msg(12, 0, Kind.PULSE, 72))
        bench.run(4.0)
        assert temperature.take()
        assert temperature.msg.temperature == pytest.approx(-39.6 + 61.0, abs=0.1)
        assert temperature.msg.header.frame_id == 'hall'
        assert temperature.stamp_ns == 1_000_000_000
        assert humidity.take() and 0.3 < humidity.msg.relative_humidity < 0.5
        assert battery.take()
        assert battery.msg.voltage == pytest.approx(2.8, abs=0.01)
        assert battery.msg.percentage == pytest.approx(0.85, abs=0.02) and battery.msg.present
        assert math.isnan(battery.msg.current)
        assert pulse.take() and pulse.msg.data == 72.0


def test_what_no_sensor_says_is_no_reading() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        module = bench.add(SensorReadings, nodes=NODES)
        pulse, spo2 = bench.watch('wsn/bed/pulse_per_min'), bench.watch('wsn/bed/spo2_percent')
        sink.at(1.0, data_msg(12, 0, Kind.PULSE, 0, voltage=0))
        sink.at(2.0, data_msg(12, 1, Kind.SPO2, 700, voltage=0))
        bench.run(3.0)
        assert not pulse.take() and not spo2.take()
        statistics = module.statistics()
        assert (statistics['implausible'], statistics['readings']) == (2, 0)
        assert 'bed reports spo2_percent 700 %, which is implausible' in statistics['warning']


def test_nodes_that_nobody_surveyed_are_counted_and_named() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        module = bench.add(SensorReadings, nodes=NODES)
        for place, number in enumerate([40, 40, *range(50, 80)]):
            sink.at(0.1 * place, data_msg(number, place))
        sink.at(5.0, data_msg(1, 3, Kind.SMOKE, 1))
        bench.run(6.0)
        statistics = module.statistics()
        assert statistics['strangers'] == 32
        assert statistics['strangers_named'].startswith('40:2 50')
        assert len(statistics['strangers_named'].split()) == 8
        assert 'node 79 sends readings but is not in the survey' in statistics['warning']
        assert statistics['unexpected'] == 1
        assert 'hall sends smoke, which the survey does not list' in statistics['warning']
        bench.run(70.0)
        assert module.statistics()['warning'] == ''


def test_a_module_for_a_class_has_the_quantities_of_that_class() -> None:
    vital = SensorReadings('vital', settings_of(SensorReadings, nodes=NODES, quantities=[
        'pulse_per_min', 'spo2_percent']))
    assert [each.topic for each in vital.publications()] == [
        'wsn/bed/pulse_per_min', 'wsn/bed/spo2_percent']


def test_a_payload_of_ones_own_gives_readings() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        bench.add(SensorReadings, nodes=['pot 1 2 0.1 soil_moisture_percent'], payloads=[
            'soil 0x42 moisture:H[%]=soil_moisture_percent,0.1'])
        soil = bench.watch('wsn/pot/soil_moisture_percent')
        sink.at(1.0, TelosMsg(0x7E, 0x42, MultihopMsg(0, 1, 5, 5, 1, b'\x5e\x01').pack()).pack())
        bench.run(2.0)
        assert soil.take() and soil.msg.data == pytest.approx(35.0)


@pytest.mark.parametrize(('given', 'said'), [
    ({}, 'dut: nodes_file and nodes are both empty'),
    ({'nodes': ['hall 1 2']}, "dut.nodes: 'hall 1 2': must be: name x y height"),
    ({'nodes': NODES, 'quantities': ['smoke']}, 'no node of the survey measures any of these'),
    ({'nodes': NODES, 'quantities': ['Smoke']}, 'dut.quantities: .Smoke. is not a valid name'),
    ({'nodes': NODES, 'payloads': ['soil 0x42']}, 'dut.payloads: payload .soil 0x42.'),
    ({'nodes_file': '/nowhere.yaml'}, 'dut.nodes_file = ./nowhere.yaml.: No such file'),
])
def test_settings_that_cannot_be_used_are_refused(given: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        SensorReadings('dut', settings_of(SensorReadings, **given))


def test_a_file_of_nodes_and_more_of_them(tmp_path: Path) -> None:
    path = tmp_path / 'flat.yaml'
    path.write_text('nodes: [hall 3 1 2 light]\n')
    module = SensorReadings('dut', settings_of(
        SensorReadings, nodes_file=str(path), nodes=['bed 1 2 3 light']))
    assert [each.topic for each in module.publications()] == ['wsn/hall/light', 'wsn/bed/light']


@settings(max_examples=25, deadline=None)
@given(st.lists(st.binary(max_size=60) | st.builds(
    lambda data, cut: data[:cut],
    st.builds(data_msg, st.integers(0, 0xFFFF), st.integers(0, 2 ** 32 - 1),
              st.integers(0, 0xFFFF), st.integers(0, 0xFFFF)),
    st.integers(0, 40)), max_size=30))
def test_any_bytes_are_counted(packets: list[bytes]) -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        module = bench.add(SensorReadings, nodes=NODES)
        for place, packet in enumerate(packets):
            sink.at(0.01 * place + 0.01, packet)
        bench.run(1.0)
        assert module.statistics()['packets'] == len(packets)

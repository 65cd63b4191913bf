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

"""The model of a sensor network on the topics of a sink."""

from __future__ import annotations

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.sensor_network.module import SensorNetwork
from rt_robot_os.messages.network_rows import names_of
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.network_rows import rows_of
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Subscription
from wsn_packets import beacon
from wsn_packets import data_msg
from wsn_packets import Sink

NODES = ['hall 3.0 1.5 2.2', 'bed 1 2 0.8']
REST = ['wsn/packets/rest']


def rows(read: Subscription) -> dict[int, NodeRow]:
    """Return the newest rows by number."""
    while read.take():
        pass
    return {int(row.id): row for row in rows_of(list(read.msg.data))}


def test_nodes_are_published_with_what_is_known_of_them() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        module = bench.add(SensorNetwork, rate_hz=1.0, nodes=NODES, packets_topics=REST)
        nodes = bench.watch('wsn/nodes')
        for place in range(30):
            if place % 10 != 4:
                sink.at(0.8 * place + 0.1, data_msg(1, place, parent=2, hops=2))
            sink.at(0.8 * place + 0.2, data_msg(2, place, hops=1))
        sink.at(20.0, beacon(2, 0, 420, 1))
        bench.run(25.0)
        found = rows(nodes)
        hall, bed = found[1], found[2]
        assert (hall.x, hall.y, hall.z, hall.stddev_m) == (3.0, 1.5, 2.2, 0.0)
        assert (hall.parent, hall.hops, hall.received, hall.lost) == (2, 2, 27, 3)
        assert hall.delivery == pytest.approx(0.9)
        assert hall.battery_v == pytest.approx(2.8, abs=0.01)
        assert (bed.parent, bed.hops, bed.cost, bed.state) == (0, 1, 420, NodeState.GOOD)
        assert found[0].state == NodeState.SINK
        statistics = module.statistics()
        assert statistics['received'] == 57 and statistics['lost'] == 3
        assert statistics['node_1'].startswith('good, 27 packets, delivery 0.900, parent 2')
        assert statistics['warning'] == ''


def test_rows_have_the_names_of_the_survey_beside_them() -> None:
    module = SensorNetwork('net', settings_of(SensorNetwork, nodes=NODES, max_nodes=5))
    output, = module.publications()
    assert output.tail == 8 * 18
    assert names_of(output.fixed['layout.dim'][0]['label']) == {1: 'hall', 2: 'bed'}


def test_a_node_that_falls_silent_is_told_until_it_is_back() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        module = bench.add(SensorNetwork, rate_hz=1.0, nodes=NODES, packets_topics=REST,
                           silent_s=5.0)
        nodes = bench.watch('wsn/nodes')
        for place in range(10):
            sink.at(place + 0.1, data_msg(1, place))
        bench.run(25.0)
        assert rows(nodes)[1].state == NodeState.SILENT
        assert rows(nodes)[2].state == NodeState.UNHEARD
        assert 'no packet from hall (node 1) for 15 s' in module.statistics()['warning']
        sink.at(0.5, data_msg(1, 25))
        bench.run(3.0)
        assert rows(nodes)[1].state != NodeState.SILENT and rows(nodes)[1].lost == 15


def test_a_node_that_shall_sleep_is_not_silent() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        bench.bus.declare('wsn/command', 'std_msgs/msg/String', tail=80)
        command = bench.bus.publisher('wsn/command')
        module = bench.add(SensorNetwork, rate_hz=1.0, nodes=NODES, packets_topics=REST,
                           silent_s=5.0,
                           command_topic='wsn/command')
        for place in range(10):
            sink.at(place + 0.1, data_msg(1, place))

        def sleep() -> None:
            command.msg.data = 'sleep hall'
            command.publish()

        bench.at(11.0, sleep)
        bench.run(40.0)
        assert module.statistics()['silent'] == 0 and module.statistics()['warning'] == ''


def test_silence_can_be_set_while_it_runs() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        module = bench.add(SensorNetwork, rate_hz=1.0, nodes=NODES, packets_topics=REST)
        for place in range(10):
            sink.at(place + 0.1, data_msg(1, place))
        bench.at(12.0, lambda: module.change('silent_periods', 1.5))
        bench.at(12.0, lambda: module.change('silent_s', 1.0))
        bench.run(14.0)
        assert module.statistics()['silent'] == 1


def test_the_sink_is_where_the_robot_is() -> None:
    with ModuleBench() as bench:
        Sink(bench)
        pose = bench.topic('pose', 'geometry_msgs/msg/PoseWithCovarianceStamped',
                           {'header.frame_id': 'map'})
        bench.add(SensorNetwork, rate_hz=1.0, nodes=NODES, packets_topics=REST, pose_topic='pose')
        nodes = bench.watch('wsn/nodes')

        def stand() -> None:
            pose.msg.pose.pose.position = 4.0, 2.0, 0.0
            pose.publish()

        bench.at(0.5, stand)
        bench.run(2.5)
        sink = rows(nodes)[0]
        assert (sink.x, sink.y, sink.z) == (4.0, 2.0, pytest.approx(0.3))


def test_troubles_are_warned_of_each_with_its_text() -> None:
    with ModuleBench() as bench:
        sink = Sink(bench)
        module = bench.add(SensorNetwork, rate_hz=1.0, nodes=NODES, packets_topics=REST,
                           group=0x7D)
        for place in range(30):
            sink.at(place + 0.1, data_msg(1, 500 + place))
            sink.at(place + 0.4, data_msg(1, place))
        sink.at(31.0, beacon(2, 0, 0, 0))
        sink.at(31.1, data_msg(7, 1, group=0x11))
        bench.run(32.5)
        statistics = module.statistics()
        assert 'two nodes have the id 1 (hall)' in statistics['warning']
        assert 'bed (node 2) claims to be the sink' in statistics['warning']
        assert statistics['foreign_groups'] == 1 and statistics['nodes'] == 2


def test_without_a_packet_it_says_so() -> None:
    with ModuleBench() as bench:
        Sink(bench)
        module = bench.add(SensorNetwork, rate_hz=1.0, packets_topics=REST)
        bench.run(3.0)
        assert module.statistics()['warning'] == ''
        bench.run(10.0)
        assert module.statistics()['warning'] == (
            'no packet so far: check that the sink is connected')


@pytest.mark.parametrize(('given', 'said'), [
    ({'packets_topics': []}, 'packets_topics is empty'),
    ({'packets_topics': ['a', 'a']}, "'a' is given twice"),
    ({'battery_curve': [2.0, 0.0, 3.0]}, 'battery_curve: an odd number of values'),
    ({'battery_curve': [3.0, 0.0, 2.0, 1.0]}, 'battery_curve: .* both rising'),
    ({'nodes': ['a 1 2']}, "net.nodes: 'a 1 2'"),
])
def test_settings_that_cannot_be_used_are_refused(given: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        SensorNetwork('net', settings_of(SensorNetwork, **given))

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
The model of a sensor network, on the topics of a sink.

The model is :class:`rt_robot_os.features.wsn.sensor_network.model.NetworkModel`; this module has
the topics, the times and the texts of the diagnostics.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from dataclasses import replace
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.sensor_network.model import NetworkModel
from rt_robot_os.features.wsn.sensor_network.settings import check_topics
from rt_robot_os.features.wsn.sensor_network.settings import curve_from
from rt_robot_os.features.wsn.sensor_network.settings import limits_from
from rt_robot_os.features.wsn.sensor_network.settings import SETTINGS
from rt_robot_os.features.wsn.sensor_network.watch import NetworkWatch
from rt_robot_os.features.wsn.sensor_packets import decoder_from
from rt_robot_os.features.wsn.sensor_packets import group_from
from rt_robot_os.features.wsn.sensor_packets import PacketReader
from rt_robot_os.features.wsn.sensor_packets import PACKETS
from rt_robot_os.features.wsn.sensor_packets import survey_from
from rt_robot_os.messages.network_rows import names_label
from rt_robot_os.messages.network_rows import WIDTH
from rt_robot_os.modules.base import Module
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

# Shortest time between two evaluations.
_ROUND_NS: Final = NS_PER_S // 5
# Largest number of nodes with a line of their own in the diagnostics.
_LINES: Final = 32


class SensorNetwork(Module):
    """
    Model a sensor network from all packets that arrive at its sink.

    Packets release it, and its rate, at which the nodes are evaluated and published.
    """

    pose = Input('', message='geometry_msgs/msg/PoseWithCovarianceStamped', newest=True)
    command = Input('', message='std_msgs/msg/String', wake=True)
    nodes = Output('wsn/nodes', 'std_msgs/msg/Float64MultiArray', depth=2, tail=WIDTH)

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Read the survey.

        :raises ConfigError: the survey or another setting cannot be used.
        """
        super().__init__(name, settings)
        check_topics(name, settings)
        self._survey = survey_from(name, settings)
        self._decoder = decoder_from(name, settings)
        self._curve = curve_from(name, settings)
        self._readers: list[PacketReader] = []
        self._model: NetworkModel | None = None
        self._watch: NetworkWatch | None = None
        self._next_ns = 0
        self._reported: frozenset[tuple[str, int]] = frozenset()

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Return whether a port has a topic; the others are unused."""
        return bool(self.topic_of(attribute))

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return an input for each class of packets."""
        return {topic: Input(topic, wake=True, message=PACKETS)
                for topic in self.settings['packets_topics']}

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the output, with space for all nodes and their names as the label."""
        rows = 1 + len(self._survey) + self.settings['max_nodes']
        label = names_label({each.id: each.token for each in self._survey})
        return tuple(replace(each, tail=WIDTH * rows, fixed={'layout.dim': [{'label': label}]})
                     for each in super().publications())

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """Create the model."""
        s = self.settings
        now_ns = self.nodes.topic.kernel.now_ns()
        self._readers = [PacketReader(read) for read in self.listed.values()]
        self._model = NetworkModel(
            self._survey, sink_id=s['root'], group=group_from(s), max_nodes=s['max_nodes'],
            since_ns=now_ns, curve=self._curve)
        self._watch = NetworkWatch(self._model, limits_from(s))
        if self.connected('pose'):
            self._position = self.pose.topic.layout.packer('pose.pose.position').unpack

    def changed(self, name: str) -> None:
        """Apply a changed limit."""
        if self._watch is not None:
            self._watch.limits = limits_from(self.settings)

    def step(self) -> None:
        """Process new packets; evaluate and publish the nodes when it is time."""
        model, watch = self._model, self._watch
        if model is None or watch is None:
            return
        if self.connected('pose') and self.pose.latest():
            x, y, _ = self._position(self.pose.buffer)
            if math.isfinite(x) and math.isfinite(y):
                model.sink_at(x, y, self.settings['sink_height_m'])
        if self.connected('command'):
            while self.command.take():
                model.command(str(self.command.msg.data))
        decode, update = self._decoder.decode, model.update
        for reader in self._readers:
            while (data := reader.take()) is not None:
                update(decode(data), reader.stamp_ns)
        # Not the present time, so that a replay gives the same result.
        now_ns = max(self.job_ns, *(reader.stamp_ns for reader in self._readers))
        if now_ns >= self._next_ns:
            watch.evaluate(now_ns)
            self._tell(watch)
            self._publish(model, now_ns)
            # The next release may be a little early or late.
            self._next_ns = now_ns + max(self.period_ns or NS_PER_S, _ROUND_NS) * 7 // 8

    def statistics(self) -> Mapping[str, Any]:
        """Return the troubles, the counters and the state of each node."""
        model, watch = self._model, self._watch
        if model is None or watch is None:
            return {}
        nodes = list(model.nodes.values())
        lines = {f'node_{node.id}': node.summary() for node in nodes[:_LINES]}
        return {
            'warning': watch.warning(), 'nodes': len(nodes), 'good': watch.good,
            'weak': watch.weak, 'silent': watch.silent, 'unheard': watch.unheard,
            'troubles': len(watch.troubles),
            'received': sum(node.received for node in nodes),
            'lost': sum(node.lost for node in nodes),
            'duplicates': sum(node.duplicates for node in nodes),
            'reboots': sum(node.exact.reboots for node in nodes if node.exact),
            **asdict(model.counters),
            'unknown_types': model.unknown_types.text(),
            'problems_named': '; '.join(
                f'{count} x {text}' for text, count in model.problems.named().items()),
            'packets_lost': sum(reader.lost for reader in self._readers), **lines}

    # ---- work --------------------------------------------------------------------------------

    def _tell(self, watch: NetworkWatch) -> None:
        """Log the troubles that are new since the last evaluation."""
        told = self._reported
        for trouble in watch.troubles:
            if (trouble.kind, trouble.node) not in told:
                self.log.warn('%s', trouble.text, throttle_s=1.0)
        self._reported = frozenset((each.kind, each.node) for each in watch.troubles)

    def _publish(self, model: NetworkModel, now_ns: int) -> None:
        self.nodes.msg.data = [number for row in model.rows(now_ns) for number in row]
        self.nodes.publish(now_ns)

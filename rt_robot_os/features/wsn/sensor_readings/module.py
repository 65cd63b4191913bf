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
The readings of sensor nodes, of one class of packets: a topic for each node and quantity.

Each class has a module of its own, whose priority corresponds to the importance of the class.
Implausible values are counted and not published.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.sensor_packets import decoder_from
from rt_robot_os.features.wsn.sensor_packets import PACKET_SETTINGS
from rt_robot_os.features.wsn.sensor_packets import PacketReader
from rt_robot_os.features.wsn.sensor_packets import PACKETS
from rt_robot_os.features.wsn.sensor_packets import survey_from
from rt_robot_os.features.wsn.sensor_readings.outputs import ReadingOutput
from rt_robot_os.features.wsn.sensor_readings.outputs import topics_of
from rt_robot_os.messages.quantities import quantity
from rt_robot_os.modules.base import Module
from rt_robot_os.topics import Bus
from rt_robot_os.topics.ports import Input

# Largest number of nodes outside the survey with a counter of their own.
_NAMED: Final = 8
_TOLD_NS: Final = 60 * NS_PER_S


class SensorReadings(Module):
    """Publish the readings in the packets of one class."""

    packets = Input('wsn/packets/rest', wake=True, message=PACKETS)

    SETTINGS = (
        *PACKET_SETTINGS,
        Field('prefix', str, 'wsn', 'First part of the names of the topics, as in '
              'wsn/hall/temperature'),
        Field('quantities', list, [], 'Quantities to publish, of those of the nodes of the '
              'survey; empty: all'),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Read the survey, which determines the topics.

        :raises ConfigError: it cannot be read, or nothing would be published.
        """
        super().__init__(name, settings)
        self._survey = survey_from(name, settings)
        self._decoder = decoder_from(name, settings)
        self._wanted = frozenset(_checked(name, settings['quantities']))
        self._topics = tuple(topics_of(self._survey, settings['prefix'], self._wanted))
        if not self._topics:
            raise ConfigError([_nothing(name, bool(self._survey), settings)])
        self._names = {node.id: node.name for node in self._survey}
        self._outputs: dict[int, dict[str, ReadingOutput]] = {}
        self._reader: PacketReader | None = None
        self._readings = self._implausible = self._unexpected = self._without_origin = 0
        self._strangers = 0
        self._strangers_named: Counter[int] = Counter()
        self._told: dict[str, tuple[int, str]] = {}

    # ---- ports -------------------------------------------------------------------------------

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return a topic for each node and quantity."""
        return tuple(spec for _, _, spec in self._topics)

    def bind(self, bus: Bus, task: Any) -> None:
        """Connect the input, and the outputs according to the survey."""
        super().bind(bus, task)
        for number, each, spec in self._topics:
            self._outputs.setdefault(number, {})[each.name] = ReadingOutput(
                each, bus.publisher(spec.topic, task))

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """Prepare the reader of the packets."""
        self._reader = PacketReader(self.packets)

    def step(self) -> None:
        """Publish the readings of every new packet."""
        reader = self._reader
        if reader is None:
            return
        while (data := reader.take()) is not None:
            self._publish(data, reader.stamp_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return the counters of readings and problems."""
        now_ns = self.kernel.now_ns() if self.kernel else 0
        return {
            'warning': '; '.join(text for since_ns, text in list(self._told.values())
                                 if now_ns - since_ns <= _TOLD_NS),
            **self._decoder.counters(), 'readings': self._readings,
            'implausible': self._implausible, 'unexpected': self._unexpected,
            'without_origin': self._without_origin, 'strangers': self._strangers,
            'strangers_named': ' '.join(f'{number}:{count}' for number, count in sorted(
                self._strangers_named.copy().items())),
            'packets_lost': self._reader.lost if self._reader else 0,
            'topics': len(self._topics)}

    # ---- work --------------------------------------------------------------------------------

    def _publish(self, data: bytes, stamp_ns: int) -> None:
        packet = self._decoder.decode(data)
        readings = packet.readings
        if not readings:
            return
        outputs = self._outputs.get(packet.origin)
        if outputs is None:
            self._no_topics_of(packet.origin, stamp_ns)
            return
        for name, value in readings.items():
            output = outputs.get(name)
            if output is None:
                self._not_surveyed(packet.origin, name, stamp_ns)
            elif output.quantity.plausible(value):
                output.write(value, stamp_ns)
                self._readings += 1
            else:
                self._implausible += 1
                self._tell('implausible', stamp_ns, (
                    f'{self._names[packet.origin]} reports {name} {value:g} '
                    f'{output.quantity.unit}, which is implausible: the sensor is '
                    'defective or not worn, or the conversion '
                    'is wrong'))

    def _no_topics_of(self, number: int, stamp_ns: int) -> None:
        if number in self._names:
            return  # surveyed, but without a selected quantity
        if number < 0:
            self._without_origin += 1
            return
        self._strangers += 1
        if number in self._strangers_named or len(self._strangers_named) < _NAMED:
            self._strangers_named[number] += 1
        self._tell('stranger', stamp_ns, f'node {number} sends readings but is not in the survey: '
                                         'add it to nodes_file or nodes')

    def _not_surveyed(self, number: int, name: str, stamp_ns: int) -> None:
        """Count a reading of a quantity that the survey does not list for the node."""
        if self._wanted and name not in self._wanted:
            return
        if name == 'battery':
            return  # part of every packet
        self._unexpected += 1
        self._tell('unexpected', stamp_ns, f'{self._names[number]} sends {name}, which the survey '
                                           'does not list: add it there')

    def _tell(self, kind: str, now_ns: int, text: str) -> None:
        self._told[kind] = now_ns, text


def _checked(name: str, quantities: list[str]) -> list[str]:
    problems = []
    for each in quantities:
        try:
            quantity(each)
        except ValueError as error:
            problems.append(f'{name}.quantities: {error}')
    if problems:
        raise ConfigError(problems)
    return quantities


def _nothing(name: str, surveyed: bool, settings: Mapping[str, Any]) -> str:
    if not surveyed:
        return (f'{name}: nodes_file and nodes are both empty: nothing would be published: set '
                'nodes_file, or nodes such as "hall 3.0 1.5 2.2"')
    return (f'{name}.quantities = {list(settings["quantities"])}: no node of the survey measures '
            'any of these: add them to nodes, such as "bed 2 6 0.8 pulse_per_min"')

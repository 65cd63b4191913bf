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
The sink of a wireless sensor network: a TinyOS mote on a serial port, or a serial forwarder.

The packets of all nodes arrive on one line. Each one is sorted by importance before it is decoded,
see :mod:`rt_robot_os.features.wsn.sink.importance`; each class has a topic, whose readers have
priorities of their own, and a bounded queue. Duplicates are dropped.

Commands to nodes are strings on a topic, see :mod:`rt_robot_os.features.wsn.packets.commands`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.serial.port import silence_of
from rt_robot_os.features.wsn.packets.commands import command_packet
from rt_robot_os.features.wsn.packets.commands import parse_command
from rt_robot_os.features.wsn.packets.forwarder import SCHEME
from rt_robot_os.features.wsn.packets.framing import Frame
from rt_robot_os.features.wsn.packets.framing import PROTOCOLS
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.payload_text import known_payloads
from rt_robot_os.features.wsn.packets.tos_msg import platform_of
from rt_robot_os.features.wsn.sink.duplicates import DuplicateFilter
from rt_robot_os.features.wsn.sink.flow_limit import FlowLimit
from rt_robot_os.features.wsn.sink.importance import Classifier
from rt_robot_os.features.wsn.sink.line import ForwarderLine
from rt_robot_os.features.wsn.sink.line import Line
from rt_robot_os.features.wsn.sink.line import SerialLine
from rt_robot_os.features.wsn.sink.packet_header import header_reader
from rt_robot_os.features.wsn.sink.packet_header import KNOWN
from rt_robot_os.features.wsn.sink.settings import ANY_GROUP
from rt_robot_os.features.wsn.sink.settings import SINK_SETTINGS
from rt_robot_os.features.wsn.sink.sorting import CLAIMED
from rt_robot_os.features.wsn.sink.sorting import FLOODED
from rt_robot_os.features.wsn.sink.sorting import FOREIGN
from rt_robot_os.features.wsn.sink.sorting import SHARED
from rt_robot_os.features.wsn.sink.sorting import Sorting
from rt_robot_os.topics.ports import Input

PACKET: Final = 'std_msgs/msg/UInt8MultiArray'
PACKET_MAXIMUM: Final = 256
_STACKS: Final = {each.name: each for each in (TINYOS_1, TINYOS_2)}
# Default AM groups of TinyOS.
_GROUPS: Final = {TINYOS_1.name: (0x7D,), TINYOS_2.name: (0x00, 0x22)}
# Delay of the next job while packets wait.
_NEXT_JOB_NS: Final = NS_PER_MS
# Largest number of commands whose outcomes are tracked.
_TICKETS_MAXIMUM: Final = 64
# Number of consecutive frames that identify the other generation.
_FRAMES_FOR_OTHER_STACK: Final = 3
# Age up to which an event is part of the warning.
_RECENT_NS: Final = 60 * NS_PER_S
# Number of bytes without a frame that is more than noise on an idle line.
_GARBAGE_BYTES: Final = 128


class Sink(SerialDevice[Frame]):
    """
    The driver of a sink.

    :cvar command: commands to nodes, as strings.
    """

    SETTINGS = SINK_SETTINGS
    TAKES_FORWARDER = True
    description = 'sink of a wireless sensor network under TinyOS 1.x or 2.x'
    IF_SILENT = ('check that the mote is plugged in and runs a base station (Surge with address '
                 '0, TOSBase, BaseStation), and that nodes are switched on')
    IF_GARBAGE = ('check the baud rate (57600 under TinyOS 1.x on telos and micaz, 19200 on mica, '
                  '115200 under TinyOS 2.x), and that it is a base station')
    command = Input('', wake=True, message='std_msgs/msg/String')

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Keep the settings; nothing is opened.

        :raises ConfigError: the classes or their rules are wrong, or packets_per_job is more than
            the depth of the topics.
        """
        stack = _STACKS[settings['stack']]
        self._line: Line = ForwarderLine(stack, settings['platform']) if (
            settings['port'].startswith(SCHEME)) else SerialLine(stack)
        super().__init__(name, settings, self._line)
        self._stack = stack
        self._sorting = _sorting(name, settings)
        if settings['packets_per_job'] > settings['depth']:
            raise ConfigError([
                f'{name}.packets_per_job = {settings["packets_per_job"]}: must be at most depth, '
                f'{settings["depth"]}, or readers of lower priority lose packets'])
        self._packets_per_job = int(settings['packets_per_job'])
        self._commands = self._bad_commands = self._lost_commands = 0
        self._tickets: deque[tuple[int, str]] = deque(maxlen=_TICKETS_MAXIMUM)
        self._given_up, self._given_up_ns = '', 0
        self._other_stack = self._other_in_a_row = 0
        self._unknown_protocols = 0
        # Bytes rejected before the last frame.
        self._rejected_before = 0

    def connected(self, attribute: str) -> bool:
        """Return whether a port has a topic; the others are unused."""
        return bool(self.topic_of(attribute))

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return a topic for each class, with packets without their framing."""
        s = self.settings
        return tuple(
            TopicSpec(f'{s["topic"]}/{name}', PACKET, {'layout.dim': 0}, s['depth'],
                      s['output_rate_hz'], PACKET_MAXIMUM)
            for name in self._sorting.classes)

    def restart(self) -> None:
        """Reset the state of the stream."""
        self._other_in_a_row = 0
        self._rejected_before = self._line.rejected_bytes
        self._log_outcomes()
        self._send_output(self.clock_ns())

    def quiet_s(self) -> float:
        """Return how long all nodes may be silent while the line itself is in order."""
        strange = self._line.rejected_bytes - self._rejected_before
        if not self._line.ready or strange >= _GARBAGE_BYTES:
            return 0.0
        return float(self.settings['quiet_s'])

    def write(self, now_ns: int) -> None:
        """
        Check the protocol of the mote; send data that are waiting.

        :raises DeviceError: the mote uses another protocol, or it is gone.
        """
        if self._line.problem:
            raise DeviceError(f'{self.name}: {self._line.problem}')
        if self._other_in_a_row >= _FRAMES_FOR_OTHER_STACK:
            self._other_in_a_row = 0
            other = TINYOS_2 if self._stack is TINYOS_1 else TINYOS_1
            raise DeviceError(f'{self.name}: its frames are those of the other generation of '
                              f'TinyOS: set stack: {other.name}')
        self.send(b'')

    def receive(self, now_ns: int, polled: bool) -> int:
        """
        Send new commands, and those again that were not acknowledged.

        :return: time of the next call; 0 for none.
        """
        if self.connected('command'):
            while self.command.take():
                self._take_command(self.command.msg.data)
        self._send_output(now_ns)
        self._log_outcomes()
        due_ns = self._line.due_ns
        if self._sorting.waiting or self._left:
            soon_ns = now_ns + _NEXT_JOB_NS
            return soon_ns if due_ns is None else min(due_ns or now_ns, soon_ns)
        return due_ns or 0

    def own_rounds_hz(self) -> float:
        """Return the highest rate of jobs for waiting packets."""
        return float(NS_PER_S // _NEXT_JOB_NS) if self.settings['output_rate_hz'] > 1000 else 0.0

    def handle(self, frame: Frame, arrival_ns: int) -> int:
        """Sort one packet; it is published at the end of the job, in the order of importance."""
        self._rejected_before = self._line.rejected_bytes
        stack = PROTOCOLS.get(frame.protocol)
        if stack is not self._stack:
            self._ignored_frames += 1
            if stack is None:
                self._unknown_protocols += 1
            else:
                self._other_stack += 1
                self._other_in_a_row += 1
            return 0
        self._other_in_a_row = 0
        if not self._sorting.add(frame.packet, arrival_ns):
            self._ignored_frames += 1
        return 0

    def idle(self, now_ns: int) -> int:
        """Acknowledge frames of the mote, and publish waiting packets."""
        if self._line.answers:
            self._send_output(now_ns)
        if not self._sorting.waiting:
            return 0
        return self._sorting.publish(self._publishers, self._packets_per_job)

    @property
    def waiting_bytes(self) -> int:
        """Return the number of bytes that wait for a later job, including those of packets."""
        return super().waiting_bytes + self._sorting.waiting_bytes

    def unused(self) -> str:
        """Return a hint on valid frames without a packet for this sink."""
        sorting = self._sorting
        if sorting.foreign:
            return (f'they are of group {sorting.foreign_group}: set groups: '
                    f'[{sorting.foreign_group}], if those are your nodes')
        platform = platform_of(sorting.misfit)
        if platform and platform != self.settings['platform']:
            return f'they are of another family of motes: set platform: {platform}'
        if sorting.misfit:
            return 'they are neither of telos nor of mica motes: check the program of the mote'
        return ''

    def statistics(self) -> DeviceStatistics:
        """Return the counters; lost are packets of full queues or above the rate."""
        more: dict[str, Value] = {'mode': str(self.settings['mode']), **self._sorting.report()}
        more.update({'other_stack': self._other_stack,
                     'unknown_protocols': self._unknown_protocols, **self._line.report()})
        if warning := self._warning():
            more['warning'] = warning
        lost = sum(self._sorting.lost) + self._sorting.limit.refused
        return self._counters(lost_samples=lost, more=more)

    def input_counters(self) -> Mapping[str, Value]:
        """Return the counters of commands."""
        return {'commands': self._commands, 'bad_commands': self._bad_commands,
                'lost_commands': self._lost_commands, **self._line.command_counters()}

    def silence(self) -> str:
        """Return what to check when no bytes arrive."""
        if self._line.ready or silence_of(self._port):
            return super().silence()
        return 'it is connected, but no serial forwarder answers: check the number of the port'

    def _take_command(self, text: str) -> None:
        self._commands += 1
        try:
            command = parse_command(text)
        except ValueError as error:
            self._bad_commands += 1
            self.log.warn('command: %s', str(error), throttle_s=1.0)
            return
        packet = command_packet(command, self._stack.name, self.settings['platform'],
                                self._group())
        ticket = self._line.send(packet)
        if ticket:
            self._tickets.append((ticket, text))
            return
        self._lost_commands += 1
        self.log.warn('command %r is lost: %d others wait to be acknowledged', text,
                      self._line.waiting, throttle_s=1.0)

    def _send_output(self, now_ns: int) -> None:
        data = self._line.output(now_ns)
        if data:
            self.send(data)

    def _group(self) -> int:
        groups = [each for each in self.settings['groups'] if each != ANY_GROUP]
        return int(groups[0]) if groups else _GROUPS[self._stack.name][0]

    def _log_outcomes(self) -> None:
        """Log the commands that the mote has not acknowledged."""
        for outcome in self._line.take_outcomes():
            while self._tickets and self._tickets[0][0] < outcome.ticket:
                self._tickets.popleft()
            text = self._tickets.popleft()[1] if self._tickets else ''
            if outcome.acknowledged:
                self._given_up = ''
            else:
                self._given_up, self._given_up_ns = text, self._came_ns
                self.log.error('command %r: the mote has not acknowledged it in %d tries', text,
                               outcome.tries)

    def _warning(self) -> str:
        """Return the recent problems, the most serious first; empty without any."""
        sorting = self._sorting
        since_ns = self._came_ns - _RECENT_NS
        recent = {what for what, at_ns in sorting.last_ns.copy().items() if at_ns > since_ns}
        found = [f'{count} packets of class {name} were lost because its queue was full'
                 for name, count in zip(sorting.classes, sorting.lost) if name in recent]
        if self._given_up and self._given_up_ns > since_ns:
            found.append(f'command {self._given_up!r} was not acknowledged')
        limit = sorting.limit
        if FLOODED in recent:
            by = f', delivered by node {limit.relay}' if limit.relay >= 0 else ''
            found.append(f'{limit.refused} packets above node_rate_hz were dropped, the last from '
                         f'node {limit.origin}{by}')
        if SHARED in recent:
            found.append(f'two nodes probably have the id {sorting.duplicates.shared_id}')
        if CLAIMED in recent:
            found.append(f'node {sorting.claimant} advertises a cost of 0 to the sink')
        if FOREIGN in recent:
            found.append(f'{sorting.foreign} packets of other groups, the last of '
                         f'{sorting.foreign_group}')
        return '; '.join(found)


def _sorting(name: str, settings: Mapping[str, Any]) -> Sorting:
    try:
        classifier = Classifier(settings['classes'], settings['rules'])
    except ValueError as error:
        raise ConfigError([f'{name}.{each}' for each in str(error).split('\n')]) from error
    payloads = _payloads(name, settings)
    stack = settings['stack']
    groups = settings['groups'] or _GROUPS[stack]
    return Sorting(
        header_reader(stack, settings['platform'], payloads), classifier,
        DuplicateFilter(round(settings['duplicates_s'] * NS_PER_S)),
        FlowLimit(settings['node_rate_hz']), room=settings['queue'],
        groups=() if ANY_GROUP in groups else groups,
        known_types={*KNOWN[stack], *(each.am_type for each in payloads)}, root=settings['root'])


def _payloads(name: str, settings: Mapping[str, Any]) -> tuple[Payload, ...]:
    try:
        return known_payloads(settings['payloads'])
    except ConfigError as error:
        raise ConfigError([f'{name}.payloads: {each}' for each in error.problems]) from error

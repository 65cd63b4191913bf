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

"""Send samples between the link and ROS 2 topics, as CDR, without building messages."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
import struct
import time
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy
from rclpy.qos import QoSHistoryPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link import LinkClient
from rt_robot_os.link import TopicInfo
from rt_robot_os.link.client_uploads import SampleTooLong
from rt_robot_os.link.conversions import Inward
from rt_robot_os.link.fetch_clock import SHORTEST_NS
from rt_robot_os.link.protocol import SAMPLE_BYTES_MAXIMUM
from rt_robot_os.link.reader import SampleHandler
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.link.stamped_messages import STAMPED_BYTES
from rt_robot_os.link.stamped_messages import take_off
from rt_robot_os.ros.arrivals import Arrivals
from rt_robot_os.ros.arrivals import OwnGaps
from rt_robot_os.ros.conversions import is_lacking
from rt_robot_os.ros.conversions import Refusals
from rt_robot_os.ros.conversions import ros_class
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.settings.mirror_types import inward
from rt_robot_os.settings.mirror_types import outward

# The share of a mirror's permitted delay that the core may use; the node uses the rest.
CORE_SHARE = 0.5

_STAMP = struct.Struct('<iI')
Log = Callable[[str], object]


def qos_of(mirror: MirrorSettings) -> QoSProfile:
    """Make the quality of service of a mirror; by default `ros2 topic echo` matches it."""
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST, depth=mirror.depth,
        reliability=(QoSReliabilityPolicy.RELIABLE if mirror.reliability == 'reliable'
                     else QoSReliabilityPolicy.BEST_EFFORT),
        durability=(QoSDurabilityPolicy.TRANSIENT_LOCAL
                    if mirror.durability == 'transient_local' else QoSDurabilityPolicy.VOLATILE))


class OutwardMirror:
    """
    One topic from the core to ROS 2.

    :param shared: publishers by ROS topic, which several mirrors may share; its own is added.
    :param log: called with a line of text for each problem.
    :ivar published: samples published in ROS 2.
    :ivar missed: samples that this client did not receive from the core, since it connected.
    :ivar refused: samples that cannot be converted.
    """

    def __init__(self, node: Node, settings: MirrorSettings, mapper: StampMapper,
                 shared: dict[str, Any] | None = None, log: Log = print) -> None:
        self.settings = settings
        self.published = 0
        self.refused = Refusals(f'{settings.topic} -> {settings.ros_topic}', log)
        self.missed = 0
        self._line = mapper.line()
        self._stamp_offset: int | None = None
        self._large = False
        self._convert = outward(settings)
        known = {} if shared is None else shared
        if settings.ros_topic not in known:
            known[settings.ros_topic] = node.create_publisher(
                ros_class(settings), settings.ros_topic, qos_of(settings))
        self.publisher = known[settings.ros_topic]
        # The method behind rclpy's publish(), which enters and leaves the handle each time.
        self._publish: Callable[[bytes], None] = self.publisher.handle.publish_raw

    def connect(self, info: TopicInfo) -> None:
        """Store the core's facts about the topic."""
        self._stamp_offset = info.stamp_offset
        self._large = info.max_size > SAMPLE_BYTES_MAXIMUM
        self.missed = 0

    @property
    def delay_ms(self) -> float:
        """Return how long a sample may be delayed; 0 for large ones, which are sent alone."""
        return 0.0 if self._large else self.settings.delay_ms

    def publish(self, stamp_ns: int, missed: int, cdr: memoryview) -> None:
        """
        Publish one sample with its stamp mapped to the time of day.

        :param stamp_ns: on CLOCK_MONOTONIC.
        :param missed: samples of the topic that this client has missed so far.
        :param cdr: may be written to; it is copied once, into the bytes for rclpy.
        """
        convert = self._convert
        if convert is None:
            offset = self._stamp_offset
            if offset is not None:
                wall_ns = self._line.wall_ns(stamp_ns)
                seconds = wall_ns // NS_PER_S
                _STAMP.pack_into(cdr, offset, seconds, wall_ns - seconds * NS_PER_S)
            data = cdr.tobytes()
        else:
            try:
                data = convert(cdr, self._line.wall_ns(stamp_ns))
            except ValueError as error:
                self.refused.add(str(error))
                return
        self._publish(data)
        self.missed = missed
        self.published += 1


class InwardMirror:
    """
    One topic from ROS 2 to the core.

    A latched sample (``transient_local``, such as a map) is delivered once, so the last one is
    stored for the next core. The age of a sample counts from its publication in ROS, see
    :mod:`rt_robot_os.ros.arrivals`.

    :param gaps: of this process.
    :ivar received: samples that ROS 2 delivered.
    :ivar dropped: samples that arrived without a core and are not stored, that the core did not
        accept, or that were not valid messages.
    :ivar refused: samples that cannot be converted, or are not allowed.
    :ivar stamp_age_ms: the age of the last sample with a header, by its stamp; negative when the
        sender's clock is ahead.
    """

    def __init__(self, node: Node, settings: MirrorSettings, log: Log, gaps: OwnGaps) -> None:
        self.settings = settings
        self.received = self.dropped = 0
        self.refused = Refusals(f'{settings.ros_topic} -> {settings.topic}', log)
        self.stamp_age_ms = 0.0
        self._now_ns: Callable[[], int] = lambda: node.get_clock().now().nanoseconds
        self._client: LinkClient | None = None
        self._channel = 0
        self._conversion = inward(settings)
        self._convert: Inward = bytes
        self._latched = settings.durability == 'transient_local' and not settings.stamped
        self._kept: tuple[bytes, int] | None = None
        self._arrivals = Arrivals(gaps, settings.durability == 'transient_local')
        send = self._send if self._conversion is None else self._send_converted
        self._forward = self._send_stamped if settings.stamped else send
        receive: Any = self._receive  # also gets the message info, unlike the types of rclpy
        self.subscription = node.create_subscription(
            ros_class(settings), settings.ros_topic, receive, qos_of(settings), raw=True)

    def connect(self, client: LinkClient | None) -> None:
        """
        Set the connection; None for none.

        :raises LinkError: the core refuses.
        """
        if client is not None:
            self._channel = client.advertise(self.settings.topic)
            if self._conversion is not None:
                self._convert = self._conversion(client.topics[self.settings.topic].max_size)
        self._client = client
        if client is not None and self._kept is not None:
            self.received -= 1  # it was counted on arrival
            self._forward(*self._kept)

    def _receive(self, cdr: bytes, info: Mapping[str, Any]) -> None:
        """Forward a sample; a latched one is stored for the next core."""
        entered_ns = max(1, time.monotonic_ns() - self._arrivals.age_ns(info))
        if self._latched:
            self._kept = cdr, entered_ns
            if self._client is None:
                self.received += 1
                return
        self._forward(cdr, entered_ns)

    def _send_stamped(self, cdr: bytes, entered_ns: int) -> None:
        """Remove the header; its stamp in ROS time, simulated or not, gives the age."""
        try:
            stamp_ns, body = take_off(cdr, STAMPED_BYTES[self.settings.message])
        except ValueError:
            self.received += 1
            self.dropped += 1
            return
        age_ns = self._now_ns() - stamp_ns if stamp_ns else 0  # 0: the sender has not set it
        self.stamp_age_ms = round(age_ns / NS_PER_MS, 1)
        # A stamp in the future counts as its arrival.
        self._send(body, max(1, min(entered_ns, time.monotonic_ns() - max(0, age_ns))))

    def _send_converted(self, cdr: bytes, entered_ns: int) -> None:
        if self._client is not None:
            try:
                cdr = self._convert(cdr)
            except ValueError as error:
                self.received += 1
                self.refused.add(str(error))
                return
        self._send(cdr, entered_ns)

    def _send(self, cdr: bytes, stamp_ns: int) -> None:
        self.received += 1
        client = self._client
        if client is None:
            self.dropped += 1
            return
        try:
            client.publish(self._channel, cdr, stamp_ns)
        except SampleTooLong as error:
            self.refused.add(str(error))
        except LinkError:
            self.dropped += 1

    def counters(self) -> dict[str, Any]:
        """Return its counters for /diagnostics."""
        counted: dict[str, Any] = {
            'received': self.received, 'dropped': self.dropped, **self._arrivals.counters()}
        if self.settings.stamped:
            counted['stamp_age_ms'] = self.stamp_age_ms
        if self._conversion is not None or self.refused.count:
            refused = self.refused.counters()
            counted |= {**refused, 'warning': refused.get('warning') or counted.get('warning', '')}
        return counted


def ask_for_all(client: LinkClient, topic: str, initial: bool = False) -> None:
    """
    Request every sample of a topic, immediately and without loss, for all users of the client.

    :raises LinkError: the core refuses.
    """
    client.mirror(topic, 'drain', initial=initial, patient=True)


def _to_all(mirrors: Sequence[OutwardMirror]) -> SampleHandler:
    def publish(stamp_ns: int, missed: int, cdr: memoryview) -> None:
        for mirror in mirrors:
            mirror.publish(stamp_ns, missed, cdr)

    return publish


class Mirrors:
    """
    All mirrored topics of a node; the entities exist as long as the node is configured.

    :param log: called with a line of text for each problem.
    :param gaps: of this process, shared with other users.
    :param complete: topics of the core of which another user of this client needs every sample.
    :ivar active: whether samples are published in ROS.
    :ivar lacking: mirrors whose type is not installed; they are without effect.
    """

    def __init__(self, node: Node, settings: tuple[MirrorSettings, ...], mapper: StampMapper,
                 log: Log = print, complete: Collection[str] = (), gaps: OwnGaps | None = None
                 ) -> None:
        self.active = False
        gaps = OwnGaps() if gaps is None else gaps
        self._complete = complete
        self._node = node
        self._client: LinkClient | None = None
        self.lacking = [m for m in settings if m.as_ and is_lacking(m.as_)]
        there = [m for m in settings if m not in self.lacking]
        shared: dict[str, Any] = {}
        self.outward = [
            OutwardMirror(node, m, mapper, shared, log) for m in there if m.direction == 'out']
        self.inward = [InwardMirror(node, m, log, gaps) for m in there if m.direction == 'in']

    def connect(self, client: LinkClient) -> None:
        """
        Use a new connection.

        :raises LinkError: the core refuses.
        """
        self._client = client
        by_channel: dict[int, list[OutwardMirror]] = {}
        for mirror in self.outward:
            info = client.topics.get(mirror.settings.topic)
            if info is None:
                raise LinkError(f'the core has no topic {mirror.settings.topic!r} to mirror; was '
                                'it started with another configuration?')
            mirror.connect(info)
            by_channel.setdefault(info.channel, []).append(mirror)
        client.sample_handlers = {
            channel: mirrors[0].publish if len(mirrors) == 1 else _to_all(mirrors)
            for channel, mirrors in by_channel.items()}
        if self.active:
            self.activate()

    def disconnect(self) -> None:
        """Drop the connection; samples from ROS 2 are dropped and counted from now on."""
        self._client = None
        for mirror in self.inward:
            mirror.connect(None)

    def activate(self) -> None:
        """
        Request the outward topics from the core and open the inward ones.

        :raises LinkError: the core refuses.
        """
        self.active = True
        client = self._client
        if client is None:
            return
        for mirror in self.inward:
            mirror.connect(client)
        for out in self.outward:
            self._ask(client, out.settings, initial=True)
        self._set_clock()

    def deactivate(self) -> None:
        """Stop both directions."""
        self.active = False
        for mirror in self.inward:
            mirror.connect(None)
        if self._client is not None:
            for out in self.outward:
                self._client.request('unmirror', topic=out.settings.topic)

    def follow(self, settings: Iterable[MirrorSettings]) -> None:
        """
        Apply changed settings of the same mirrors.

        :raises LinkError: the core refuses.
        """
        wanted = {(mirror.name, mirror.topic): mirror for mirror in settings}
        for out in self.outward:
            new = wanted[out.settings.name, out.settings.topic]
            if new != out.settings and self._client is not None and self.active:
                self._ask(self._client, new)
            out.settings = new
        self._set_clock()

    def _ask(self, client: LinkClient, settings: MirrorSettings, initial: bool = False) -> None:
        if settings.topic in self._complete:
            ask_for_all(client, settings.topic, initial)
            return
        client.mirror(settings.topic, settings.policy, settings.max_rate_hz, initial=initial,
                      delay_ms=settings.delay_ms * CORE_SHARE)

    def _set_clock(self) -> None:
        """Poll with an own clock if every topic allows a delay; otherwise wait for packets."""
        if self._client is not None:
            delay_ms = min((m.delay_ms for m in self.outward), default=0.0)
            # A poll may be late by the shortest interval.
            interval_ns = round(delay_ms * (1 - CORE_SHARE) * NS_PER_MS) - SHORTEST_NS
            self._client.clock.interval_ns = interval_ns if interval_ns >= SHORTEST_NS else 0

    def destroy(self) -> None:
        """Remove the publishers and subscriptions from the node."""
        self.disconnect()
        for publisher in dict.fromkeys(out.publisher for out in self.outward):
            self._node.destroy_publisher(publisher)
        for mirror in self.inward:
            self._node.destroy_subscription(mirror.subscription)

    def counters(self) -> list[tuple[str, dict[str, Any]]]:
        """Return the counters of all mirrors, by ROS topic."""
        rows: list[tuple[str, dict[str, Any]]] = [
            (f'{m.settings.topic} -> {m.settings.ros_topic}',
             {'published': m.published, 'missed': m.missed,
              'delay_ms': m.delay_ms, **(m.refused.counters() if m.settings.as_ else {})})
            for m in self.outward]
        rows += [(f'{m.topic} -> {m.ros_topic}',
                  {'warning': f'the ROS package {m.as_.partition("/")[0]} is not installed'})
                 for m in self.lacking]
        rows += [(f'{m.settings.ros_topic} -> {m.settings.topic}',
                  m.counters()) for m in self.inward]
        return rows

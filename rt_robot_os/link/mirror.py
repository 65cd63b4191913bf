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

"""Carry one topic to one client: what is sent, what is passed over, what is lost."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.batch import Batch
from rt_robot_os.link.gather import Gather
from rt_robot_os.link.gather import Gathered
from rt_robot_os.topics import Bus

#: How long a sample may wait for others at most.
DELAY_MAXIMUM_MS = 100.0


class Policy(Enum):
    """
    The samples that a client gets.

    DRAIN: all samples. LATEST: the newest whenever the link runs; the others are skipped.
    """

    DRAIN = 'drain'
    LATEST = 'latest'


@dataclass(frozen=True)
class MirrorStatistics:
    """
    The statistics of one topic that is sent to one client.

    sent + full + lost + skipped + limited + waiting = published.

    :ivar published: samples of the topic since the mirror started.
    :ivar full: samples that were dropped because the client's socket was full, or because it
        held all slots.
    :ivar lost: samples overwritten in the ring before they could be sent.
    :ivar skipped: samples skipped because of ``latest``.
    :ivar limited: samples skipped because of ``max_rate_hz``.
    :ivar delay_ms: how long a sample may wait in the core for others; 0: ``core.link_gather_ms``.
    """

    topic: str
    policy: str
    max_rate_hz: float
    published: int
    sent: int
    full: int
    lost: int
    skipped: int
    limited: int
    waiting: int
    delay_ms: float = 0.0


class Mirror:
    """
    Send one topic to one client; used by the link's task alone.

    :param channel: number of the topic.
    :param batch: the next packet to the client.
    :param max_rate_hz: 0 for no limit.
    :param gather: releases the link's task while the mirror exists.
    :param buffer: the first buffer that samples are copied to.
    :ivar patient: a sample that a full socket refuses stays in the ring and is tried again until
        it is overwritten there; otherwise it is dropped.
    :ivar sent: samples written to the client's socket, or in its next packet.
    """

    def __init__(self, bus: Bus, topic: str, client: str, batch: Batch, channel: int,
                 policy: Policy, max_rate_hz: float, initial: bool, gather: Gather, *,
                 buffer: memoryview | None = None) -> None:
        self._channel = channel
        self._batch = batch
        self._bus = bus
        self.topic = bus.topic(topic)
        self._longest = self.topic.layout.max_size
        self.subscription = bus.subscribe(
            topic, f'link:{client}', initial=initial, buffer=buffer, counted=False)
        self.subscription.msg = None  # not used: samples are copied to the packet
        self._trigger = Gathered(gather, self.subscription)
        self.topic.triggers.append(self._trigger)
        self._began = self.subscription.next_seq
        self.patient = False
        self.sent = self.full = self.limited = 0
        self._next_ns = self._sent_ns = self._at_ns = 0
        self.set_policy(policy, max_rate_hz)

    def set_policy(self, policy: Policy, max_rate_hz: float, delay_ms: float = 0.0) -> None:
        """
        Change what is sent from now on.

        :param delay_ms: how long a sample may wait for others; 0: ``core.link_gather_ms``.
        """
        self.policy = policy
        self._latest = policy is Policy.LATEST
        self.max_rate_hz = max_rate_hz
        self.delay_ms = delay_ms
        self._trigger.delay_ns = round(delay_ms * NS_PER_MS)
        self._interval_ns = round(NS_PER_S / max_rate_hz) if max_rate_hz > 0 else 0

    def begin_with_oldest(self) -> None:
        """Also send the samples that are stored already; call it before anything was sent."""
        self.subscription.rewind()
        self._began = self.subscription.next_seq

    @property
    def missed(self) -> int:
        """Return how many samples the client lost, without those it asked to skip."""
        return self.full + self.subscription.lost

    def send_due(self, now_ns: int) -> bool:
        """
        Send the samples that are due; never waits.

        :return: whether there were any samples.
        :raises OSError: the connection is closed.
        """
        unread = self.subscription.unread
        if not unread:
            return False
        try:
            self._send_unread(now_ns, unread)
        finally:
            self._sent_ns = now_ns
            self._trigger.note_read()
        return True

    def _send_unread(self, now_ns: int, unread: int) -> None:
        """
        Put the samples that are due into the batch; samples that come meanwhile wait.

        :raises OSError: the connection is closed.
        """
        subscription, batch = self.subscription, self._batch
        take = subscription.latest if self._latest else subscription.take
        for _ in range(1 if self._latest else unread):
            if self._interval_ns and self._is_early(now_ns):
                if self._latest:
                    return
                self._pass_over()
                continue
            space = batch.reserve(self._longest)
            if space is None:
                if not self.patient:
                    self.full += subscription.skip(self._latest)
                return
            subscription.buffer = space
            if not take():
                return
            batch.add(self._channel, self.full + subscription.lost, subscription.stamp_ns,
                      subscription.seq, subscription.length)
            self.sent += 1
            if self._interval_ns:
                self._count_interval()

    def _is_early(self, now_ns: int) -> bool:
        """
        Return whether the next sample comes too soon after the last one that was sent.

        For a sample that waited for others its stamp counts, as the time of publication.
        """
        if self._latest:
            self._at_ns = now_ns
        else:
            stamp_ns = self.topic.stamp_of(self.subscription.next_seq)
            self._at_ns = min(now_ns, max(self._sent_ns, stamp_ns))
        return self._at_ns < self._next_ns

    def _count_interval(self) -> None:
        # The limit is a grid while the topic keeps up; after a pause the grid restarts.
        self._next_ns += self._interval_ns
        if self._next_ns < self._at_ns:
            self._next_ns = self._at_ns + self._interval_ns

    def _pass_over(self) -> None:
        if self.subscription.skip():
            self.limited += 1

    def close(self, gone: bool = False) -> None:
        """
        Stop reading the topic.

        :param gone: the client has closed the connection and reads nothing more.
        """
        if self._trigger in self.topic.triggers:
            self.topic.triggers.remove(self._trigger)
        self._bus.unsubscribe(self.subscription)

    def statistics(self) -> MirrorStatistics:
        """Return the statistics, all of the same time."""
        s = self.subscription
        while True:
            head = self.topic.head
            taken = MirrorStatistics(
                self.topic.name, self.policy.value, self.max_rate_hz, head - self._began,
                self.sent, self.full, s.statistics().lost, s.skipped, self.limited, s.unread,
                self.delay_ms)
            if head == self.topic.head:  # no sample was published in between
                return taken

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
    Which samples a client gets.

    DRAIN: all of them. LATEST: the newest whenever the link runs; the others are skipped.
    """

    DRAIN = 'drain'
    LATEST = 'latest'


@dataclass(frozen=True)
class MirrorStatistics:
    """
    One topic on its way to one client.

    sent + full + lost + skipped + limited + waiting = published.

    :ivar published: samples of the topic since the mirror began.
    :ivar full: samples that the client's full socket refused, or for which it had given no slot
        back.
    :ivar lost: samples overwritten in the ring before they could be sent.
    :ivar skipped: samples passed over by ``latest``.
    :ivar limited: samples passed over by ``max_rate_hz``.
    :ivar delay_ms: how long a sample may wait in the core for others; 0: as all mirrors do.
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
    One topic to one client; used by the link's task alone.

    :param channel: number of the topic.
    :param batch: what the client gets next.
    :param max_rate_hz: 0 for no limit.
    :param gather: releases the link's task as long as the mirror is there.
    :param buffer: where samples are copied to at first.
    :ivar patient: what a full socket refuses stays in the ring and is tried again, until it is
        overwritten there; otherwise it is lost at once.
    :ivar sent: samples handed to the client's socket, or in the packet that it gets next.
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
        self.subscription.msg = None  # nobody reads it: samples go where they are sent from
        self._trigger = Gathered(gather, self.subscription)
        self.topic.triggers.append(self._trigger)
        self._began = self.subscription.next_seq
        self.patient = False
        self.sent = self.full = self.limited = 0
        self._next_ns = self._carried_ns = self._at_ns = 0
        self.set_policy(policy, max_rate_hz)

    def set_policy(self, policy: Policy, max_rate_hz: float, delay_ms: float = 0.0) -> None:
        """
        Change what is sent from now on.

        :param delay_ms: how long a sample may wait for others; 0: as long as the link gathers.
        """
        self.policy = policy
        self._latest = policy is Policy.LATEST
        self.max_rate_hz = max_rate_hz
        self.delay_ms = delay_ms
        self._trigger.delay_ns = round(delay_ms * NS_PER_MS)
        self._interval_ns = round(NS_PER_S / max_rate_hz) if max_rate_hz > 0 else 0

    def begin_with_oldest(self) -> None:
        """Send what is kept already, too; before anything was sent."""
        self.subscription.rewind()
        self._began = self.subscription.next_seq

    @property
    def missed(self) -> int:
        """How many samples the client lost: those that it asked to leave out do not count."""
        return self.full + self.subscription.lost

    def carry(self, now_ns: int) -> bool:
        """
        Send what is there and due; never waits.

        :return: whether there was anything.
        :raises OSError: the client is gone.
        """
        unread = self.subscription.unread
        if not unread:
            return False
        try:
            self._carry(now_ns, unread)
        finally:
            self._carried_ns = now_ns
            self._trigger.carried()
        return True

    def _carry(self, now_ns: int, unread: int) -> None:
        """
        Put what is there and due into the batch; more that comes meanwhile waits for the next.

        :raises OSError: the client is gone.
        """
        subscription, batch = self.subscription, self._batch
        take = subscription.latest if self._latest else subscription.take
        for _ in range(1 if self._latest else unread):
            if self._interval_ns and self._is_early(now_ns):
                if self._latest:
                    return
                self._pass_over()
                continue
            room = batch.room(self._longest)
            if room is None:
                if not self.patient:
                    self.full += subscription.skip(self._latest)
                return
            subscription.buffer = room
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

        What waited for others counts from when it was published, or as near as its stamp tells.
        """
        if self._latest:
            self._at_ns = now_ns
        else:
            stamp_ns = self.topic.stamp_of(self.subscription.next_seq)
            self._at_ns = min(now_ns, max(self._carried_ns, stamp_ns))
        return self._at_ns < self._next_ns

    def _count_interval(self) -> None:
        # The limit is a grid while the topic keeps up; after a pause the grid starts anew.
        self._next_ns += self._interval_ns
        if self._next_ns < self._at_ns:
            self._next_ns = self._at_ns + self._interval_ns

    def _pass_over(self) -> None:
        if self.subscription.skip():
            self.limited += 1

    def close(self, gone: bool = False) -> None:
        """
        Stop reading the topic.

        :param gone: the client has closed the connection and reads nothing any more.
        """
        if self._trigger in self.topic.triggers:
            self.topic.triggers.remove(self._trigger)
        self._bus.unsubscribe(self.subscription)

    def statistics(self) -> MirrorStatistics:
        """Take the statistics, all of the same moment."""
        s = self.subscription
        while True:
            head = self.topic.head
            taken = MirrorStatistics(
                self.topic.name, self.policy.value, self.max_rate_hz, head - self._began,
                self.sent, self.full, s.statistics().lost, s.skipped, self.limited, s.unread,
                self.delay_ms)
            if head == self.topic.head:  # nobody published in between
                return taken

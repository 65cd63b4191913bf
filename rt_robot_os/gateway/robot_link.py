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

"""The gateway's connection to the core: one reconnecting client of the link, in a thread."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from pathlib import Path
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.schema import star_match
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.reading import Sample
from rt_robot_os.gateway.reading import TopicListener
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.client import LinkSilent
from rt_robot_os.link.client import TopicInfo
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.threaded_client import advertise
from rt_robot_os.link.threaded_client import run_of
from rt_robot_os.link.threaded_client import ThreadedClient

#: How long the core may delay a sample to batch it with others, which reduces its load.
DELAY_MS: Final = 20.0


@dataclass
class _Read:
    """One mirror: the parts that read its samples, and the request to the core."""

    info: TopicInfo
    reads: list[Reads] = field(default_factory=list)
    asked: tuple[Any, ...] = ()

    def wanted(self, limit_hz: float) -> dict[str, Any]:
        """Return the request; signals are limited to the rate that pages request."""
        if any(each.every for each in self.reads):
            return {'policy': 'drain', 'max_rate_hz': 0.0, 'oldest': True, 'patient': True}
        rates = [min(each.rate_hz or limit_hz, limit_hz) if each.shown and limit_hz
                 else each.rate_hz for each in self.reads]
        rate_hz = 0.0 if 0.0 in rates else max(rates)
        return {'policy': 'latest', 'max_rate_hz': rate_hz, 'initial': True,
                'delay_ms': DELAY_MS}


class RobotLink:
    """
    Passes samples of the core to the parts, and messages of parts to the core.

    :param path: of the core's socket.
    :param tell: receives a line of text when the core is lost and when it is back.
    :ivar run_id: unique id of the connected core; empty before the first.
    :ivar topics: topics of the core, by name.
    :ivar samples: received samples.
    :ivar missed: lost samples of topics of which all are requested.
    :ivar limit_hz: highest rate of topics that are read for pages; 0 for no limit.
    :ivar published: messages to the core.
    :ivar faulty: samples that a part could not read.
    """

    def __init__(self, path: Path, tell: Callable[[str], None]) -> None:
        self.path = path
        self.run_id = ''
        self.topics: Mapping[str, TopicInfo] = {}
        self.samples = self.missed = self.published = self.faulty = 0
        self.limit_hz = 0.0
        self._tell = tell
        self._parts: tuple[TopicListener, ...] = ()
        self._channels: dict[str, int] = {}
        self._in_core: frozenset[str] = frozenset()
        self._by_channel: dict[int, _Read] = {}
        self._missed_by_channel: dict[int, int] = {}
        self._link = ThreadedClient(path, 'gateway', self._connect, tell, self._ask)
        self._told: set[str] = set()

    @property
    def connected(self) -> bool:
        """Whether there is a core."""
        return self._link.client is not None

    def start(self, parts: Iterable[TopicListener]) -> None:
        """Read for these parts from now on."""
        self._parts = tuple(parts)
        self._link.start()

    def stop(self) -> None:
        """Disconnect; may be called twice."""
        self._link.stop()

    def has(self, topic: str) -> bool:
        """Return whether the core has a topic that this side may publish. Any thread."""
        return topic in self._channels

    def is_read(self, topic: str) -> bool:
        """
        Return whether the core or another client reads what is published on a topic.

        Topics that the core reads are known since the connection was made; otherwise the core is
        asked, which may take a moment. Any thread.

        :raises LinkError: there is no core, or it does not answer.
        """
        client = self._link.client
        if client is None:
            raise LinkError('the robot does not run')
        if topic in self._in_core:
            return True
        found = client.readers(topic)
        return bool(found.in_core or found.clients)

    def publish(self, topic: str, cdr: bytes, stamp_ns: int = 0) -> None:
        """
        Publish a message immediately. Any thread.

        :param cdr: with its four bytes of encapsulation.
        :raises LinkError: there is no core, it has no such topic, or it is too slow.
        """
        client = self._link.client
        if client is None:
            raise LinkError('the robot does not run')
        channel = self._channels.get(topic)
        if channel is None:
            raise LinkError(f'this robot has no topic {topic} that others may publish: its '
                            'parameter file lists none (topics)')
        client.publish(channel, cdr, stamp_ns)
        self.published += 1

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        return {'robot': self.connected, 'samples': self.samples, 'missed': self.missed,
                'published': self.published, 'faulty': self.faulty}

    # ---- in its thread -----------------------------------------------------------------------

    def _connect(self, client: LinkClient) -> None:
        self.run_id = run_of(client)
        self.topics = client.topics
        self._by_channel = {}
        self._missed_by_channel = {}
        for part in self._parts:
            for read in part.reads():
                for name, info in client.topics.items():
                    if star_match(read.topic, name) is not None:
                        self._by_channel.setdefault(info.channel, _Read(info)).reads.append(read)
        wanted = dict.fromkeys(topic for part in self._parts for topic in part.publishes())
        channels = advertise(client, (topic for topic in wanted if topic in client.topics),
                             self._tell)
        self._in_core = frozenset(
            topic for topic in channels if client.readers(topic).in_core)
        self._channels = channels
        for part in self._parts:
            part.met_robot(client.topics)
        client.on_data = self._take
        self._ask(client)

    def _ask(self, client: LinkClient) -> None:
        """Send the requests that were not sent yet."""
        for read in self._by_channel.values():
            wanted = read.wanted(self.limit_hz)
            if read.asked != (asked := tuple(wanted.values())):
                read.asked = asked
                try:
                    client.mirror(read.info.name, **wanted)
                except LinkSilent:
                    read.asked = ()  # busy: it is asked again
                    return
                except LinkError as error:
                    self._tell(f'{read.info.name}: {error}')

    def _take(self, head: Header, cdr: memoryview) -> None:
        read = self._by_channel.get(head.channel)
        if read is None:
            return
        self.samples += 1
        before = self._missed_by_channel.get(head.channel, 0)
        if head.missed > before:
            self._missed_by_channel[head.channel] = head.missed
            self.missed += head.missed - before
        sample = Sample(read.info.name, read.info.type_name, head.stamp_ns, head.seq, cdr)
        for each in read.reads:
            try:
                each.take(sample)
            except (ValueError, LookupError, TypeError) as error:
                self.faulty += 1
                if sample.topic not in self._told:  # once, not with each sample
                    self._told.add(sample.topic)
                    self._tell(f'{sample.topic}: {type(error).__name__}: {error}')


def utc_of(stamp_ns: int) -> int:
    """Return the time of day of a moment on CLOCK_MONOTONIC, by the present clock."""
    return time.time_ns() - max(0, time.monotonic_ns() - stamp_ns)

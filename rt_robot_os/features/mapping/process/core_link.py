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

"""The core as mapping reaches it: one lasting connection of the link, read by a thread."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.reader import SampleHandler
from rt_robot_os.link.threaded_client import advertise
from rt_robot_os.link.threaded_client import run_of
from rt_robot_os.link.threaded_client import ThreadedClient
from rt_robot_os.motion.mounting import BASE_FRAME
from rt_robot_os.motion.mounting import in_base
from rt_robot_os.motion.mounting import Mounting

#: How long the core may keep a sample to send it with others: less work for it.
_DELAY_MS: Final = 10.0


class CoreLink:
    """
    Samples of the core to who reads them, and samples back.

    :param path: of the core's socket.
    :param needed: topics without which there is nothing to do.
    :param reads: who takes the samples of which topic; each sample, in order. A topic that the
        core does not have is left out, unless it is needed.
    :param publishes: topics that are published where the core has them.
    :param on_core: called by the reading thread with each new connection: whether it is another
        core than before.
    :param tell: takes a line of text.
    :ivar topics: that the core has.
    :ivar run_id: of the core that is connected; another one has another. Empty before the first.
    :ivar counts: ``published``, ``unpublished`` (the core did not take them), ``connections``.
    """

    def __init__(self, path: Path, needed: tuple[str, ...], reads: Mapping[str, SampleHandler],
                 publishes: tuple[str, ...], on_core: Callable[[bool], None],
                 tell: Callable[[str], None]) -> None:
        self.topics: frozenset[str] = frozenset()
        self.counts = {'published': 0, 'unpublished': 0, 'connections': 0}
        self._needed = needed
        self._reads = reads
        self._publishes = publishes
        self._on_core = on_core
        self._tell = tell
        self._told: set[str] = set()
        self.run_id = ''
        self._channels: Mapping[str, int] = MappingProxyType({})
        self._mountings: Mapping[str, Mounting] = MappingProxyType({})
        self._link = ThreadedClient(path, 'mapping', self._connect, tell)

    def start(self) -> None:
        """Read from now on."""
        self._link.start()

    def stop(self) -> None:
        """Disconnect; may be called twice."""
        self._link.stop()

    @property
    def is_connected(self) -> bool:
        """Return whether there is a core."""
        return self._link.client is not None

    def has(self, topic: str) -> bool:
        """Return whether somebody would get what is published there."""
        return topic in self._channels

    def publish(self, topic: str, cdr: bytes, stamp_ns: int = 0) -> bool:
        """
        Publish a sample; any thread.

        :return: False when there is no core that takes it.
        """
        client, channel = self._link.client, self._channels.get(topic)
        if client is None or channel is None:
            return False
        try:
            client.publish(channel, cdr, stamp_ns)
        except LinkError:
            self.counts['unpublished'] += 1
            return False
        self.counts['published'] += 1
        return True

    def mounting_of(self, frame_id: str) -> Mounting | None:
        """Return where a frame is on the robot; None when nobody says it."""
        found = in_base(self._mountings, frame_id)
        if frame_id != BASE_FRAME and found.parent != BASE_FRAME:
            return None
        return found if frame_id != BASE_FRAME else Mounting()

    # ---- in its thread -----------------------------------------------------------------------

    def _connect(self, client: LinkClient) -> None:
        """
        Take a new connection.

        :raises LinkError: this robot has nothing to map with, or does not answer in time.
        """
        for topic in self._needed:
            if topic not in client.topics:
                raise LinkError(f'this robot has no topic {topic}: mapping needs scans and '
                                'odometry (scan_topic, odom_topic)')
        self.topics = frozenset(client.topics)
        self._mountings = _mountings(client)
        run_id = run_of(client)
        is_new, self.run_id = run_id != self.run_id, run_id
        self.counts['connections'] += 1
        self._on_core(is_new)
        for topic in self._publishes:
            if topic not in client.topics:
                self._tell_once(f'this robot has no topic {topic}: nobody gets what mapping '
                                'publishes there (docs/mapping.md)')
        self._channels = advertise(client, (topic for topic in self._publishes
                                            if topic in client.topics), self._tell_once)
        for topic, take in self._reads.items():
            if topic in client.topics:
                client.sample_handlers[client.topics[topic].channel] = take
                # Of scans those of before are of no use: nobody knows the odometry of their time.
                client.mirror(topic, oldest=topic != self._needed[0], patient=True,
                              delay_ms=_DELAY_MS)

    def _tell_once(self, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._tell(text)


def _mountings(client: LinkClient) -> dict[str, Mounting]:
    """Ask a core where the frames of its devices are."""
    found: dict[str, Any] = client.request('frames').get('frames', {})
    return {frame: Mounting(tuple(each['position_m']), tuple(each['rotation_rad']),
                            each['parent']) for frame, each in found.items()}

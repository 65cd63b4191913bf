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
The recorder: a client of the link that writes what it gets.

Two threads: this one receives, in batches, so that the sockets stay empty; the other compresses
and writes, so that a slow disk costs memory, up to a limit, and no samples.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Mapping
from dataclasses import dataclass
import json
from pathlib import Path
import queue
import threading
import time
from typing import Final

from rt_robot_os.clients.recording.bag import Bag
from rt_robot_os.clients.recording.bag import Packet
from rt_robot_os.clients.recording.definitions import is_known
from rt_robot_os.clients.recording.session import ros_names
from rt_robot_os.clients.recording.session import Session
from rt_robot_os.core.tap_format import is_tap
from rt_robot_os.core.tap_format import SCHEDULE_TOPIC
from rt_robot_os.errors import LinkError
from rt_robot_os.errors import RecordingError
from rt_robot_os.link import LinkClient
from rt_robot_os.link import TopicInfo
from rt_robot_os.link.protocol import Header
from rt_robot_os.units import NS_PER_S

# Packets that arrive within this wait for each other: one wake-up for all of them. A socket of
# the usual size holds three times as many at 10 000 a second, and the rings of the topics more.
_BATCH_S: Final = 0.01
_LOOK_S: Final = 0.1
_RETRY_S: Final = 0.2
_QUEUE_BYTES: Final = 64 << 20
_BEAT_NS: Final = NS_PER_S // 2
# A sample is on its way for the interval in which the link gathers, and the recorder's own.
_ON_ITS_WAY_NS: Final = NS_PER_S // 20
# The core notes ten times a second what its tasks did, when nothing else has to run.
_SCHEDULE_NS_MOST: Final = 2 * NS_PER_S
_INPUT_BYTES_MOST: Final = 1 << 16
_FILLED: Final = 0.9


@dataclass(frozen=True)
class Wanted:
    """
    What to record.

    :ivar topics: names, in the core or in ROS; empty for all.
    :ivar replay: keep what a replay needs, too.
    :ivar duration_ns: since the first connection; 0 until stopped.
    :ivar core_names: topics are called in the bag as in the core.
    """

    topics: tuple[str, ...] = ()
    replay: bool = True
    duration_ns: int = 0
    core_names: bool = False


@dataclass(frozen=True)
class Status:
    """The state of a recording, once a second."""

    elapsed_ns: int
    messages: int
    size: int
    lost: dict[str, int]
    connected: bool


class Recorder:
    """
    Record a robot until stopped.

    :param path: of the core's socket.
    :param tell: called with lines for people.
    :param show: called once a second with the status.
    :ivar stopping: set it to end.
    """

    def __init__(self, path: Path, bag: Bag, wanted: Wanted, tell: Callable[[str], None],
                 show: Callable[[Status], None]) -> None:
        self.stopping = False
        self._asked_ns = time.monotonic_ns()
        self._path = path
        self._robot = path.stem
        self._bag = bag
        self._wanted = wanted
        self._tell = tell
        self._show = show
        self._sessions = 0
        self._batch: list[Packet] = []
        self._queue: queue.SimpleQueue[Session | list[Packet] | None] = queue.SimpleQueue()
        self._queued = self._written = self._dropped = 0
        self._error: Exception | None = None
        self._begin_ns = self._shown_ns = 0
        self._schedule = -1
        self._schedule_ns = 0

    # ---- receiving ---------------------------------------------------------------------------

    def run(self) -> None:
        """
        Record; returns when stopped, or when the time is over.

        :raises RecordingError: it cannot be written any more; what was written is closed.
        """
        writer = threading.Thread(target=self._write, name='writer')
        writer.start()
        try:
            waiting = False
            while not self._over():
                try:
                    client = LinkClient(self._path, 'record')
                except LinkError as error:
                    if not waiting:
                        self._tell(f'waiting for a core: {error}' if not self._sessions else
                                   'the core is gone; waiting for it to come back')
                    waiting = True
                    time.sleep(_RETRY_S)
                    self._report(False)
                    continue
                waiting = False
                with client:
                    self._record(client)
        finally:
            self._queue.put(None)
            writer.join()
        self._report(False, last=True)
        if self._error is not None:
            what = (self._error.strerror if isinstance(self._error, OSError)
                    and self._error.strerror else str(self._error))
            raise RecordingError(f'recording stopped: {what}; {self._bag.rescue()}')

    def _over(self) -> bool:
        wanted_ns = self._wanted.duration_ns
        return self.stopping or self._error is not None or (
            wanted_ns > 0 and self._begin_ns > 0
            and time.monotonic_ns() - self._begin_ns >= wanted_ns + _ON_ITS_WAY_NS)

    def _record(self, client: LinkClient) -> None:
        """Record one core until it is gone."""
        try:
            session = self._session(client)
            client.on_data = self._take
            self._queue.put(session)
            self._mirror(client, session)
            beat_ns = 0
            while not self._over():
                client.pump(_LOOK_S)
                self._hand_over()
                now_ns = time.monotonic_ns()
                if now_ns - beat_ns > _BEAT_NS:
                    beat_ns = now_ns
                    client.beat()
                self._report(True)
                time.sleep(_BATCH_S)
            self._await_schedule(client)
            client.pump(0.0)
        except LinkError as error:
            if not self.stopping:
                self._tell(f'{error}; what it sent is kept')
        finally:
            self._hand_over()

    def _await_schedule(self, client: LinkClient) -> None:
        """Take the schedule up to now, so that a replay goes as far as what was recorded."""
        now_ns = time.monotonic_ns()
        while (self._error is None and self._schedule >= 0 and self._schedule_ns < now_ns
               and time.monotonic_ns() < now_ns + _SCHEDULE_NS_MOST):
            client.pump(_LOOK_S)
            self._hand_over()

    def _mirror(self, client: LinkClient, session: Session) -> None:
        """Begin with what the rings still hold only where somebody has a use for it."""
        from_start = not session.begin_ns or (
            session.tapped and bool(session.taps) and _is_all_there(client, session.taps))
        latched = {name for name, facts in session.topic_facts().items()
                   if any(each.durability == 'transient_local' for each in facts)}
        names = dict.fromkeys(info.name for info in (*session.asked, *session.kept))
        # The schedule comes last: a reader has met the samples that it refers to.
        for name in sorted(names, key=lambda name: name == SCHEDULE_TOPIC):
            client.mirror(name, oldest=from_start, initial=name in latched, patient=True)

    def _session(self, client: LinkClient) -> Session:
        settings = ''.join(str(part['text']) for part in client.request_all('settings'))
        was_tapped = any(map(is_tap, client.topics))
        taps = client.tap() if self._wanted.replay else ()
        self._schedule = client.topics[SCHEDULE_TOPIC].channel if SCHEDULE_TOPIC in taps else -1
        chosen = self._asked(client, settings)
        kept = [info for info in client.topics.values() if info.name in taps
                or (self._wanted.replay and info not in chosen
                    and _is_input(info, settings) and is_known(info.type_name))]
        if self._wanted.replay:
            kept += [info for info in chosen if info not in kept]
        start_ns, now_ns = int(client.core['start_ns']), time.monotonic_ns()
        cold = start_ns >= self._asked_ns
        self._begin_ns = self._begin_ns or (start_ns if cold else now_ns)
        session = Session(
            self._sessions, int(client.core['pid']), start_ns, was_tapped,
            tuple(client.core['tasks']), tuple(client.topics), tuple(chosen), tuple(kept), taps,
            settings, self._robot, 0 if cold else now_ns,
            self._wanted.duration_ns and self._begin_ns + self._wanted.duration_ns,
            self._wanted.core_names)
        self._sessions += 1
        topics = '1 topic' if len(chosen) == 1 else f'{len(chosen)} topics'
        self._tell(f'connected to the core (pid {session.pid}): recording {topics} '
                   f'to {self._bag.folder}')
        return session

    def _asked(self, client: LinkClient, settings: str) -> list[TopicInfo]:
        """
        Find the topics that were asked for.

        :raises UnknownTopicError: the first core does not have one of them.
        """
        known = client.topics
        mirrored = ros_names(settings, self._robot)
        in_ros = {name: topic for topic, names in mirrored.items() for name, _ in names}
        if not self._wanted.topics:
            names = [name for name in known if not is_tap(name)]
        else:
            found = {text: _found(text, known, in_ros) for text in self._wanted.topics}
            missing = [text for text, name in found.items() if not name]
            if missing:
                names = sorted(in_ros.keys() | {
                    f'/{name}' for name in known if name not in mirrored and not is_tap(name)})
                text = f'no topic {", ".join(missing)} in the core; there are {", ".join(names)}'
                if not self._sessions:
                    raise UnknownTopicError(text)
                self._tell(text)
            names = list(dict.fromkeys(filter(None, found.values())))
        chosen = []
        for info in (known[name] for name in names):
            if is_known(info.type_name):
                chosen.append(info)
            else:
                self._tell(f'topic {info.name}: {info.type_name} is not installed here; it is '
                           'not recorded')
        return chosen

    def _take(self, head: Header, cdr: memoryview) -> None:
        self._batch.append((head, bytearray(cdr)))
        if head.channel == self._schedule:
            self._schedule_ns = head.stamp_ns

    def _hand_over(self) -> None:
        batch, self._batch = self._batch, []
        if not batch:
            return
        size = sum(len(cdr) for _, cdr in batch)
        if self._queued + size - self._written > _QUEUE_BYTES:
            self._dropped += len(batch)  # the gaps in their numbers count them by topic
            return
        self._queued += size
        self._queue.put(batch)

    def _report(self, connected: bool, last: bool = False) -> None:
        now_ns = time.monotonic_ns()
        if self._begin_ns and (last or now_ns - self._shown_ns >= NS_PER_S):
            self._shown_ns = now_ns
            self._show(Status(now_ns - self._begin_ns, self._bag.messages, self._bag.size,
                              self._bag.lost, connected))

    # ---- writing -----------------------------------------------------------------------------

    def _write(self) -> None:
        try:
            while True:
                try:
                    item = self._queue.get(timeout=_LOOK_S)
                except queue.Empty:
                    item = []
                if item is None:
                    self._bag.end()
                    return
                if isinstance(item, Session):
                    self._bag.begin(item)
                else:
                    self._bag.write(item)
                    self._written += sum(len(cdr) for _, cdr in item)
                self._bag.tick(time.monotonic_ns())
        except Exception as error:
            self._error = error


class UnknownTopicError(RecordingError):
    """A topic was asked for that the core does not have."""


def _found(text: str, known: Mapping[str, TopicInfo], in_ros: Mapping[str, str]) -> str:
    """Find a topic by its name in ROS or in the core; empty when there is none."""
    name = text.strip('/')
    if text.startswith('/') and text.rstrip('/') in in_ros:
        return in_ros[text.rstrip('/')]
    return name if name in known else in_ros.get(f'/{name}', '')


def _is_all_there(client: LinkClient, taps: Collection[str]) -> bool:
    """Whether the rings of the taps still hold everything, with room for what comes next."""
    return all(topic['published'] < _FILLED * topic['depth']
               for topic in client.statistics().topics if topic['name'] in taps)


def _is_input(info: TopicInfo, settings: str) -> bool:
    """Whether clients publish it, so that a replay cannot make it."""
    declared = {each['topic'] for each in json.loads(settings)['topics']}
    return info.name in declared and info.max_size <= _INPUT_BYTES_MOST

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

"""The scans of a bag with the pose of odometry at each, for a mapper."""

from __future__ import annotations

from collections import Counter
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.bags.bag import BagReader
from rt_robot_os.features.mapping.bags.frames import Frames
from rt_robot_os.features.mapping.bags.frames import Transform
from rt_robot_os.features.mapping.bags.frames import transforms_in
from rt_robot_os.features.mapping.bags.sessions import RecordingSessions
from rt_robot_os.features.mapping.bags.storage import BagMessage
from rt_robot_os.features.mapping.bags.topics import choose
from rt_robot_os.features.mapping.bags.topics import listed
from rt_robot_os.features.mapping.messages import odometry_in
from rt_robot_os.features.mapping.messages import scan_in
from rt_robot_os.features.mapping.slam.deskew import beam_seconds
from rt_robot_os.features.mapping.slam.deskew import LaserMount
from rt_robot_os.features.mapping.slam.deskew import scan_of
from rt_robot_os.features.mapping.slam.deskew import Sweep
from rt_robot_os.features.mapping.slam.max_range import echo_ranges
from rt_robot_os.features.mapping.slam.odometry_track import GAP_NS
from rt_robot_os.features.mapping.slam.odometry_track import OdometryTrack
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.messages.cdr import CdrReader

#: Scans that wait for odometry, or for the frames of the robot.
_WAITING_MOST: Final = 100
#: Transforms that are stored until it is known which of them are odometry.
_EARLY_MOST: Final = 1000
#: Largest difference between the clocks of scans and odometry.
_CLOCKS_NS: Final = 5 * NS_PER_S
_TILT_RAD: Final = math.radians(10.0)


@dataclass(frozen=True)
class BagOptions:
    """
    Options of a command line for a bag.

    :ivar scan_topic: '' for the only one; so ``odom_topic``.
    :ivar laser: mounting of the laser; None: that in the bag.
    :ivar session: of a recording by `record`; None for the first.
    """

    scan_topic: str = ''
    odom_topic: str = ''
    laser: LaserMount | None = None
    session: int | None = None


class BagLog:
    """
    The scans of a bag.

    :raises ConfigError: it cannot be read, or the choice of topics is ambiguous.
    :ivar topics: the ones that are read.
    :ivar problems: a sentence for each problem, complete when all scans were read.
    :ivar counts: of dropped and doubtful samples, by kind.
    :ivar mount: of the laser; None until it is known.
    """

    reference = None

    def __init__(self, path: Path, options: BagOptions = BagOptions()) -> None:
        self._path = path
        self._bag = BagReader(path)
        self._sessions = RecordingSessions(self._bag.files, options.session)
        self.topics = choose(self._bag.look(), options.scan_topic, options.odom_topic)
        self.problems: list[str] = []
        self.counts: Counter[str] = Counter()
        self.mount = options.laser
        self._frames = Frames()
        self._track = OdometryTrack()
        self._waiting: deque[tuple[Sweep, str]] = deque()
        self._base = ''
        self._early: deque[tuple[int, Transform]] = deque(maxlen=_EARLY_MOST)
        self._skews: dict[str, int] = {}
        self._uses_log_time = False
        self._last_ns = -1

    @property
    def share_read(self) -> float:
        """Return how much of the files was read, from 0 to 1."""
        return min(1.0, self._bag.findings.read_bytes / max(1, self._bag.size_bytes))

    @property
    def bad(self) -> int:
        """Return how many messages could not be read."""
        return self._bag.findings.lost + self.counts['damaged']

    def scans(self) -> Iterator[Scan]:
        """
        Yield all scans, each as soon as odometry is known at its last beam.

        :raises ConfigError: there is none.
        """
        self._frames.links.update(self._sessions.mountings)
        scans = 0
        for file, message in self._bag.messages(self.topics.wanted):
            if self._sessions.leaves_out(file):
                continue
            try:
                self._take(message)
            except ValueError:
                self.counts['damaged'] += 1
            for scan in self._ready(is_last=False):
                scans += 1
                yield scan
        for scan in self._ready(is_last=True):
            scans += 1
            yield scan
        self._tell()
        if not scans:
            self._refuse()

    def _refuse(self) -> None:
        if not len(self._track):
            what = self.topics.odometry or (
                f'{", ".join(self.topics.moving)} from odom to the robot')
            why = f'no odometry could be read on {what}'
        else:
            why = f'no scan could be read on {self.topics.scan}'
        raise ConfigError([f'{self._path}: {why}', *self.problems,
                           *listed(self._bag.findings.types)])

    # ---- messages ------------------------------------------------------------------------------

    def _take(self, message: BagMessage) -> None:
        if message.topic == self.topics.scan:
            self._take_scan(message)
        elif message.topic == self.topics.odometry:
            reader = CdrReader(message.cdr)
            stamp_ns = self._stamp(reader.stamp_ns(), message)
            reader.text()
            self._base = reader.text().lstrip('/')
            self._odometry(stamp_ns, odometry_in(message.cdr))
        else:
            self._take_transforms(message)

    def _take_scan(self, message: BagMessage) -> None:
        given = scan_in(message.cdr)
        stamp_ns = self._stamp(CdrReader(message.cdr).stamp_ns(), message)
        numbers = (given.angle_min, given.angle_increment)
        if not (all(map(math.isfinite, numbers)) and given.angle_increment and len(given.ranges)):
            raise ValueError('no scan')
        if stamp_ns <= self._last_ns:
            self.counts['backwards'] += 1
            return
        self._last_ns = stamp_ns
        ranges = echo_ranges(given.ranges, given.range_min, given.range_max)
        beam_s = beam_seconds(given.time_increment_s, given.scan_time_s, given.angle_increment,
                              len(ranges))
        self._waiting.append((Sweep(stamp_ns, ranges, *numbers, beam_s),
                              given.frame_id.lstrip('/')))

    def _take_transforms(self, message: BagMessage) -> None:
        is_fixed = message.topic in self.topics.fixed
        for transform in transforms_in(message.cdr):
            self._frames.add(transform, is_fixed)
            if not (is_fixed or self.topics.odometry):
                stamp_ns = self._stamp(transform.stamp_ns, message)
                if self._base:
                    self._take_moving(stamp_ns, transform)
                else:
                    self._early.append((stamp_ns, transform))

    def _take_moving(self, stamp_ns: int, transform: Transform) -> None:
        if transform.child == self._base:
            x, y, _ = transform.mounting.position_m
            self._odometry(stamp_ns, (x, y, transform.mounting.yaw_rad))

    def _odometry(self, stamp_ns: int, pose: tuple[float, float, float]) -> None:
        if not self._track.add(stamp_ns, pose):
            self.counts['odometry backwards'] += 1

    def _stamp(self, stamp_ns: int, message: BagMessage) -> int:
        """Return the stamp of a message; its recording time, if the clocks differ."""
        kind = 'scans' if message.topic == self.topics.scan else 'odometry'
        self._skews.setdefault(kind, stamp_ns - message.log_ns)
        if len(self._skews) == 2 and not self._uses_log_time:
            apart_ns = abs(self._skews['scans'] - self._skews['odometry'])
            if apart_ns > _CLOCKS_NS:
                self._change_clock(apart_ns)
        return message.log_ns if self._uses_log_time else stamp_ns

    def _change_clock(self, apart_ns: int) -> None:
        self._uses_log_time = True
        self.problems.append(
            f'scans and odometry are stamped by clocks that are {apart_ns / NS_PER_S:.3g} s '
            'apart: the times of recording are used')
        self.counts['without odometry'] += len(self._waiting)
        self._waiting.clear()
        self._track.clear()
        self._early.clear()
        self._last_ns = -1

    # ---- scans ---------------------------------------------------------------------------------

    def _ready(self, is_last: bool) -> Iterator[Scan]:
        while self._waiting:
            sweep, frame = self._waiting[0]
            is_due = is_last or len(self._waiting) > _WAITING_MOST
            if not self._knows_mount(frame, is_due) or not len(self._track):
                if not is_due:
                    return
                self._waiting.popleft()
                self.counts['without odometry'] += 1
                continue
            begin_ns, end_ns = sweep.span_ns
            if end_ns > self._track.last_ns and not is_due:
                return
            self._waiting.popleft()
            first_ns, last_ns = self._track.first_ns, self._track.last_ns
            if end_ns < first_ns - GAP_NS or begin_ns > last_ns + GAP_NS:
                self.counts['without odometry'] += 1
                continue
            self.counts['gaps'] += not self._track.covers(max(begin_ns, first_ns),
                                                          min(end_ns, last_ns))
            assert self.mount is not None
            yield scan_of(sweep, self._track, self.mount)

    def _knows_mount(self, frame: str, is_due: bool) -> bool:
        """Determine the mounting of the laser, and the frame of odometry."""
        if not self.topics.odometry and not self._base:
            self._base = self._frames.odometry_link(frame) or (
                self._frames.odometry_link_of_any() if is_due or self.mount else '')
            if not self._base:
                return False
            for early in self._early:
                self._take_moving(*early)
            self._early.clear()
        if self.mount is None and self._base:
            found = self._frames.seen_from(frame, self._base)
            if found is not None:
                self.mount = LaserMount.of(found)
                if self.mount.tilt_rad > _TILT_RAD:
                    self.problems.append(
                        f'the laser {frame} is tilted by {math.degrees(self.mount.tilt_rad):.0f} '
                        'degrees: it cannot make a map in the plane')
            elif is_due:
                self.mount = LaserMount(np.zeros(3))
                self.problems.append(
                    f'the bag has no transform from {self._base} to {frame or "the laser"}: it is '
                    'assumed to be zero; set it with --laser X,Y,YAW')
        return self.mount is not None

    def _tell(self) -> None:
        """Report dropped and doubtful samples."""
        self.problems.extend(self._sessions.problems)
        self.problems.extend(self._bag.findings.problems)
        counts = self.counts
        for count, text in (
                (self.bad, 'messages were damaged and dropped'),
                (counts['backwards'], 'scans were stamped before earlier ones, and dropped'),
                (counts['odometry backwards'], 'messages of odometry were stamped before earlier '
                                               'ones, and dropped'),
                (counts['without odometry'], 'scans had no odometry at their time, and were '
                                             'dropped'),
                (counts['gaps'], 'scans lie in gaps of odometry of more than 0.5 s')):
            if count:
                self.problems.append(f'{count} {text}')

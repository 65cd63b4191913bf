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
Detection of a person who does not move, stays in a room, or is away for too long.

No topics, no kernel. Times are stamps of samples and deadlines between them. Silence of all
sensors is never a cause here, because a silent sensor has its own cause.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import math
from typing import Final
from typing import NamedTuple

_NS_PER_S: Final = 1_000_000_000
#: A person moves again after two movements this far apart, or one that lasts.
AGAIN_NS: Final = 5 * _NS_PER_S
LASTS_NS: Final = 30 * _NS_PER_S
_AGAIN_WITHIN_NS: Final = 60 * _NS_PER_S

NO_MOVEMENT: Final = 'no_movement'
WANDERING: Final = 'wandering'
LEFT_HOME: Final = 'left_home'
#: A room of this name is not the home.
OUTSIDE: Final = 'outside'


@dataclass(frozen=True)
class ActivityLimits:
    """
    Limits of the durations.

    :ivar still_ns: without movement; 0: no limit.
    :ivar still: the same by room, such as the bed.
    :ivar stay: in a room.
    :ivar away_ns: unseen after an exit; 0: no limit.
    :ivar blind_ns: without a sample of a relevant sensor, after which the state is unknown.
    :ivar room_ns: in another room, after which it is the current one.
    """

    still_ns: int
    still: Mapping[str, int] = field(default_factory=dict)
    stay: Mapping[str, int] = field(default_factory=dict)
    away_ns: int = 0
    blind_ns: int = 600 * _NS_PER_S
    room_ns: int = 10 * _NS_PER_S


class ActivityChange(NamedTuple):
    """
    A cause has started or ended.

    :ivar kind: ``no_movement``, ``wandering`` or ``left_home``.
    :ivar active: it has started.
    :ivar stamp_ns: time of the change.
    :ivar since_ns: start of the duration that is too long.
    """

    kind: str
    active: bool
    stamp_ns: int
    since_ns: int


class Activity:
    """
    State of one person; safe in the real-time loop.

    Call :meth:`advance` with the time of a sample before handing it in.

    :ivar room: current room; empty when it is unknown, or none.
    :ivar moved_ns: time of the last movement, or of the start; -1 before.
    """

    __slots__ = ('room', 'moved_ns', '_limits', '_received_ns', '_seen_ns', '_at_exit', '_room_ns',
                 '_next_room', '_next_room_ns', '_placed_ns', '_moving', '_again_ns', '_active',
                 '_now_ns', '_home_ns')

    def __init__(self, limits: ActivityLimits) -> None:
        self.room = self._next_room = ''
        self.moved_ns = self._received_ns = self._home_ns = self._seen_ns = self._room_ns = -1
        self._next_room_ns = self._placed_ns = self._again_ns = -1
        self._limits = limits
        self._at_exit = False
        self._now_ns = 0
        self._moving: dict[str, int] = {}
        self._active: dict[str, int] = {}

    # ---- samples -----------------------------------------------------------------------------

    def on_home_packet(self, stamp_ns: int) -> None:
        """Note a sample of any sensor of the home: the network works."""
        self._home_ns = max(self._home_ns, stamp_ns)

    def on_sensor_packet(self, stamp_ns: int) -> None:
        """Note a sample of a sensor that can detect a movement of the person."""
        self.on_home_packet(stamp_ns)
        if self._received_ns < 0 or stamp_ns - self._received_ns > self._limits.blind_ns:
            self.moved_ns = stamp_ns  # the time before is unknown
        self._received_ns = max(self._received_ns, stamp_ns)

    def on_movement(self, stamp_ns: int) -> list[ActivityChange]:
        """Note a movement; return the causes that end."""
        self.on_sensor_packet(stamp_ns)
        self.moved_ns = max(self.moved_ns, stamp_ns)
        if NO_MOVEMENT not in self._active:
            return []
        first_ns, self._again_ns = self._again_ns, stamp_ns
        if first_ns < 0 or stamp_ns - first_ns > _AGAIN_WITHIN_NS:
            return []
        if stamp_ns - first_ns < AGAIN_NS:
            self._again_ns = first_ns
            return []
        return [self._end(NO_MOVEMENT, stamp_ns)]

    def on_lasting_movement(self, source: str, is_so: bool, stamp_ns: int) -> list[ActivityChange]:
        """Note the start or the end of a movement that lasts; return the causes that end."""
        if is_so:
            self._moving.setdefault(source, stamp_ns)
            return self.on_movement(stamp_ns)
        self._moving.pop(source, None)
        # The end of a movement does not count as a second one.
        self.on_sensor_packet(stamp_ns)
        self.moved_ns = max(self.moved_ns, stamp_ns)
        return []

    def on_sighting(self, room: str, at_exit: bool, stamp_ns: int) -> list[ActivityChange]:
        """Note a sighting of the person; return the causes that end."""
        self._seen_ns = self._placed_ns = stamp_ns
        self._at_exit = at_exit
        if room == self.room:
            self._next_room_ns = -1
        elif room != self._next_room or self._next_room_ns < 0:
            self._next_room, self._next_room_ns = room, stamp_ns
        if self._room_ns < 0:
            self.room, self._room_ns, self._next_room_ns = room, stamp_ns, -1
        if LEFT_HOME in self._active and not at_exit and room != OUTSIDE:
            return [self._end(LEFT_HOME, stamp_ns)]
        return []

    # ---- deadlines ---------------------------------------------------------------------------

    @property
    def due_ns(self) -> float:
        """Time of the next deadline; infinite without one."""
        return min(self._still_due(), self._stay_due(), self._away_due(), self._room_due(),
                   self._again_due())

    def advance(self, now_ns: int) -> list[ActivityChange]:
        """Process the deadlines until a time; return the changes, in order."""
        found: list[ActivityChange] = []
        while (due_ns := self.due_ns) <= now_ns:
            # Not before the last time processed: a sensor may have been silent meanwhile.
            at_ns = max(int(due_ns), self._now_ns)
            if self._room_due() == due_ns:
                found += self._enter(at_ns)
            elif self._again_due() == due_ns:
                found.append(self._end(NO_MOVEMENT, at_ns))
            elif self._still_due() == due_ns:
                found.append(self._begin(NO_MOVEMENT, at_ns, self.moved_ns))
                self._again_ns = -1
            elif self._stay_due() == due_ns:
                found.append(self._begin(self._stay_kind(), at_ns, self._room_ns))
            else:
                found.append(self._begin(LEFT_HOME, at_ns, self._seen_ns))
        self._now_ns = max(self._now_ns, now_ns)
        return found

    def _still_due(self) -> float:
        limit_ns = self._limits.still.get(self.room, self._limits.still_ns)
        if not limit_ns or self.moved_ns < 0 or self._moving or NO_MOVEMENT in self._active:
            return math.inf
        if self._at_exit and self._limits.away_ns:
            return math.inf  # probably away
        due_ns = self.moved_ns + limit_ns
        return due_ns if due_ns <= self._received_ns + self._limits.blind_ns else math.inf

    def _again_due(self) -> float:
        if NO_MOVEMENT not in self._active or not self._moving:
            return math.inf
        return min(self._moving.values()) + LASTS_NS

    def _stay_kind(self) -> str:
        return LEFT_HOME if self.room == OUTSIDE else WANDERING

    def _stay_due(self) -> float:
        limit_ns = self._limits.stay.get(self.room, 0)
        if not limit_ns or self._room_ns < 0 or self._stay_kind() in self._active:
            return math.inf
        due_ns = self._room_ns + limit_ns
        return due_ns if due_ns <= self._placed_ns + self._limits.blind_ns else math.inf

    def _away_due(self) -> float:
        limit_ns = self._limits.away_ns
        if not limit_ns or self._seen_ns < 0 or not self._at_exit or LEFT_HOME in self._active:
            return math.inf
        due_ns = self._seen_ns + limit_ns
        # The other sensors still send: the person is away, the network works.
        return due_ns if due_ns <= self._home_ns + self._limits.blind_ns else math.inf

    def _room_due(self) -> float:
        if self._next_room_ns < 0 or self._placed_ns < self._next_room_ns + self._limits.room_ns:
            return math.inf
        return self._next_room_ns + self._limits.room_ns

    def _enter(self, stamp_ns: int) -> list[ActivityChange]:
        """Change the room, as of the first sighting there."""
        kind = self._stay_kind()
        over = [self._end(kind, stamp_ns)] if kind in self._active and (
            self._limits.stay.get(self.room)) else []
        self.room, self._room_ns, self._next_room_ns = self._next_room, self._next_room_ns, -1
        return over

    def _begin(self, kind: str, stamp_ns: int, since_ns: int) -> ActivityChange:
        self._active[kind] = since_ns
        return ActivityChange(kind, True, stamp_ns, since_ns)

    def _end(self, kind: str, stamp_ns: int) -> ActivityChange:
        return ActivityChange(kind, False, stamp_ns, self._active.pop(kind))

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
What a multiplexer of velocities knows of each source, lock and switch; no topics, no kernel.

All times are nanoseconds of one clock. Everything here is safe in the real-time loop.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final

Triple = tuple[float, float, float]

STANDSTILL: Final[Triple] = (0.0, 0.0, 0.0)
GOOD: Final = 'good'
REFUSED: Final = 'refused'
LATE: Final = 'late'


class VelocitySource:
    """
    Somebody who steers.

    :ivar name: for people.
    :ivar priority: higher steers; of equal ones the first.
    :ivar timeout_ns: age at which a command no longer counts.
    :ivar hold_ns: age of its last command up to which it holds a robot that it had.
    :ivar held_until_ns: until when it holds the robot; 0 when it does not.
    :ivar needs_dead_man: whether it steers only while the dead-man switch is held.
    :ivar deadline_ns: when the last command is too old; 0 when there is none.
    :ivar commands: that were taken.
    :ivar refused: of these, the ones that are not numbers, or absurd.
    :ivar late: of these, the ones that were too old when they came.
    :ivar last: what became of the last one.
    """

    __slots__ = ('name', 'priority', 'timeout_ns', 'hold_ns', 'held_until_ns', 'needs_dead_man',
                 'deadline_ns', 'stamp_ns', 'linear', 'angular', 'commands', 'refused', 'late',
                 'last', 'is_new')

    def __init__(self, name: str, priority: int, timeout_ns: int, needs_dead_man: bool,
                 hold_ns: int = 0) -> None:
        self.name = name
        self.priority = priority
        self.timeout_ns = timeout_ns
        self.needs_dead_man = needs_dead_man
        self.hold_ns = max(hold_ns, timeout_ns)
        self.held_until_ns = 0
        self.deadline_ns = self.stamp_ns = 0
        self.linear = self.angular = STANDSTILL
        self.commands = self.refused = self.late = 0
        self.last = GOOD
        self.is_new = False

    def receive(self, linear: Triple, angular: Triple, stamp_ns: int, now_ns: int,
                linear_limit: float, angular_limit: float) -> None:
        """
        Take a command; one that nobody can mean is a standstill, and counted.

        Its age counts from its stamp; from now if that should be in the future.

        :param linear_limit: speed along an axis, in m/s, beyond which it is absurd.
        :param angular_limit: the same of a turning rate, in rad/s.
        """
        self.commands += 1
        stamp_ns = min(stamp_ns, now_ns)
        if stamp_ns + self.timeout_ns <= now_ns:
            self.late += 1
            self.last = LATE
            return
        self.last = GOOD
        if not (_within(linear, linear_limit) and _within(angular, angular_limit)):
            self.refused += 1
            self.last = REFUSED
            linear = angular = STANDSTILL
        self.linear, self.angular, self.stamp_ns = linear, angular, stamp_ns
        self.deadline_ns = stamp_ns + self.timeout_ns
        self.is_new = True

    def is_fresh(self, now_ns: int) -> bool:
        """Return whether its last command counts."""
        return now_ns < self.deadline_ns

    def hold(self) -> None:
        """Note that its last command steers: it holds the robot for a while after it."""
        self.held_until_ns = self.stamp_ns + self.hold_ns

    def forget(self) -> None:
        """Have no command any more, and hold nothing."""
        self.deadline_ns = self.held_until_ns = 0
        self.is_new = False


def _within(values: Triple, limit: float) -> bool:
    # A NaN compares false with everything.
    return all(-limit <= value <= limit for value in values)


class Switch:
    """
    A Bool that is sent again and again.

    :ivar value: as it came last.
    :ivar received_ns: when; -1 before the first.
    :ivar timeout_ns: silence after which the value is not to be relied on; 0: never.
    """

    __slots__ = ('value', 'received_ns', 'timeout_ns')

    def __init__(self, timeout_ns: int) -> None:
        self.value = False
        self.received_ns = -1
        self.timeout_ns = timeout_ns

    def update(self, value: bool, stamp_ns: int) -> None:
        """Take a value; its age counts from its stamp, which is not in the future."""
        self.value, self.received_ns = value, stamp_ns

    def is_silent(self, now_ns: int) -> bool:
        """Return whether it has a time-out and was not heard within it."""
        return self.timeout_ns > 0 and (
            self.received_ns < 0 or now_ns >= self.received_ns + self.timeout_ns)

    def is_held(self, now_ns: int) -> bool:
        """Return whether it is on, as a dead-man switch: silence is off."""
        return self.value and not self.is_silent(now_ns)

    def silent_at_ns(self) -> float:
        """Return when its time is out; infinite without one, or when it is out already."""
        if not self.timeout_ns or self.received_ns < 0:
            return math.inf
        return self.received_ns + self.timeout_ns


class Lock(Switch):
    """
    What keeps sources of lower priority from steering: while it is on, and while it is silent.

    :ivar priority: sources of at least this one are not locked.
    """

    __slots__ = ('name', 'priority')

    def __init__(self, name: str, priority: int, timeout_ns: int) -> None:
        super().__init__(timeout_ns)
        self.name = name
        self.priority = priority

    def is_locked(self, now_ns: int) -> bool:
        """Return whether it locks; with a time-out it does so until it is heard."""
        return self.value or self.is_silent(now_ns)


class Latch:
    """
    An e-stop: many things set it, one thing alone frees it, and not while any of them lasts.

    :ivar reason: what set it; empty when it is free.
    :ivar stops: how often it was set.
    :ivar refused: releases that came while a cause lasted.
    """

    __slots__ = ('reason', 'stops', 'refused', '_lasting')

    def __init__(self) -> None:
        self.reason = ''
        self.stops = self.refused = 0
        self._lasting: dict[str, str] = {}

    def set(self, cause: str, why: str) -> bool:  # noqa: A003
        """
        Stop, as long as the cause lasts and until it is released.

        :return: whether it was free before.
        """
        self._lasting[cause] = why
        if self.reason:
            return False
        self.reason = why
        self.stops += 1
        return True

    def end(self, cause: str) -> None:
        """Note that a cause is over; that frees nothing."""
        self._lasting.pop(cause, None)

    def release(self) -> str:
        """
        Free it.

        :return: empty when it is free now, else the cause that lasts.
        """
        lasting = next(iter(self._lasting.values()), '')
        if lasting:
            self.refused += 1
        else:
            self.reason = ''
        return lasting


def chosen(sources: Sequence[VelocitySource], locks: Sequence[Lock], held: bool, now_ns: int
           ) -> VelocitySource | None:
    """
    Return who steers: of the sources that are fresh and not locked the one of highest priority.

    It is nobody while a source of higher priority holds the robot: two sources, one of which sends
    more slowly than its time-out, must not drive it to and fro.

    :param sources: by priority, the highest first.
    :param held: whether the dead-man switch is held.
    """
    level = lock_level(locks, now_ns)
    for source in sources:
        if source.priority < level:
            return None
        if source.is_fresh(now_ns) and (held or not source.needs_dead_man):
            return source
        if now_ns < source.held_until_ns:
            return None
    return None


def holder(sources: Sequence[VelocitySource], now_ns: int) -> VelocitySource | None:
    """Return the source of highest priority that holds the robot, fresh or not."""
    return next((each for each in sources if now_ns < each.held_until_ns), None)


def lock_level(locks: Sequence[Lock], now_ns: int) -> int:
    """Return the priority below which nobody steers."""
    return max((lock.priority for lock in locks if lock.is_locked(now_ns)), default=-1)

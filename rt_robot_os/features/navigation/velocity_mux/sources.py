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
The state of each source, lock and switch of a velocity multiplexer; no topics, no kernel.

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
    A source of velocity commands.

    :ivar name: for operators.
    :ivar priority: the highest steers; of equal ones the first.
    :ivar timeout_ns: age at which a command no longer counts.
    :ivar hold_ns: age of its last command up to which it holds a robot that it steered.
    :ivar held_until_ns: until when it holds the robot; 0 when it does not.
    :ivar needs_dead_man: whether it steers only while the dead-man switch is held.
    :ivar deadline_ns: when the last command is too old; 0 when there is none.
    :ivar commands: received ones.
    :ivar refused: of these, those that are not numbers, or absurdly large.
    :ivar late: of these, those that were too old on arrival.
    :ivar last: result of the last one.
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
        Receive a command; an absurd one counts as a standstill.

        Its age counts from its stamp; from now if that is in the future.

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
        """Let it hold the robot for a while, as its last command steers."""
        self.held_until_ns = self.stamp_ns + self.hold_ns

    def forget(self) -> None:
        """Discard its command and its hold."""
        self.deadline_ns = self.held_until_ns = 0
        self.is_new = False


def _within(values: Triple, limit: float) -> bool:
    # A NaN compares false with everything.
    return all(-limit <= value <= limit for value in values)


class Switch:
    """
    A Bool that is sent repeatedly.

    :ivar value: the last one.
    :ivar received_ns: its time; -1 before the first.
    :ivar timeout_ns: time without a message after which the value is invalid; 0: never.
    """

    __slots__ = ('value', 'received_ns', 'timeout_ns')

    def __init__(self, timeout_ns: int) -> None:
        self.value = False
        self.received_ns = -1
        self.timeout_ns = timeout_ns

    def update(self, value: bool, stamp_ns: int) -> None:
        """Receive a value; its age counts from its stamp, which is not in the future."""
        self.value, self.received_ns = value, stamp_ns

    def is_silent(self, now_ns: int) -> bool:
        """Return whether it has timed out."""
        return self.timeout_ns > 0 and (
            self.received_ns < 0 or now_ns >= self.received_ns + self.timeout_ns)

    def is_held(self, now_ns: int) -> bool:
        """Return whether it is on, as a dead-man switch: after a time-out it is off."""
        return self.value and not self.is_silent(now_ns)

    def silent_at_ns(self) -> float:
        """Return when it times out; infinite without a time-out or a value."""
        if not self.timeout_ns or self.received_ns < 0:
            return math.inf
        return self.received_ns + self.timeout_ns


class Lock(Switch):
    """
    A lock, which blocks sources of lower priority while it is on, and after a time-out.

    :ivar priority: sources of at least this one are not locked.
    """

    __slots__ = ('name', 'priority')

    def __init__(self, name: str, priority: int, timeout_ns: int) -> None:
        super().__init__(timeout_ns)
        self.name = name
        self.priority = priority

    def is_locked(self, now_ns: int) -> bool:
        """Return whether it locks; with a time-out it does so until the first message."""
        return self.value or self.is_silent(now_ns)


class Latch:
    """
    A latched e-stop: several causes set it, only a release clears it, after all causes have ended.

    :ivar reason: what set it; empty when it is not set.
    :ivar stops: how often it was set.
    :ivar refused: releases while a cause was active.
    """

    __slots__ = ('reason', 'stops', 'refused', '_lasting')

    def __init__(self) -> None:
        self.reason = ''
        self.stops = self.refused = 0
        self._lasting: dict[str, str] = {}

    def set(self, cause: str, why: str) -> bool:  # noqa: A003
        """
        Set it until the cause has ended and it is released.

        :return: whether it was not set before.
        """
        self._lasting[cause] = why
        if self.reason:
            return False
        self.reason = why
        self.stops += 1
        return True

    def end(self, cause: str) -> None:
        """End a cause; the e-stop stays set."""
        self._lasting.pop(cause, None)

    def release(self) -> str:
        """
        Release it.

        :return: empty when it is released now, else a cause that is active.
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
    Return the source that steers: of the fresh and unlocked ones that of highest priority.

    It is None while a source of higher priority holds the robot: otherwise one that sends more
    slowly than its time-out would alternate with another one.

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
    """Return the priority below which sources are locked."""
    return max((lock.priority for lock in locks if lock.is_locked(now_ns)), default=-1)

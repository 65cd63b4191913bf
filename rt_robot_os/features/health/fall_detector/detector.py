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
Detection of falls from a worn accelerometer: a descent, an impact, another posture, stillness.

The detector is fed sample by sample. Each blow is kept for some seconds; as soon as the wearer has
come to rest after it, what is known of it is weighed (:class:`Evidence`): how much speed it took
away, how far the body has turned between before and after, how fast it went down. Nothing depends
on how the sensor is mounted: which way is up is learned from steps (:mod:`.upright`), and until
then only angles between two postures count. Nothing depends on its rate, for samples count in
blocks of a length of time.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.fall_detector.limits import FallLimits
from rt_robot_os.features.health.fall_detector.motion_history import angle_deg
from rt_robot_os.features.health.fall_detector.motion_history import MotionHistory
from rt_robot_os.features.health.fall_detector.motion_history import Span
from rt_robot_os.features.health.fall_detector.motion_history import Vector
from rt_robot_os.features.health.fall_detector.not_worn import NotWorn
from rt_robot_os.features.health.fall_detector.recovery import Recovery
from rt_robot_os.features.health.fall_detector.upright import UprightDirection

#: No accelerometer that is worn feels more, in g.
IMPLAUSIBLE_G: Final = 400.0

# What is less than that apart is one blow.
_ONE_BLOW_NS: Final = 300 * NS_PER_MS
_BLOWS_KEPT: Final = 64
_LOOKED_AT_EVERY_NS: Final = 100 * NS_PER_MS
# Of the time in which a posture is looked at so much must be there.
_COVERED: Final = 0.6
_LONG_LOOK: Final = 2
# When nothing more comes, a shorter look has to do.
_LAST_LOOK_NS: Final = 250 * NS_PER_MS
_LAST_SETTLE_NS: Final = 100 * NS_PER_MS
# A clock that steps back further than that was set: what was before is of another time.
_CLOCK_SET_NS: Final = NS_PER_S
_TURN_BEFORE_NS: Final = 1_500 * NS_PER_MS
# After such a silence it may be mounted otherwise.
_REMOUNTED_NS: Final = 30 * NS_PER_S
# At rest a sensor measures gravity; one that measures much more or less is saturated or broken.
# A person who leans by less and moves is on their feet; one who rises by more is getting up.
_LEANING_DEG: Final = 50.0
_RISING_DEG: Final = 20.0
_REST_G: Final = (0.7, 1.35)


class State(Enum):
    """What the detector is about; the values are what it publishes."""

    WATCHING = 'watching'
    #: There was a blow, and the posture after it is not known yet.
    IMPACT = 'impact'
    FALLEN = 'fallen'
    #: The sensor is stiller than any person: it is not worn, and falls are not detected.
    TAKEN_OFF = 'taken off'


class What(Enum):
    """What has happened."""

    FALL = 'fall'
    RECOVERED = 'recovered'


class Evidence(NamedTuple):
    """
    What is known of a blow.

    :ivar impact_ns: when it was.
    :ivar peak_g: how hard it was: the largest mean of a block.
    :ivar least_g: the least that was felt in the second before.
    :ivar stop_m_s: how much speed it took away: what was felt beyond the 1 g of rest, summed.
    :ivar descent_m_s: how fast it went down.
    :ivar turned_deg: the angle between the postures before and after.
    :ivar tilt_before_deg: the angle of the posture before to upright; NaN while that is unknown.
    :ivar tilt_deg: that of the posture after.
    :ivar turn_deg_s: the fastest turn around it; 0 without a gyroscope.
    :ivar score: all this weighed, from 0 to ``FallLimits.most_evidence``.
    :ivar confidence: the part that this is of the most that there can be, 0 to 1.
    """

    impact_ns: int
    peak_g: float
    least_g: float
    stop_m_s: float
    descent_m_s: float
    turned_deg: float
    tilt_before_deg: float
    tilt_deg: float
    turn_deg_s: float
    score: float
    confidence: float


class Happened(NamedTuple):
    """Something that has happened, known at ``stamp_ns``."""

    what: What
    stamp_ns: int
    evidence: Evidence


@dataclass
class _Blow:
    at_ns: int
    peak_g: float
    #: What was before it: computed when it is first looked at.
    known: bool = False
    before: Vector | None = None
    descent_m_s: float = 0.0
    least_g: float = 1.0
    turn_deg_s: float = 0.0


def _part(value: float, from_: float, full: float) -> float:
    return min(1.0, max(0.0, (value - from_) / (full - from_)))


class FallDetector:
    """
    Find falls in the samples of one worn sensor; safe in the real-time loop.

    :ivar state: what it is about.
    :ivar evidence: of the last blow that was weighed, a fall or not.
    :ivar samples: so many were taken.
    :ivar rejected: not finite, or more than any sensor can say.
    :ivar out_of_order: of a time that had been before.
    """

    def __init__(self, limits: FallLimits = FallLimits()) -> None:
        self._limits = limits
        self._block_ns = round(limits.block_s * NS_PER_S)
        self._settle_ns = round(limits.settle_s * NS_PER_S)
        self._after_ns = round(limits.after_s * NS_PER_S)
        self._decide_ns = round(limits.decide_within_s * NS_PER_S)
        kept_s = limits.before_from_s + limits.decide_within_s + 2.0
        self._blocks = round(kept_s / limits.block_s)
        self.samples = self.rejected = self.out_of_order = 0
        self._begin()

    def _begin(self) -> None:
        self.state = State.WATCHING
        self.evidence: Evidence | None = None
        self._history = MotionHistory(self._blocks)
        self._blows: deque[_Blow] = deque(maxlen=_BLOWS_KEPT)
        self._recovery: Recovery | None = None
        self._upright = UprightDirection()
        self._not_worn = NotWorn()
        self._count = 0
        self._x = self._y = self._z = self._turn = 0.0
        self._first_ns = 0
        self._last_ns = -1
        self._looked_ns = 0

    @property
    def moved_ns(self) -> int:
        """Return when somebody who has fallen moved last; that of the newest sample without."""
        return self._last_ns if self._recovery is None else self._recovery.moved_ns

    @property
    def last_ns(self) -> int:
        """Return the stamp of the newest sample; -1 without one."""
        return self._last_ns

    def add(self, stamp_ns: int, x: float, y: float, z: float, turn_deg_s: float = 0.0
            ) -> Happened | None:
        """
        Take a sample.

        :param x: specific force along an axis of the sensor, in g, as ``y`` and ``z``.
        :param turn_deg_s: size of the turning rate; 0 without a gyroscope.
        :return: what has happened, if something has.
        """
        if not abs(x) + abs(y) + abs(z) < IMPLAUSIBLE_G:  # nor for what is not a number
            self.rejected += 1
            return None
        if stamp_ns <= self._last_ns:
            if stamp_ns > self._last_ns - _CLOCK_SET_NS:
                self.out_of_order += 1
                return None
            self._begin()
        elif self._last_ns >= 0 and stamp_ns - self._last_ns > _REMOUNTED_NS:
            self._upright.forget()
        happened = None
        if self._count and stamp_ns - self._first_ns >= self._block_ns:
            happened = self._close_block()
        if not self._count:
            self._first_ns = stamp_ns
        self._count += 1
        self._x += x
        self._y += y
        self._z += z
        if turn_deg_s > self._turn:
            self._turn = turn_deg_s
        self._last_ns = stamp_ns
        self.samples += 1
        return happened

    def finish(self) -> Happened | None:
        """
        Decide with what there is: nothing more comes, or not for some time.

        A sensor that falls silent right after an impact may have broken in a fall. When more does
        come, it goes on as if nothing had been asked.
        """
        happened = self._close_block() if self._count else None
        if happened is not None:
            return happened
        if self.state is not State.IMPACT:
            return None
        best: Evidence | None = None
        lying: Vector | None = None
        for blow in self._blows:
            from_ns = max(blow.at_ns + _LAST_SETTLE_NS, self._last_ns - self._after_ns)
            if self._last_ns - from_ns >= _LAST_LOOK_NS:
                after = self._history.span(from_ns, self._last_ns)
                if after is not None:
                    lying = after.mean
                    best = self._better(best, self._weigh(blow, lying))
        return None if lying is None else self._judge(best, self._last_ns, lying)

    # ---- blocks ------------------------------------------------------------------------------

    def _close_block(self) -> Happened | None:
        count, now_ns = self._count, self._last_ns
        x, y, z = self._x / count, self._y / count, self._z / count
        size = self._history.add(now_ns, x, y, z, self._turn)
        self._count = 0
        self._x = self._y = self._z = self._turn = 0.0
        self._not_worn.add(now_ns, x, y, z)
        if self._recovery is not None:
            return self._fallen(now_ns, size)
        self._upright.add(self._history, now_ns, size)
        if self._not_worn.off is not (self.state is State.TAKEN_OFF):
            self._wear()
        if size >= self._limits.impact_from_g:
            self._blow(now_ns, size)
        if self.state is State.IMPACT and now_ns - self._looked_ns >= _LOOKED_AT_EVERY_NS:
            self._looked_ns = now_ns
            return self._look(now_ns)
        return None

    def _wear(self) -> None:
        """Enter or leave the state in which the sensor is not worn."""
        if self._not_worn.off:
            self.state = State.TAKEN_OFF
            self._upright.forget()
            self._blows.clear()
        else:
            self.state = State.WATCHING

    def _blow(self, now_ns: int, size: float) -> None:
        self.state = State.IMPACT
        last = self._blows[-1] if self._blows else None
        if last is None or now_ns - last.at_ns >= _ONE_BLOW_NS:
            self._blows.append(_Blow(now_ns, size))
        elif size > last.peak_g:
            last.at_ns, last.peak_g, last.known = now_ns, size, False

    def _look(self, now_ns: int) -> Happened | None:
        """Weigh the blows, if their wearer has come to rest."""
        blows = self._blows
        while blows and now_ns - blows[0].at_ns > self._decide_ns:
            blows.popleft()
        if not blows:
            self.state = State.WATCHING
            return None
        settled_ns = now_ns - self._after_ns - self._settle_ns
        if blows[0].at_ns > settled_ns:
            return None
        after = self._rest(now_ns, 1)
        if after is None:
            # Who is hurt may move: a longer look, at less than half the restlessness of a walk.
            after = self._rest(now_ns, _LONG_LOOK)
            settled_ns = now_ns - _LONG_LOOK * self._after_ns - self._settle_ns
        if after is None:
            return None
        best: Evidence | None = None
        for blow in blows:
            if blow.at_ns <= settled_ns:
                best = self._better(best, self._weigh(blow, after))
        return self._judge(best, now_ns, after)

    def _rest(self, now_ns: int, times: int) -> Vector | None:
        """Return the mean of a time up to now in which there was rest; None if there was none."""
        limits = self._limits
        after = self._history.span(now_ns - times * self._after_ns, now_ns)
        if (after is None or after.lasts_s < _COVERED * times * limits.after_s
                or after.spread_g > times * limits.restless_g
                or after.turning_deg > times * limits.turning_deg
                or not _REST_G[0] <= math.hypot(*after.mean) <= _REST_G[1]
                or self._is_up(now_ns, after)):
            return None
        return after.mean

    def _is_up(self, now_ns: int, after: Span) -> bool:
        """Return whether the wearer leans and moves, or is rising; false while up is unknown."""
        tilt = self._upright.tilt_deg(after.mean)
        if tilt < _LEANING_DEG and after.spread_g > self._limits.restless_g / 2:
            return True
        newest = self._history.span(now_ns - self._after_ns // 2, now_ns)
        return newest is not None and tilt - self._upright.tilt_deg(newest.mean) > _RISING_DEG

    @staticmethod
    def _better(one: Evidence | None, two: Evidence | None) -> Evidence | None:
        if one is None or two is None:
            return one or two
        return two if (two.score, two.peak_g) >= (one.score, one.peak_g) else one

    def _weigh(self, blow: _Blow, after: Vector) -> Evidence | None:
        if not blow.known:
            self._learn(blow)
        if blow.before is None:
            return None
        limits = self._limits
        turned = angle_deg(blow.before, after)
        stop_m_s = self._history.stop_m_s(blow.at_ns, math.hypot(*after))
        tilt_before = self._upright.tilt_deg(blow.before)
        tilt = self._upright.tilt_deg(after)
        score = 0.0
        if turned >= limits.posture_least_deg and self._has_gone_down(
                tilt_before, tilt, stop_m_s):
            score = (_part(stop_m_s, limits.stop_from_m_s, limits.stop_full_m_s)
                     + _part(turned, limits.posture_from_deg, limits.posture_full_deg)
                     + limits.descent_weight * _part(
                         blow.descent_m_s, limits.descent_from_m_s, limits.descent_full_m_s))
        return Evidence(blow.at_ns, blow.peak_g, blow.least_g, stop_m_s, blow.descent_m_s, turned,
                        tilt_before, tilt, blow.turn_deg_s, score, score / limits.most_evidence)

    def _has_gone_down(self, tilt_before: float, tilt: float, stop_m_s: float) -> bool:
        """
        Return whether a turn of the body may be one to the floor; true while up is unknown.

        From lying, as out of a bed, a turn is no sign of a fall: the impact must count in full.
        """
        if math.isnan(tilt):
            return True
        limits = self._limits
        if tilt < limits.upright_deg or tilt_before - tilt > limits.posture_from_deg:
            return False
        return tilt_before < limits.posture_full_deg or stop_m_s >= limits.stop_full_m_s

    def _learn(self, blow: _Blow) -> None:
        """Find out what was before a blow."""
        limits, history, at_ns = self._limits, self._history, blow.at_ns
        until_ns = at_ns - round(limits.before_until_s * NS_PER_S)
        before = history.span(at_ns - round(limits.before_from_s * NS_PER_S), until_ns)
        if before is None:  # it has hardly begun: what there is
            before = history.span(0, at_ns - _ONE_BLOW_NS)
        blow.before = before.mean if before else None
        blow.descent_m_s, blow.least_g = history.descent(at_ns)
        blow.turn_deg_s = history.fastest_deg_s(at_ns - _TURN_BEFORE_NS)
        blow.known = True

    def _judge(self, best: Evidence | None, now_ns: int, after: Vector) -> Happened | None:
        if best is None:
            return None
        self.evidence = best
        if best.score < self._limits.evidence:
            return None
        blow = next(each for each in self._blows if each.at_ns == best.impact_ns)
        assert blow.before is not None
        self.state = State.FALLEN
        self._recovery = Recovery(self._limits, blow.before, after, now_ns)
        self._blows.clear()
        return Happened(What.FALL, now_ns, best)

    def _fallen(self, now_ns: int, size: float) -> Happened | None:
        recovery, evidence = self._recovery, self.evidence
        if recovery is None or evidence is None or not recovery.add(
                self._history, now_ns, size):
            return None
        self._recovery = None
        self.state = State.WATCHING
        return Happened(What.RECOVERED, now_ns, evidence)

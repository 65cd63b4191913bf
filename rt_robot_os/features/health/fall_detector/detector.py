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
Fall detection from a worn accelerometer: descent, impact, change of posture, stillness.

The detector is fed sample by sample. Each impact is stored for some seconds. When the wearer has
come to rest after it, its features are scored (:class:`Evidence`): the change of speed, the angle
between the postures before and after, the speed of the descent. The result does not depend on
the mounting of the sensor: the upright direction is learned from steps (:mod:`.upright`), and
until then only angles between two postures count. It does not depend on the sampling rate either,
because samples are averaged in blocks of fixed duration.
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
from rt_robot_os.features.health.fall_detector.recovery import Recovery
from rt_robot_os.features.health.fall_detector.upright import UprightDirection
from rt_robot_os.features.health.fall_detector.wear_detection import WearDetector

#: A worn accelerometer never measures more, in g.
IMPLAUSIBLE_G: Final = 400.0

# Peaks that are less apart are one impact.
_ONE_IMPACT_NS: Final = 300 * NS_PER_MS
_IMPACTS_MAXIMUM: Final = 64
_EVALUATE_EVERY_NS: Final = 100 * NS_PER_MS
# Least share of an interval that samples must cover for its mean to be a posture.
_COVERED: Final = 0.6
_LONG_REST_FACTOR: Final = 2
# When no more samples arrive a shorter interval suffices.
_LAST_REST_NS: Final = 250 * NS_PER_MS
_LAST_SETTLE_NS: Final = 100 * NS_PER_MS
# A larger step back means that the clock was set: the detector restarts.
_CLOCK_SET_NS: Final = NS_PER_S
_TURN_BEFORE_NS: Final = 1_500 * NS_PER_MS
# After a longer gap the sensor may be mounted differently.
_REMOUNTED_NS: Final = 30 * NS_PER_S
# A person who leans by less and moves is standing.
_LEANING_DEG: Final = 50.0
# A person whose tilt decreases by more is getting up.
_RISING_DEG: Final = 20.0
# At rest a sensor measures gravity; one that measures much more or less is saturated or broken.
_REST_G: Final = (0.7, 1.35)


class DetectorState(Enum):
    """State of the detector; the values are published."""

    WATCHING = 'watching'
    #: There was an impact, and the posture after it is not known yet.
    IMPACT = 'impact'
    FALLEN = 'fallen'
    #: The sensor is stiller than on any person: it is not worn, and falls are not detected.
    TAKEN_OFF = 'taken off'


class FallEventKind(Enum):
    """Kind of a :class:`FallEvent`."""

    FALL = 'fall'
    RECOVERED = 'recovered'


class Evidence(NamedTuple):
    """
    Features of an impact.

    :ivar impact_ns: its time.
    :ivar peak_g: its peak: the largest mean of a block.
    :ivar least_g: the least specific force in the second before.
    :ivar stop_m_s: the speed that it absorbed: the integral of the force beyond the 1 g of rest.
    :ivar descent_m_s: speed of the descent before.
    :ivar turned_deg: angle between the postures before and after.
    :ivar tilt_before_deg: angle of the posture before to upright; NaN while that is unknown.
    :ivar tilt_deg: angle of the posture after to upright.
    :ivar turn_deg_s: largest angular rate around the impact; 0 without a gyroscope.
    :ivar score: weighted sum of the features, from 0 to ``FallLimits.most_evidence``.
    :ivar confidence: the score as a share of its maximum, 0 to 1.
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


class FallEvent(NamedTuple):
    """A fall or a recovery, detected at ``stamp_ns``."""

    kind: FallEventKind
    stamp_ns: int
    evidence: Evidence


@dataclass
class _Impact:
    at_ns: int
    peak_g: float
    #: Whether the following are computed, which happens at the first evaluation.
    is_measured: bool = False
    before: Vector | None = None
    descent_m_s: float = 0.0
    least_g: float = 1.0
    turn_deg_s: float = 0.0


def _ramp(value: float, from_: float, full: float) -> float:
    return min(1.0, max(0.0, (value - from_) / (full - from_)))


class FallDetector:
    """
    Detect falls in the samples of one worn sensor; safe in the real-time loop.

    :ivar state: its state.
    :ivar evidence: of the last impact that was scored, a fall or not.
    :ivar samples: number of processed samples.
    :ivar rejected: samples that are not finite, or implausibly large.
    :ivar out_of_order: samples that are older than the newest one.
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
        self.state = DetectorState.WATCHING
        self.evidence: Evidence | None = None
        self._history = MotionHistory(self._blocks)
        self._impacts: deque[_Impact] = deque(maxlen=_IMPACTS_MAXIMUM)
        self._recovery: Recovery | None = None
        self._upright = UprightDirection()
        self._not_worn = WearDetector()
        self._count = 0
        self._x = self._y = self._z = self._turn = 0.0
        self._first_ns = 0
        self._last_ns = -1
        self._evaluated_ns = 0

    @property
    def moved_ns(self) -> int:
        """Return when a fallen person moved last; without a fall the newest stamp."""
        return self._last_ns if self._recovery is None else self._recovery.moved_ns

    @property
    def last_ns(self) -> int:
        """Return the stamp of the newest sample; -1 without one."""
        return self._last_ns

    def add(self, stamp_ns: int, x: float, y: float, z: float, turn_deg_s: float = 0.0
            ) -> FallEvent | None:
        """
        Add a sample.

        :param x: specific force along an axis of the sensor, in g, as ``y`` and ``z``.
        :param turn_deg_s: magnitude of the angular rate; 0 without a gyroscope.
        :return: the event that it completes, if any.
        """
        if not abs(x) + abs(y) + abs(z) < IMPLAUSIBLE_G:  # also rejects NaN
            self.rejected += 1
            return None
        if stamp_ns <= self._last_ns:
            if stamp_ns > self._last_ns - _CLOCK_SET_NS:
                self.out_of_order += 1
                return None
            self._begin()
        elif self._last_ns >= 0 and stamp_ns - self._last_ns > _REMOUNTED_NS:
            self._upright.forget()
        event = None
        if self._count and stamp_ns - self._first_ns >= self._block_ns:
            event = self._close_block()
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
        return event

    def finish(self) -> FallEvent | None:
        """
        Decide with the samples so far, at the end of a recording or after a timeout.

        A sensor without samples right after an impact may have broken in a fall. Later samples are
        processed as usual.
        """
        event = self._close_block() if self._count else None
        if event is not None:
            return event
        if self.state is not DetectorState.IMPACT:
            return None
        best: Evidence | None = None
        rest: Vector | None = None
        for impact in self._impacts:
            from_ns = max(impact.at_ns + _LAST_SETTLE_NS, self._last_ns - self._after_ns)
            if self._last_ns - from_ns >= _LAST_REST_NS:
                after = self._history.span(from_ns, self._last_ns)
                if after is not None:
                    rest = after.mean
                    best = self._better(best, self._score(impact, rest))
        return None if rest is None else self._decide(best, self._last_ns, rest)

    # ---- blocks ------------------------------------------------------------------------------

    def _close_block(self) -> FallEvent | None:
        count, now_ns = self._count, self._last_ns
        x, y, z = self._x / count, self._y / count, self._z / count
        size = self._history.add(now_ns, x, y, z, self._turn)
        self._count = 0
        self._x = self._y = self._z = self._turn = 0.0
        self._not_worn.add(now_ns, x, y, z)
        if self._recovery is not None:
            return self._check_recovery(now_ns, size)
        self._upright.add(self._history, now_ns, size)
        if self._not_worn.off is not (self.state is DetectorState.TAKEN_OFF):
            self._update_worn()
        if size >= self._limits.impact_from_g:
            self._add_impact(now_ns, size)
        if self.state is DetectorState.IMPACT and (
                now_ns - self._evaluated_ns >= _EVALUATE_EVERY_NS):
            self._evaluated_ns = now_ns
            return self._evaluate_impacts(now_ns)
        return None

    def _update_worn(self) -> None:
        """Enter or leave the state in which the sensor is not worn."""
        if self._not_worn.off:
            self.state = DetectorState.TAKEN_OFF
            self._upright.forget()
            self._impacts.clear()
        else:
            self.state = DetectorState.WATCHING

    def _add_impact(self, now_ns: int, size: float) -> None:
        self.state = DetectorState.IMPACT
        last = self._impacts[-1] if self._impacts else None
        if last is None or now_ns - last.at_ns >= _ONE_IMPACT_NS:
            self._impacts.append(_Impact(now_ns, size))
        elif size > last.peak_g:
            last.at_ns, last.peak_g, last.is_measured = now_ns, size, False

    def _evaluate_impacts(self, now_ns: int) -> FallEvent | None:
        """Score the impacts, if the wearer has come to rest."""
        impacts = self._impacts
        while impacts and now_ns - impacts[0].at_ns > self._decide_ns:
            impacts.popleft()
        if not impacts:
            self.state = DetectorState.WATCHING
            return None
        settled_ns = now_ns - self._after_ns - self._settle_ns
        if impacts[0].at_ns > settled_ns:
            return None
        after = self._rest(now_ns, 1)
        if after is None:
            # An injured person may move: a longer interval, less than half the motion of a walk.
            after = self._rest(now_ns, _LONG_REST_FACTOR)
            settled_ns = now_ns - _LONG_REST_FACTOR * self._after_ns - self._settle_ns
        if after is None:
            return None
        best: Evidence | None = None
        for impact in impacts:
            if impact.at_ns <= settled_ns:
                best = self._better(best, self._score(impact, after))
        return self._decide(best, now_ns, after)

    def _rest(self, now_ns: int, times: int) -> Vector | None:
        """Return the mean force of an interval of rest that ends now; None without rest."""
        limits = self._limits
        after = self._history.span(now_ns - times * self._after_ns, now_ns)
        if (after is None or after.lasts_s < _COVERED * times * limits.after_s
                or after.spread_g > times * limits.restless_g
                or after.turning_deg > times * limits.turning_deg
                or not _REST_G[0] <= math.hypot(*after.mean) <= _REST_G[1]
                or self._is_getting_up(now_ns, after)):
            return None
        return after.mean

    def _is_getting_up(self, now_ns: int, after: Span) -> bool:
        """Return whether the wearer stands or gets up; false while upright is unknown."""
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

    def _score(self, impact: _Impact, after: Vector) -> Evidence | None:
        if not impact.is_measured:
            self._measure_before(impact)
        if impact.before is None:
            return None
        limits = self._limits
        turned = angle_deg(impact.before, after)
        stop_m_s = self._history.stop_m_s(impact.at_ns, math.hypot(*after))
        tilt_before = self._upright.tilt_deg(impact.before)
        tilt = self._upright.tilt_deg(after)
        score = 0.0
        if turned >= limits.posture_least_deg and self._has_gone_down(
                tilt_before, tilt, stop_m_s):
            score = (_ramp(stop_m_s, limits.stop_from_m_s, limits.stop_full_m_s)
                     + _ramp(turned, limits.posture_from_deg, limits.posture_full_deg)
                     + limits.descent_weight * _ramp(
                         impact.descent_m_s, limits.descent_from_m_s, limits.descent_full_m_s))
        return Evidence(
            impact.at_ns, impact.peak_g, impact.least_g, stop_m_s, impact.descent_m_s, turned,
            tilt_before, tilt, impact.turn_deg_s, score, score / limits.most_evidence)

    def _has_gone_down(self, tilt_before: float, tilt: float, stop_m_s: float) -> bool:
        """
        Return whether the wearer may have gone down to the floor; true while upright is unknown.

        After lying, as in a bed, a turn is not a sign of a fall: the impact must count fully.
        """
        if math.isnan(tilt):
            return True
        limits = self._limits
        if tilt < limits.upright_deg or tilt_before - tilt > limits.posture_from_deg:
            return False
        return tilt_before < limits.posture_full_deg or stop_m_s >= limits.stop_full_m_s

    def _measure_before(self, impact: _Impact) -> None:
        """Measure the time before an impact."""
        limits, history, at_ns = self._limits, self._history, impact.at_ns
        until_ns = at_ns - round(limits.before_until_s * NS_PER_S)
        before = history.span(at_ns - round(limits.before_from_s * NS_PER_S), until_ns)
        if before is None:  # after a start all that there is
            before = history.span(0, at_ns - _ONE_IMPACT_NS)
        impact.before = before.mean if before else None
        impact.descent_m_s, impact.least_g = history.descent(at_ns)
        impact.turn_deg_s = history.fastest_deg_s(at_ns - _TURN_BEFORE_NS)
        impact.is_measured = True

    def _decide(self, best: Evidence | None, now_ns: int, after: Vector) -> FallEvent | None:
        if best is None:
            return None
        self.evidence = best
        if best.score < self._limits.evidence:
            return None
        before = next((each.before for each in self._impacts if each.at_ns == best.impact_ns),
                      None)
        if before is None:
            raise RuntimeError(f'the impact at {best.impact_ns} ns has a score, but no posture '
                               'before it')
        self.state = DetectorState.FALLEN
        self._recovery = Recovery(self._limits, before, after, now_ns)
        self._impacts.clear()
        return FallEvent(FallEventKind.FALL, now_ns, best)

    def _check_recovery(self, now_ns: int, size: float) -> FallEvent | None:
        recovery, evidence = self._recovery, self.evidence
        if recovery is None or evidence is None or not recovery.add(
                self._history, now_ns, size):
            return None
        self._recovery = None
        self.state = DetectorState.WATCHING
        return FallEvent(FallEventKind.RECOVERED, now_ns, evidence)

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

"""Evaluation of fall detection on recordings: decisions, rates and their confidence."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from itertools import product
import math
import re
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.features.health.cli.fall_recordings import FallRecording
from rt_robot_os.features.health.fall_detector.detector import FallDetector
from rt_robot_os.features.health.fall_detector.detector import FallEvent
from rt_robot_os.features.health.fall_detector.detector import FallEventKind
from rt_robot_os.features.health.fall_detector.limits import FallLimits

#: A detection later than this after the impact does not count.
WITHIN_S: Final = 5.0
#: Movements that are lying down on purpose, by name, and those of SisFall.
LYING: Final = r'lying|lie_?down|^D1[234](?!\d)'
#: Limits among which a cross-validation chooses: coarse, so that no single recording decides.
GRID: Final[Mapping[str, tuple[float, ...]]] = {
    'evidence': (1.2, 1.4, 1.6, 1.8), 'posture_least_deg': (40.0, 50.0),
    'stop_full_m_s': (1.25, 1.5, 1.75)}
_Z_95: Final = 1.959964
_LONGEST_STEP_S: Final = 1.0


class Decision(NamedTuple):
    """
    The result for one recording; without a detection the fields about it are None.

    :ivar fall: whether it is one; None when the file does not say.
    :ivar detected: whether a fall was detected in time.
    :ivar lying: the movement is lying down on purpose.
    :ivar impact_ms: time of the impact according to the detector.
    :ivar detected_ms: time of the detection, in the time of the recording.
    :ivar after_impact_s: time from the impact to the detection.
    :ivar after_peak_s: time from the largest peak of the recording to the detection.
    :ivar falls: number of detected falls, late ones included.
    :ivar worn_s: length of the recording without gaps of more than a second.
    """

    name: str
    movement: str
    subject: str
    fall: bool | None
    lying: bool
    detected: bool
    recovered: bool
    impact_ms: float | None
    detected_ms: float | None
    after_impact_s: float | None
    after_peak_s: float | None
    peak_g: float | None
    turned_deg: float | None
    confidence: float | None
    falls: int
    worn_s: float
    problem: str

    @property
    def right(self) -> bool | None:
        """Return whether the decision agrees with the file; None when the file has no label."""
        return None if self.fall is None or self.problem else self.fall == self.detected


def events_of(recording: FallRecording, limits: FallLimits) -> list[FallEvent]:
    """Feed a recording to the detector; return its events."""
    detector = FallDetector(limits)
    add = detector.add
    found = [one for time_ms, x, y, z, turn in recording.samples
             if (one := add(round(time_ms * NS_PER_MS), x, y, z, turn)) is not None]
    last = detector.finish()
    return found if last is None else [*found, last]


def decide(recording: FallRecording, limits: FallLimits, lying: str = LYING) -> Decision:
    """Decide on one recording."""
    found = [] if recording.problem else events_of(recording, limits)
    falls = [one for one in found if one.kind is FallEventKind.FALL and
             one.stamp_ns - one.evidence.impact_ns <= WITHIN_S * 1000 * NS_PER_MS]
    first = falls[0] if falls else None
    impact_ms = first.evidence.impact_ns / NS_PER_MS if first else None
    return Decision(
        recording.name, recording.movement, recording.subject, recording.fall,
        not recording.fall and bool(re.search(lying, recording.movement, re.IGNORECASE)),
        first is not None, any(one.kind is FallEventKind.RECOVERED for one in found), impact_ms,
        first.stamp_ns / NS_PER_MS if first else None,
        (first.stamp_ns - first.evidence.impact_ns) / NS_PER_MS / 1000 if first else None,
        (first.stamp_ns / NS_PER_MS - recording.peak_ms) / 1000 if first else None,
        first.evidence.peak_g if first else None, first.evidence.turned_deg if first else None,
        first.evidence.confidence if first else None,
        sum(one.kind is FallEventKind.FALL for one in found), worn_s(recording), recording.problem)


def worn_s(recording: FallRecording) -> float:
    """Return the length of a recording without gaps of more than a second."""
    times = [row[0] for row in recording.samples]
    return sum(step for one, two in zip(times, times[1:])
               if 0.0 < (step := (two - one) / 1000) <= _LONGEST_STEP_S)


def interval(right: int, count: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of a share."""
    if not count:
        return 0.0, 1.0
    share, square = right / count, _Z_95 * _Z_95
    middle = (share + square / (2 * count)) / (1 + square / count)
    half = _Z_95 / (1 + square / count) * math.sqrt(
        share * (1 - share) / count + square / (4 * count * count))
    return max(0.0, middle - half), min(1.0, middle + half)


def rate_interval(count: int, hours: float) -> tuple[float, float]:
    """Return the exact 95 % interval of a rate per hour with a Poisson distributed count."""
    def at_most(most: int, mean: float) -> float:
        return sum(math.exp(number * math.log(mean) - mean - math.lgamma(number + 1))
                   for number in range(most + 1))

    def mean_where(most: int, probability: float) -> float:
        low, high = 1e-9, most + 10.0 * math.sqrt(most + 1.0) + 10.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if at_most(most, middle) > probability else (low, middle)
        return low
    least = mean_where(count - 1, 0.975) if count else 0.0
    return least / hours, mean_where(count, 0.025) / hours


def _false_alarms(decisions: Sequence[Decision]) -> dict[str, Any]:
    """Count every detection in recordings without a fall, lying down on purpose included."""
    alarms = sum(one.falls for one in decisions)
    hours = sum(one.worn_s for one in decisions) / 3600
    return {'alarms': alarms, 'hours': hours, 'per_hour': alarms / hours if hours else None,
            'interval_95': list(rate_interval(alarms, hours)) if hours else None}


def _share(right: int, count: int) -> dict[str, Any]:
    low, high = interval(right, count)
    return {'share': right / count if count else None, 'right': right, 'of': count,
            'interval_95': [low, high]}


def summary(decisions: Iterable[Decision]) -> dict[str, Any]:
    """Return rates and counts; lying down on purpose counts in neither rate, but separately."""
    labelled = [one for one in decisions if one.right is not None]
    falls = [one for one in labelled if one.fall]
    daily = [one for one in labelled if not one.fall and not one.lying]
    lying = [one for one in labelled if one.lying]
    found, quiet = sum(one.detected for one in falls), sum(not one.detected for one in daily)
    return {
        'sensitivity': _share(found, len(falls)), 'specificity': _share(quiet, len(daily)),
        'confusion': {'falls_found': found, 'falls_missed': len(falls) - found,
                      'daily_quiet': quiet, 'daily_alarms': len(daily) - quiet},
        'false_alarms': _false_alarms([one for one in labelled if not one.fall]),
        'lying_down_on_purpose': {'recordings': len(lying),
                                  'alarms': sum(one.detected for one in lying)},
        'after_impact_s': _delays(falls), 'movements': _by_movement(labelled)}


def _delays(falls: Iterable[Decision]) -> dict[str, float | None]:
    delays = sorted(one.after_impact_s for one in falls if one.after_impact_s is not None)
    return {'median': delays[len(delays) // 2] if delays else None,
            'worst': delays[-1] if delays else None}


def _by_movement(decisions: Iterable[Decision]) -> dict[str, dict[str, Any]]:
    movements: dict[str, list[Decision]] = {}
    for one in decisions:
        movements.setdefault(one.movement or '?', []).append(one)
    return {name: {'recordings': len(ones), 'detected': sum(one.detected for one in ones),
                   'fall': ones[0].fall} for name, ones in sorted(movements.items())}


def cross_validated(
    recordings: Sequence[FallRecording], limits: FallLimits, lying: str = LYING,
) -> tuple[list[Decision], dict[str, dict[str, float]]]:
    """
    Decide on each subject with limits that were chosen on all the other subjects.

    One-standard-error rule: of the rows of :data:`GRID` whose result on the others is within one
    standard error of the best, the row nearest the given limits is chosen. So no single recording
    moves a limit.

    :return: the decisions, and the limits chosen for each subject.
    """
    rows = [dict(zip(GRID, values, strict=True)) for values in product(*GRID.values())]
    rows.sort(key=lambda row: sum(abs(math.log(value / getattr(limits, name)))
                                  for name, value in row.items()))
    decided = [[decide(one, limits._replace(**row), lying) for one in recordings] for row in rows]
    result: list[Decision] = []
    chosen: dict[str, dict[str, float]] = {}
    for subject in sorted({one.subject for one in recordings}):
        worths = [_worth(one for one in row if one.subject != subject) for row in decided]
        best, error = max(worths)
        index = next(index for index, (worth, _) in enumerate(worths) if worth >= best - error)
        chosen[subject] = rows[index]
        result += [one for one in decided[index] if one.subject == subject]
    return result, chosen


def _worth(decisions: Iterable[Decision]) -> tuple[float, float]:
    """Return the mean of sensitivity and specificity, and its standard error."""
    shares, found = [], summary(decisions)
    for each in ('sensitivity', 'specificity'):
        right, count = found[each]['right'], found[each]['of']
        if count:
            share = (right + 1) / (count + 2)  # also a share of 0 or 1 has an error
            shares.append((right / count, share * (1 - share) / count))
    if not shares:
        return 0.0, 0.0
    return (sum(worth for worth, _ in shares) / len(shares),
            math.sqrt(sum(variance for _, variance in shares)) / len(shares))

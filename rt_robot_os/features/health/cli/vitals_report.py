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

"""Report on a recording: how long each sign was known, alarms, and which were false."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
import math
from statistics import median
from typing import Any
from typing import Final

from rt_robot_os.features.health.assessment.limits import Limit
from rt_robot_os.features.health.assessment.limits import TrendLimit
from rt_robot_os.features.health.assessment.news2 import score
from rt_robot_os.features.health.assessment.news2_watch import LEVELS_OF_RISK
from rt_robot_os.features.health.cli.vitals_file import VitalsRecording
from rt_robot_os.features.health.cli.vitals_run import PlaybackResult
from rt_robot_os.features.health.vital_signs.sign_watch import QUALITIES
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.signs import SIGNS

_DAY_S: Final = 86_400.0
# Least time before an alarm over which the recording is evaluated to confirm it.
_WINDOW_S: Final = 120.0
_NS_PER_S: Final = 1_000_000_000


@dataclass
class RecordedAlarm:
    """
    A cause, from its start to its end.

    :ivar end_s: infinite for one that lasts until the end of the recording.
    :ivar is_false: the values of the recording do not confirm it.
    """

    kind: str
    subject: str
    level: Level
    start_s: float
    end_s: float
    text: str
    is_false: bool = False


@dataclass(frozen=True)
class EvaluationOptions:
    """
    Options of the evaluation.

    :ivar limits: of the command line.
    :ivar spo2_scale: of the score.
    :ivar oxygen: constant flow in l/min; None: as recorded.
    :ivar is_well: the person was healthy: every clinical alarm is false.
    """

    limits: Sequence[Limit | TrendLimit]
    spo2_scale: int
    oxygen: float | None
    is_well: bool


def alarms_of(causes: Iterable[tuple[float, Cause]]) -> list[RecordedAlarm]:
    """Combine reports of causes to alarms; an alarm has the highest of its levels."""
    found: list[RecordedAlarm] = []
    open_ones: dict[tuple[str, str], RecordedAlarm] = {}
    for time_s, cause in causes:
        key = cause.kind, cause.subject
        alarm = open_ones.get(key)
        if not cause.active:
            if alarm is not None:
                open_ones.pop(key).end_s = time_s
        elif alarm is None:
            open_ones[key] = alarm = RecordedAlarm(
                cause.kind, cause.subject, cause.level, time_s, math.inf, cause.text)
            found.append(alarm)
        elif cause.level > alarm.level:
            alarm.level, alarm.text = cause.level, cause.text
    return found


def report(name: str, recording: VitalsRecording, course: PlaybackResult,
           options: EvaluationOptions) -> dict[str, Any]:
    """Return the result of a recording as a JSON object."""
    alarms = alarms_of(course.causes)
    clinical = [each for each in alarms if each.level > Level.TECHNICAL]
    technical = [each for each in alarms if each.level == Level.TECHNICAL]
    for each in clinical:
        each.is_false = options.is_well or not _is_confirmed(each, recording, options)
    days = recording.length_s / _DAY_S
    false = sum(each.is_false for each in clinical)
    return {
        'file': name, 'length_s': round(recording.length_s, 3), 'person_days': days,
        'rows': recording.rows, 'period_s': recording.period_s,
        'ignored_columns': list(recording.ignored),
        'sensors': [{'column': each.name, 'sign': each.sign, **counters}
                    for each, counters in zip(recording.columns, course.sensors)],
        'signs': {sign: _durations(steps, recording.length_s)
                  for sign, steps in course.signs.items()},
        'clinical_alarms': [_alarm(each, recording.length_s) for each in clinical],
        'technical_alarms': [_alarm(each, recording.length_s) for each in technical],
        'clinical_alarms_per_person_day': len(clinical) / days,
        'false_alarms': false, 'false_alarms_per_person_day': false / days,
        'technical_alarms_per_person_day': len(technical) / days,
        'news2': _news2(course.news2, recording.length_s)}


def _alarm(alarm: RecordedAlarm, length_s: float) -> dict[str, Any]:
    ended = alarm.end_s <= length_s
    found = {'kind': alarm.kind, 'subject': alarm.subject, 'level': alarm.level.name.lower(),
             'start_s': round(alarm.start_s, 3), 'end_s': round(alarm.end_s, 3) if ended else None,
             'text': alarm.text}
    return found if alarm.level == Level.TECHNICAL else {**found, 'false': alarm.is_false}


def _durations(steps: Sequence[tuple[float, str]], length_s: float) -> dict[str, float]:
    found = {f'{quality}_s': 0.0 for quality in QUALITIES}
    ends = [*(time_s for time_s, _ in steps[1:]), length_s]
    for (start_s, quality), end_s in zip(steps, ends):
        found[f'{quality}_s'] += max(end_s - start_s, 0.0)
    return {name: round(value, 3) for name, value in found.items()}


def _news2(steps: Sequence[tuple[float, dict[str, str]]], length_s: float) -> dict[str, Any]:
    course: list[dict[str, Any]] = [{
        'time_s': round(time_s, 3), 'total': int(values['total']) if values['total'] else None,
        'at_least': int(values['at_least']), 'complete': values['complete'] == 'true',
        'missing': values['missing'].split(), 'risk': values['risk'] or None}
        for time_s, values in steps]
    ends = [*(time_s for time_s, _ in steps[1:]), length_s]
    complete_s = sum(max(end_s - time_s, 0.0) for (time_s, values), end_s in zip(steps, ends)
                     if values['complete'] == 'true')
    totals = [each['total'] for each in course if each['total'] is not None]
    return {'complete_s': round(complete_s, 3), 'highest_total': max(totals, default=None),
            'highest_at_least': max((each['at_least'] for each in course), default=0),
            'course': course}


def _is_confirmed(alarm: RecordedAlarm, recording: VitalsRecording, options: EvaluationOptions
                  ) -> bool:
    """
    Return whether the values of the recording confirm an alarm.

    The median of all plausible values of a sign before the alarm counts, of any sensor. So neither
    the value of a sensor that is off nor a disturbance counts.
    """
    if alarm.kind == 'consciousness':
        return True
    if alarm.kind == 'news2':
        values: dict[str, float | None] = {
            sign: _median(recording, sign, alarm.start_s - max(
                _WINDOW_S, SIGNS[sign].stale_s), alarm.start_s, last=True) for sign in SIGNS}
        if options.oxygen is not None:
            values['oxygen_l_per_min'] = options.oxygen
        risk = score(values, options.spo2_scale).least_risk
        return any(risk >= least for _, least in LEVELS_OF_RISK)
    return any(_is_beyond(limit, alarm, recording) for limit in options.limits
               if limit.kind == alarm.kind)


def _is_beyond(limit: Limit | TrendLimit, alarm: RecordedAlarm, recording: VitalsRecording
               ) -> bool:
    if isinstance(limit, Limit):
        window_s = max(_WINDOW_S, limit.for_ns / _NS_PER_S)
        value = _median(recording, limit.sign, alarm.start_s - window_s, alarm.start_s)
        return value is not None and limit.is_exceeded(value, False)
    window_s = limit.window_ns / _NS_PER_S
    before, after = (
        _median(recording, limit.sign, alarm.start_s - late * window_s / 3,
                alarm.start_s - (late - 1) * window_s / 3) for late in (3, 1))
    if before is None or after is None:
        return False
    # The middles of the first and the last third are two thirds of the window apart.
    change = after - before if limit.is_rising else before - after
    return change >= limit.amount / 2


def _median(recording: VitalsRecording, sign: str, from_s: float, to_s: float,
            last: bool = False) -> float | None:
    """
    Return the median of the plausible values of an interval; None without one.

    :param last: only of the last two minutes that have values.
    """
    found = [(time_s, value) for column in recording.columns if column.sign == sign
             for time_s, value in column.samples
             if from_s <= time_s <= to_s and not SIGNS[sign].is_off(value)
             and SIGNS[sign].is_plausible(value)]
    if last and found:
        newest_s = max(time_s for time_s, _ in found)
        found = [each for each in found if each[0] >= newest_s - _WINDOW_S]
    return median(value for _, value in found) if found else None


def totals(reports: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Add up the reports of several recordings."""
    days = sum(each['person_days'] for each in reports)
    counts = {
        'clinical_alarms': sum(len(each['clinical_alarms']) for each in reports),
        'false_alarms': sum(each['false_alarms'] for each in reports),
        'technical_alarms': sum(len(each['technical_alarms']) for each in reports)}
    return {'recordings': len(reports), 'person_days': days, **counts,
            **{f'{name}_per_person_day': count / days for name, count in counts.items()}}

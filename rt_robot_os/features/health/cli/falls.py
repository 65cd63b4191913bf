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

"""The command `health falls`: run the fall detector on recordings."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from collections.abc import Sequence
import json
import math
from pathlib import Path
import re
import sys
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import no_match
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.features.health.cli.fall_evaluation import cross_validated
from rt_robot_os.features.health.cli.fall_evaluation import decide
from rt_robot_os.features.health.cli.fall_evaluation import Decision
from rt_robot_os.features.health.cli.fall_evaluation import GRID
from rt_robot_os.features.health.cli.fall_evaluation import LYING
from rt_robot_os.features.health.cli.fall_evaluation import summary
from rt_robot_os.features.health.cli.fall_recordings import FallRecording
from rt_robot_os.features.health.cli.fall_recordings import read_recordings
from rt_robot_os.features.health.fall_detector.limits import FALL_FIELDS
from rt_robot_os.features.health.fall_detector.limits import FallLimits
from rt_robot_os.features.health.fall_detector.limits import limits_problem


def add_to(commands: Any) -> None:
    """Add the command to those of the program."""
    parser = commands.add_parser(
        'falls', allow_abbrev=False, help='detect falls in recordings',
        description='Feed recordings of a worn accelerometer to the detector of the module '
        'fall_detector, sample by sample, and count detected falls and false alarms.')
    parser.add_argument('files', nargs='+', metavar='FILE', type=Path,
                        help='text, gzipped or not: "@ name,fall,movement,subject", then rows '
                        't_ms,a,x,y,z in g or m/s^2 (a gyroscope: w, in deg/s)')
    parser.add_argument('--set', action='append', default=[], metavar='NAME=VALUE',
                        help=f'another limit: {", ".join(FallLimits._fields)}')
    parser.add_argument('--cross-validate', action='store_true',
                        help='decide on each subject with limits chosen on the others, out of '
                        + '; '.join(f'{name} {", ".join(f"{each:g}" for each in values)}'
                                    for name, values in GRID.items()))
    parser.add_argument('--lying', default=LYING, metavar='PATTERN',
                        help='movements that are lying down on purpose, counted separately '
                        '(default: %(default)s)')
    parser.add_argument('--json', action='store_true', help='write one object instead of text')
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    limits = _limits(arguments.set)
    try:
        re.compile(arguments.lying)
    except re.error as error:
        raise ConfigError([f'--lying {arguments.lying!r} is not a regular expression: {error}']
                          ) from None
    recordings = [one for path in arguments.files for one in read_recordings(path)]
    decisions = [decide(one, limits, arguments.lying) for one in recordings]
    if arguments.lying != LYING and not any(
            re.search(arguments.lying, one.movement, re.IGNORECASE) for one in recordings):
        raise no_match('--lying', arguments.lying, dict.fromkeys(
            one.movement for one in recordings))
    found: dict[str, Any] = {'limits': limits._asdict(), **summary(decisions)}
    if arguments.cross_validate:
        validated, chosen = cross_validated(recordings, limits, arguments.lying)
        found['cross_validation'] = {**summary(validated), 'chosen': chosen}
    if arguments.json:
        found['recordings'] = [{**one._asdict(), 'right': one.right, 'bad_rows': each.bad,
                                'other_sensors_rows': each.ignored, 'in_m_s2': each.in_m_s2}
                               for one, each in zip(decisions, recordings, strict=True)]
        json.dump(found, sys.stdout, ensure_ascii=False, indent=1, allow_nan=False)
        print()
    else:
        for line in _text(decisions, recordings, found):
            print(line)
    return FAILED if any(one.problem for one in decisions) else OK


def _limits(texts: Sequence[str]) -> FallLimits:
    fields = {field.name: field for field in FALL_FIELDS}
    limits = FallLimits()
    for text in texts:
        name, _, value = text.partition('=')
        field = fields.get(name)
        if field is None:
            raise ConfigError([f'--set {text}: unknown limit {name!r}, must be one of '
                               f'{", ".join(fields)}'])
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if field.problem(number) is not None:
            raise ConfigError([f'--set {text}: {name} must be {field.wanted()}'])
        limits = limits._replace(**{name: number})
    problem = limits_problem(limits)
    if problem:
        raise ConfigError([f'--set: {problem}'])
    return limits


# ---- text ---------------------------------------------------------------------------------------

def _text(decisions: Sequence[Decision], recordings: Sequence[FallRecording], found: dict[str, Any]
          ) -> Iterator[str]:
    for one, recording in zip(decisions, recordings, strict=True):
        yield f'{_mark(one)} {one.name}: {_verdict(one)}'
        if recording.bad:
            yield f'         {recording.bad} malformed rows were ignored'
    yield ''
    yield from _shares(found)
    width = max([len(name) for name in found['movements']], default=0)
    for name, counts in found['movements'].items():
        kind = 'fall ' if counts['fall'] else 'daily'
        yield (f'  {name:{width}}  {kind}  {counts["detected"]:3} of {counts["recordings"]:3} '
               'detected as falls')
    if 'cross_validation' in found:
        validated = found['cross_validation']
        yield ''
        yield 'each subject with limits chosen on the others:'
        yield from _shares(validated)
        for subject, chosen in validated['chosen'].items():
            yield f'  {subject}: ' + ', '.join(f'{key} {value:g}' for key, value in chosen.items())


def _mark(one: Decision) -> str:
    if one.right is None:
        return 'unknown '
    if one.right:
        return 'right   '
    return 'lying   ' if one.lying else 'MISSED  ' if one.fall else 'FALSE   '


def _verdict(one: Decision) -> str:
    if one.problem:
        return one.problem
    if not one.detected:
        return 'no fall'
    return (f'fall, {one.after_impact_s:.1f} s after an impact of {one.peak_g:.1f} g, turned by '
            f'{one.turned_deg:.0f} deg, confidence {one.confidence:.2f}'
            + (', got up' if one.recovered else ''))


def _shares(found: dict[str, Any]) -> Iterator[str]:
    for name in ('sensitivity', 'specificity'):
        share = found[name]
        if share['of']:
            low, high = share['interval_95']
            yield (f'{name} {share["share"]:.3f} ({share["right"]} of {share["of"]}; 95 %: '
                   f'{low:.3f} to {high:.3f})')
        else:
            yield f'{name}: no recordings'
    alarms = found['false_alarms']
    if alarms['hours']:
        low, high = alarms['interval_95']
        yield (f'false alarms: {alarms["alarms"]} in {alarms["hours"]:.2f} h without a fall: '
               f'{alarms["per_hour"]:.2f} an hour (95 %: {low:.2f} to {high:.2f}; every detection '
               'counts, lying down on purpose included)')
    lying, delay = found['lying_down_on_purpose'], found['after_impact_s']
    yield (f'lying down on purpose: {lying["alarms"]} of {lying["recordings"]} detected as falls '
           '(in neither rate)')
    if delay['worst'] is not None:
        yield (f'detected {delay["median"]:.1f} s after the impact (median), '
               f'{delay["worst"]:.1f} s at the latest')

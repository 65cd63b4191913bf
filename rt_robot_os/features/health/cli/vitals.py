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

"""The command `health vitals`: run the modules of the robot on recordings of monitors."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import json
from pathlib import Path
import sys
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import OK
from rt_robot_os.features.health.assessment.limits import LIMIT_FORM
from rt_robot_os.features.health.assessment.limits import parse_limit
from rt_robot_os.features.health.assessment.limits import TREND_FORM
from rt_robot_os.features.health.cli.vitals_file import read_recording
from rt_robot_os.features.health.cli.vitals_report import EvaluationOptions
from rt_robot_os.features.health.cli.vitals_report import report
from rt_robot_os.features.health.cli.vitals_report import totals
from rt_robot_os.features.health.cli.vitals_run import play

_OXYGEN: Final = {'reported': None, 'air': 0.0, 'oxygen': 1.0}


def add_to(commands: Any) -> None:
    """Add the command to those of the program."""
    parser = commands.add_parser(
        'vitals', allow_abbrev=False, help='vital signs of recorded monitors, and their alarms',
        description='Run the modules vital_signs and assessment on recordings of monitors, as a '
        'robot would, on a virtual clock.')
    parser.add_argument('files', nargs='+', metavar='FILE', type=Path,
                        help='CSV with a header (minute or time_s, HR, PULSE, RESP, SpO2, NBPSys, '
                        '...), or the header of a WFDB record of numerics, NAME.hea')
    parser.add_argument('--spo2-scale', type=int, choices=(1, 2), default=1,
                        help='2 only for hypercapnic respiratory failure (default: 1)')
    parser.add_argument('--oxygen', choices=tuple(_OXYGEN), default='reported',
                        help='what was breathed (default: as recorded)')
    parser.add_argument('--limit', action='append', default=[], metavar='TEXT',
                        help=f'a personal limit or trend: {LIMIT_FORM}, or {TREND_FORM}; may '
                        'be given several times')
    parser.add_argument('--well', action='store_true',
                        help='the people were healthy: every clinical alarm is false')
    parser.add_argument('--json', action='store_true',
                        help='write one object instead of text, with the course of NEWS2')
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    try:
        limits = [parse_limit(text) for text in arguments.limit]
    except ValueError as error:
        raise ConfigError([f'--limit: {error}']) from None
    options = EvaluationOptions(
        limits, arguments.spo2_scale, _OXYGEN[arguments.oxygen], arguments.well)
    found = []
    for path in arguments.files:
        recording = read_recording(path)
        course = play(recording, {}, {
            'spo2_scale': arguments.spo2_scale, 'oxygen': arguments.oxygen,
            'limits': arguments.limit})
        found.append(report(str(path), recording, course, options))
    if arguments.json:
        json.dump({'files': found, **totals(found)}, sys.stdout, ensure_ascii=False, indent=1,
                  allow_nan=False)
        print()
    else:
        for each in found:
            for line in _text(each):
                print(line)
        print(_sum(totals(found)))
    return OK


def _text(found: dict[str, Any]) -> Iterator[str]:
    yield f'{found["file"]}: {found["length_s"] / 60:g} min'
    for sign, times in found['signs'].items():
        known = ', '.join(f'{name[:-2]} {value / 60:g} min' for name, value in times.items()
                          if value)
        columns = ' '.join(each['column'] for each in found['sensors'] if each['sign'] == sign)
        yield f'  {sign} ({columns}): {known}'
    for key in ('clinical_alarms', 'technical_alarms'):
        yield f'  {len(found[key])} {key.replace("_", " ")}'
        for alarm in found[key]:
            end = 'the end' if alarm['end_s'] is None else f'{alarm["end_s"] / 60:.1f}'
            false = ', FALSE' if alarm.get('false') else ''
            yield (f'    {alarm["start_s"] / 60:.1f} to {end} min, {alarm["level"]}: '
                   f'{alarm["text"]}{false}')
    news2 = found['news2']
    total = '-' if news2['highest_total'] is None else news2['highest_total']
    yield (f'  NEWS2: complete for {news2["complete_s"] / 60:g} min, highest {total}; lower bound '
           f'from known signs {news2["highest_at_least"]}')


def _sum(found: dict[str, Any]) -> str:
    return (f'{found["recordings"]} recordings, {found["person_days"]:.3f} person-days; for each '
            f'person and day {found["clinical_alarms_per_person_day"]:.1f} clinical alarms, of '
            f'these {found["false_alarms_per_person_day"]:.1f} false, and '
            f'{found["technical_alarms_per_person_day"]:.1f} technical ones')

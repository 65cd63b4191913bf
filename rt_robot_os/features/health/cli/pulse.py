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

"""The command `health pulse`: pulse rate of recorded waveforms, compared with the ECG."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import json
from pathlib import Path
import sys
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.features.health.cli.pulse_record import evaluate_record
from rt_robot_os.features.health.cli.pulse_record import MOST_PER_MIN


def add_to(commands: Any) -> None:
    """Add the command to those of the program."""
    parser = commands.add_parser(
        'pulse', allow_abbrev=False, help='pulse rate of a recorded waveform, and its ECG',
        description='Measure the pulse in the waveform (PLETH) of WFDB records, each second over '
        'the last ten, and compare it with the ECG of the record where both are reliable. The '
        f'exit code is 1 when one differs by more than {MOST_PER_MIN:g}/min, or a file cannot be '
        'read.')
    parser.add_argument('files', nargs='+', metavar='FILE', type=Path,
                        help='header of a WFDB record, NAME.hea, with its samples in the '
                        'same folder')
    parser.add_argument('--signal', default='', metavar='NAME',
                        help='waveform to measure; without it PLETH or PPG, else ABP or ART')
    parser.add_argument('--json', action='store_true',
                        help='write one object instead of text, with each second')
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    found = [_result(path, arguments.signal) for path in arguments.files]
    if arguments.json:
        json.dump({'files': found}, sys.stdout, ensure_ascii=False, indent=1, allow_nan=False)
        print()
    else:
        for each in found:
            for line in _text(each):
                print(line)
    failed = any(each.get('problem') or each['compared']['beyond'] for each in found)
    return FAILED if failed else OK


def _result(path: Path, signal: str) -> dict[str, Any]:
    try:
        return {'file': str(path), **evaluate_record(path, signal)}
    except ConfigError as error:
        return {'file': str(path), 'problem': '; '.join(error.problems)}


def _text(found: dict[str, Any]) -> Iterator[str]:
    if problem := found.get('problem'):
        yield problem
        return
    compared = found['compared']
    yield (f'{found["file"]}: {found["signal"]} at {found["rate_hz"]:g} Hz, '
           f'{found["length_s"]:g} s')
    yield (f'    pulse reliable in {found["believed"]} of {found["seconds"]} windows'
           + (f', {found["pulse_per_min"]["median"]:.1f}/min (median)'
              if found['believed'] else ''))
    yield from (f'    unreliable in {count}: {doubt}'
                for doubt, count in found['doubts'].items())
    if compared['windows']:
        yield (f'    difference to the ECG in {compared["windows"]} windows: '
               f'{compared["mean_per_min"]:.2f}/min (mean), {compared["most_per_min"]:.2f}/min '
               f'(maximum); {compared["beyond"]} above {MOST_PER_MIN:g}/min')
    else:
        yield '    no ECG to compare with'
    yield (f'    longest pause without a pulse {found["longest_pause_s"]:.1f} s: '
           + ('an asystole' if found['asystole'] else 'no asystole'))

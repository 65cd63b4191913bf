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

"""The command `health news2`: score cases of files, and compare with expected scores."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from collections.abc import Sequence
import json
from pathlib import Path
import sys
from typing import Any

from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.features.health.assessment.news2 import PARAMETERS
from rt_robot_os.features.health.assessment.news2 import score
from rt_robot_os.features.health.cli.news2_cases import Case
from rt_robot_os.features.health.cli.news2_cases import read_cases


def add_to(commands: Any) -> None:
    """Add the command to those of the program."""
    parser = commands.add_parser(
        'news2', allow_abbrev=False, help='score cases by the chart of NEWS2',
        description='Score the cases of JSON files by the chart of NEWS2, and compare with the '
        'scores that they expect. The exit code is 1 when a case differs, or cannot be read.')
    parser.add_argument('files', nargs='+', metavar='FILE', type=Path,
                        help='JSON: a list of cases, such as {"resp": 18, "spo2": 97, "oxygen": '
                        'false, "systolic": 120, "pulse": 70, "consciousness": "Alert", '
                        '"temperature": 36.8, "scale": 1, "total": 0}')
    parser.add_argument('--json', action='store_true', help='write one object instead of text')
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    files: list[dict[str, Any]] = [{'file': str(path), 'cases': [
        _result(case) for case in read_cases(path)]} for path in arguments.files]
    results: list[dict[str, Any]] = [case for file in files for case in file['cases']]
    differ = sum(bool(case['differences'] or case['problems']) for case in results)
    summary = {
        'cases': len(results), 'compared': sum(case['compared'] > 0 for case in results),
        'agree': sum(case['compared'] > 0 and not case['differences'] and not case['problems']
                     for case in results),
        'differ': differ, 'incomplete': sum(not case['complete'] for case in results)}
    if arguments.json:
        json.dump({'files': files, **summary}, sys.stdout, ensure_ascii=False, indent=1,
                  allow_nan=False)
        print()
    else:
        for line in _text(results, summary):
            print(line)
    return FAILED if differ else OK


def _result(case: Case) -> dict[str, Any]:
    found = score(case.values, case.scale)
    compared, differences = case.compare(found)
    return {
        'id': case.name, 'total': found.total, 'complete': found.complete,
        'missing': list(found.missing), 'at_least': found.at_least, 'scale': found.scale,
        'scores': {name: found.scores.get(name) for name in PARAMETERS},
        'risk': found.risk.title if found.risk is not None else None,
        'response': found.response or None,
        'frequency': found.frequency or None, 'compared': compared, 'differences': differences,
        'problems': case.problems}


def _text(results: Sequence[dict[str, Any]], summary: dict[str, int]) -> Iterator[str]:
    for case in results:
        yield f'{case["id"]}: {_verdict(case)}'
        yield from (f'    {each}' for each in (*case['problems'], *case['differences']))
    yield (f'{summary["cases"]} cases: {summary["agree"]} agree with the expected score, '
           f'{summary["differ"]} differ or have problems, '
           f'{summary["cases"] - summary["compared"]} have no expected score; '
           f'{summary["incomplete"]} are incomplete')


def _verdict(case: dict[str, Any]) -> str:
    if case['complete']:
        return f'{case["total"]}, risk {case["risk"]}, {case["response"]}, {case["frequency"]}'
    return f'no score, at least {case["at_least"]}: {", ".join(case["missing"])} missing'

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

"""Judge a JUnit file: were tests run at all, and was nothing skipped that CI has to run."""

from __future__ import annotations

from pathlib import Path
import re
import sys
from xml.etree import ElementTree

MUST_RUN = re.compile(
    r'\b(ros|rclpy|ament\w*|mypy|flake8|pep257|hypothesis)\b|_msgs\b', re.IGNORECASE)
BUILDS = ('pure build', 'compiled build')
# What a machine may lack; mypyc is installed for the tests.
MAY_LACK = re.compile(r'^no (C compiler|\S*Python\.h)\b')


def judge(path: Path) -> list[str]:
    """Return what is wrong with the results, nothing when all is well."""
    root = ElementTree.parse(path).getroot()
    wrong = []
    for build in BUILDS:
        cases = [case for suite in root.iter('testsuite') if suite.get('name') == build
                 for case in suite.iter('testcase')]
        why_not = root.get('not-compiled', '') if build == BUILDS[1] else ''
        if MAY_LACK.match(why_not):
            continue
        if all(case.find('skipped') is not None for case in cases):
            wrong.append(f'no test was run on the {build}' + (f': {why_not}' if why_not else ''))
    for case in root.iter('testcase'):
        name = f'{case.get("classname")}.{case.get("name")}'
        for tag in ('failure', 'error'):
            if case.find(tag) is not None:
                wrong.append(f'{tag}: {name}')
        skipped = case.find('skipped')
        if skipped is not None and MUST_RUN.search(reason := skipped.get('message', '')):
            wrong.append(f'skipped, but CI has to run it: {name}: {reason}')
    return wrong


if __name__ == '__main__':
    problems = judge(Path(sys.argv[1]))
    print('\n'.join(f'error: {problem}' for problem in problems), end='\n' if problems else '')
    sys.exit(bool(problems))

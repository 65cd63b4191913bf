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
Judge a JUnit file: were tests run at all, and was nothing skipped that CI has to run.

    judge.py RESULTS STATUS

STATUS is the exit code of the run of the tests. When at most MAX_REPEATED tests failed, and
nothing else is wrong, just those run once more, alone. Those that pass then are named as flaky,
and the run succeeds; a test that fails again fails the run. The last line is a closing line of
pytest.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
import os
from pathlib import Path
import re
import subprocess
import sys
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'scripts'))

from join_results import closing_line  # noqa: E402
from join_results import Run  # noqa: E402

MUST_RUN = re.compile(
    r'\b(ros|rclpy|ament\w*|mypy|flake8|pep257|hypothesis)\b|_msgs\b', re.IGNORECASE)
BUILDS = ('pure build', 'compiled build')
# What a machine may lack.
MAY_LACK = re.compile(r'^no (C compiler|\S*Python\.h)\b')

# What pytest-xdist says of a process that ended.
CRASHED = re.compile(r"worker '\w+' crashed")

# More failures than these are not chance.
MAX_REPEATED = 5
REPEAT_TIMEOUT_S = 900
# What says whether the kernel is compiled.
_COMPILE = {BUILDS[0]: '0', BUILDS[1]: '1'}


@dataclass(frozen=True)
class FailedTest:
    """
    A test that failed on a build.

    Its node id is empty where it cannot be repeated alone. That is so for a crash, too: the rest
    of its file did not run.
    """

    build: str
    name: str
    node_id: str

    def __str__(self) -> str:
        """Say which test failed on which build."""
        return f'failed: {self.name} ({self.build})'


@dataclass(frozen=True)
class Failure:
    """One outcome of a test: where it stands in the file, and what counts it in its suite."""

    test: FailedTest
    case: ElementTree.Element
    outcome: ElementTree.Element
    attribute: str


# Runs a failed test alone and returns whether it passed.
Repeat = Callable[[FailedTest], bool]


def judge(path: Path) -> list[str]:
    """Return what is wrong with the results, nothing when all is well."""
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        return [f'the tests left no results: {error}']
    return _missing(root) + [str(test) for test in failed_tests(root)]


def _missing(root: ElementTree.Element) -> list[str]:
    """Return which tests did not run although CI has to run them."""
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
        skipped = case.find('skipped')
        if skipped is not None and MUST_RUN.search(reason := skipped.get('message', '')):
            wrong.append(f'skipped, but CI has to run it: {_name(case)}: {reason}')
    return wrong


def failed_tests(root: ElementTree.Element) -> list[FailedTest]:
    """Return the tests that failed, each once for a build, in the order of the file."""
    found: dict[tuple[str, str], FailedTest] = {}
    for suite in root.iter('testsuite'):
        for failure in _failures(suite):
            found.setdefault((failure.test.build, failure.test.name), failure.test)
    return list(found.values())


def _failures(suite: ElementTree.Element) -> Iterator[Failure]:
    build = suite.get('name', '')
    for case in suite.iter('testcase'):
        for attribute, tag in (('failures', 'failure'), ('errors', 'error')):
            outcome = case.find(tag)
            if outcome is not None:
                crashed = CRASHED.match(outcome.get('message', ''))
                test = FailedTest(build, _name(case), '' if crashed else node_id(case))
                yield Failure(test, case, outcome, attribute)


def _name(case: ElementTree.Element) -> str:
    return f'{case.get("classname")}.{case.get("name")}'


def node_id(case: ElementTree.Element) -> str:
    """Return the node id of a test; empty where its file cannot be found, as of a collection."""
    parts = (case.get('classname') or '').split('.')
    if 'test' not in parts:
        return ''
    parts = parts[parts.index('test'):]
    for end in range(len(parts), 0, -1):
        file = Path(*parts[:end]).with_suffix('.py')
        if (ROOT / file).is_file():
            return '::'.join([str(file), *parts[end:], case.get('name', '')])
    return ''


def run_alone(test: FailedTest) -> bool:
    """Run one test by ``scripts/test``, with nothing else at the same time."""
    print(f'{f" once more, alone: {test.node_id} ({test.build}) ":=^80}', flush=True)
    try:
        return subprocess.run(
            [ROOT / 'scripts' / 'test', test.node_id, '-p', 'no:cacheprovider'], cwd=ROOT,
            env={**os.environ, 'RT_ROBOT_OS_COMPILE': _COMPILE[test.build]},
            stdin=subprocess.DEVNULL, timeout=REPEAT_TIMEOUT_S).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def conclude(path: Path, status: int, repeat: Repeat = run_alone) -> int:
    """
    Judge a run, repeat the few tests that failed, and print the outcome.

    :param status: the exit code of the run.
    :return: the exit code of CI.
    """
    problems: list[str] = judge(path)
    flaky: list[FailedTest] = []
    if problems:
        flaky = [test for test in _few_failures(path, problems) if repeat(test)]
        passed = {str(test) for test in flaky}
        problems = [problem for problem in problems if problem not in passed]
    elif status:
        problems = [f'the tests ended with exit code {status}, and no test failed']
    for problem in problems:
        print(f'error: {problem}')
    for test in flaky:
        print(f'flaky: {test.node_id} ({test.build}) failed and passed when repeated alone')
    try:
        print(_closing_line(path, flaky))
    except (OSError, ElementTree.ParseError):
        print('error: no test was counted')
    return 1 if problems else 0


def _few_failures(path: Path, problems: Sequence[str]) -> list[FailedTest]:
    """Return the tests to repeat; none where too many failed or something else is wrong."""
    try:
        failed = failed_tests(ElementTree.parse(path).getroot())
    except (OSError, ElementTree.ParseError):
        return []
    repeatable = [test for test in failed if test.node_id and test.build in _COMPILE]
    if len(problems) > len(repeatable) or len(repeatable) > MAX_REPEATED:
        return []
    return repeatable


def _closing_line(path: Path, flaky: Sequence[FailedTest]) -> str:
    """Sum up both builds as pytest does; a flaky test counts as passed and as a rerun."""
    runs = [Run(suite.get('name', ''), [suite])
            for suite in ElementTree.parse(path).getroot().iter('testsuite')]
    for suite in (suite for run in runs for suite in run.suites):
        passed = {test.name for test in flaky if test.build == suite.get('name')}
        for failure in list(_failures(suite)):
            if failure.test.name in passed:
                failure.case.remove(failure.outcome)
                number = int(suite.get(failure.attribute, 0))
                suite.set(failure.attribute, str(number - 1))
    return closing_line(runs, reruns=len(flaky))


if __name__ == '__main__':
    sys.exit(conclude(Path(sys.argv[1]), int(sys.argv[2])))

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

"""What ``scripts/test`` makes of two runs, and what CI says to it."""

from __future__ import annotations

from importlib.util import module_from_spec
from importlib.util import spec_from_file_location
from pathlib import Path
import re
import sys
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
GOOD = '<testcase classname="a" name="good" time="1"/>'
BAD = '<testcase classname="a" name="bad" time="1"><failure message="no">no</failure></testcase>'
SKIPPED = '<testcase classname="a" name="left"><skipped message="{}">x</skipped></testcase>'


def suite(*cases: str) -> str:
    """Write a file as pytest does."""
    text = ''.join(cases)
    return (f'<testsuites name="pytest tests"><testsuite name="pytest" tests="{len(cases)}" '
            f'failures="{text.count("<failure")}" skipped="{text.count("<skipped")}" errors="0" '
            f'time="61.5">{text}</testsuite></testsuites>')


def script(name: str) -> Any:
    """Import a file that lies in no package."""
    spec = spec_from_file_location(Path(name).stem, ROOT / name)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module  # where dataclasses look for it
    spec.loader.exec_module(module)
    return module


class Results:
    """The files of two runs, and what the scripts say to them."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self._folder = folder
        self._capsys = capsys
        self._joined = folder / 'build' / 'pytest.xml'

    def join(self, pure: str | None, compiled: str | None = None,
             why_not: str = '') -> tuple[int, list[str]]:
        """Give the exit code and what is printed."""
        runs = []
        for build, text in (('pure', pure), ('compiled', compiled)):
            path = self._folder / f'{build}.xml'
            if text is not None:
                path.write_text(text)
            if build == 'pure' or not why_not:
                runs.append(f'{build}={path}')
        code = script('scripts/join_results.py').main(
            [str(self._joined), *runs, '--not-compiled', why_not])
        return code, self._capsys.readouterr().out.splitlines()

    def judge(self) -> list[str]:
        """Give what CI finds wrong."""
        found: list[str] = script('.ci/judge.py').judge(self._joined)
        return found

    def conclude(self, status: int, *passing: str) -> tuple[int, list[str], list[str]]:
        """
        Give the exit code of CI, which tests it repeats, and what it prints.

        :param passing: the tests that pass when they are repeated.
        """
        repeated = []

        def repeat(test: Any) -> bool:
            repeated.append(f'{test.node_id} ({test.build})')
            return test.node_id.rpartition('::')[2] in passing

        code = script('.ci/judge.py').conclude(self._joined, status, repeat)
        return code, repeated, self._capsys.readouterr().out.splitlines()


@pytest.fixture
def results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Results:
    return Results(tmp_path, capsys)


def test_the_closing_line_counts_both_builds_and_is_one_of_pytest(results: Results) -> None:
    code, said = results.join(suite(GOOD, GOOD, SKIPPED.format('no camera')), suite(GOOD))
    assert code == 0
    assert re.fullmatch('=+ 3 passed, 1 skipped in 123.00s \\(0:02:03\\) =+', said[-1])
    assert said[-3:-1] == ['pure build: 2 passed, 1 skipped in 61.50s',
                           'compiled build: 1 passed in 61.50s']
    assert results.judge() == []


@pytest.mark.parametrize('pure, compiled, where', [
    (suite(GOOD, BAD), suite(GOOD), 'pure'), (suite(GOOD), suite(BAD, GOOD), 'compiled')])
def test_a_failure_on_either_build_is_named_at_the_end_and_fails(
        results: Results, pure: str, compiled: str, where: str) -> None:
    code, said = results.join(pure, compiled)
    assert code == 1
    assert f'FAILED ({where} build) a::bad - no' in said
    assert re.fullmatch('=+ 1 failed, 2 passed in .*=+', said[-1])
    assert results.judge()


@pytest.mark.parametrize('pure, compiled', [(suite(GOOD), None), (None, suite(GOOD)),
                                            (suite(GOOD), '<testsuites><testsuite'),
                                            (suite(GOOD), suite())])
def test_a_run_without_results_fails(
        results: Results, pure: str | None, compiled: str | None) -> None:
    results.join(pure, compiled)
    assert [line for line in results.judge() if 'results' in line or 'no test was run' in line]


def test_a_machine_that_cannot_compile_says_so_and_does_not_fail(results: Results) -> None:
    code, said = results.join(suite(GOOD), why_not='no C compiler (gcc): sudo apt install gcc')
    assert code == 0
    assert said[-2] == ('compiled build: not tested, no C compiler (gcc): sudo apt install gcc')
    assert re.fullmatch('=+ 1 passed in .*=+', said[-1])
    assert results.judge() == []


@pytest.mark.parametrize('why_not', ['no time', 'RT_ROBOT_OS_COMPILE=0'])
def test_ci_fails_when_only_the_will_to_compile_is_missing(
        results: Results, why_not: str) -> None:
    assert results.join(suite(GOOD), why_not=why_not)[0] == 0
    assert results.judge() == [f'no test was run on the compiled build: {why_not}']


@pytest.mark.parametrize('reason', ['rclpy is not installed', 'mypy is missing',
                                    'the linter ament_flake8 is missing'])
def test_ci_fails_when_what_it_has_to_run_was_skipped(results: Results, reason: str) -> None:
    results.join(suite(GOOD, SKIPPED.format(reason)), suite(GOOD))
    assert results.judge()


def failing(name: str, message: str = 'no', tag: str = 'failure') -> str:
    """Write a test of this file that failed."""
    return (f'<testcase classname="rt_robot_os.test.test_results.TestGroup" name="{name}">'
            f'<{tag} message="{message}">no</{tag}></testcase>')


def test_ci_repeats_a_few_failed_tests_alone_and_names_those_that_pass(results: Results) -> None:
    results.join(suite(GOOD, failing('one')), suite(GOOD, failing('two[a-1]')))
    code, repeated, said = results.conclude(1, 'one', 'two[a-1]')
    assert code == 0
    assert repeated == ['test/test_results.py::TestGroup::one (pure build)',
                        'test/test_results.py::TestGroup::two[a-1] (compiled build)']
    assert [line for line in said if line.startswith('flaky: ')] == [
        f'flaky: {each} failed and passed when repeated alone' for each in repeated]
    assert re.fullmatch('=+ 4 passed, 2 rerun in 123.00s .*=+', said[-1])


def test_ci_fails_when_a_repeated_test_fails_again(results: Results) -> None:
    results.join(suite(GOOD, failing('one'), failing('two')), suite(GOOD))
    code, repeated, said = results.conclude(1, 'one')
    assert code == 1 and len(repeated) == 2
    assert [line for line in said if line.startswith('error: ')] == [
        'error: failed: rt_robot_os.test.test_results.TestGroup.two (pure build)']
    assert re.fullmatch('=+ 1 failed, 3 passed, 1 rerun in .*=+', said[-1])


@pytest.mark.parametrize('pure, compiled, status', [
    (suite(GOOD, *(failing(str(number)) for number in range(6))), suite(GOOD), 1),
    (suite(GOOD, failing('one')), None, 1),  # the other build left no results
    (suite(GOOD, failing('one'), SKIPPED.format('rclpy is not installed')), suite(GOOD), 1),
    (suite(GOOD, failing('one', 'worker &apos;gw1&apos; crashed while running')), suite(GOOD), 1),
    (suite(GOOD, BAD), suite(GOOD), 1),  # an error while a file was collected
    (suite(GOOD), suite(GOOD), 2)])
def test_ci_repeats_nothing_when_more_is_wrong_than_a_few_tests(
        results: Results, pure: str, compiled: str | None, status: int) -> None:
    results.join(pure, compiled)
    code, repeated, said = results.conclude(status, 'one')
    assert (code, repeated) == (1, [])
    assert any(line.startswith('error: ') for line in said)


def test_ci_fails_when_there_are_no_results_at_all(results: Results) -> None:
    code, repeated, said = results.conclude(0)
    assert (code, repeated) == (1, [])
    assert said[0].startswith('error: the tests left no results')


def test_a_test_that_fails_in_its_teardown_as_well_is_repeated_once(results: Results) -> None:
    twice = failing('one') + failing('one', tag='error')
    results.join(suite(GOOD, twice).replace('errors="0"', 'errors="1"').replace(
        'tests="2"', 'tests="3"'), suite(GOOD))
    code, repeated, said = results.conclude(1, 'one')
    assert code == 0 and len(repeated) == 1
    assert ' failed' not in said[-1] and ' error' not in said[-1]

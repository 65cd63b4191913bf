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


@pytest.mark.parametrize('why_not', ['no mypyc: pip install mypy', 'RT_ROBOT_OS_COMPILE=0'])
def test_ci_fails_when_only_the_will_to_compile_is_missing(
        results: Results, why_not: str) -> None:
    assert results.join(suite(GOOD), why_not=why_not)[0] == 0
    assert results.judge() == [f'no test was run on the compiled build: {why_not}']


@pytest.mark.parametrize('reason', ['rclpy is not installed', 'mypy is missing',
                                    'the linter ament_flake8 is missing'])
def test_ci_fails_when_what_it_has_to_run_was_skipped(results: Results, reason: str) -> None:
    results.join(suite(GOOD, SKIPPED.format(reason)), suite(GOOD))
    assert results.judge()

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
Join what the tests said of both builds in one JUnit file, and close as pytest does.

    join_results.py JOINED pure=FILE compiled=FILE
    join_results.py JOINED pure=FILE --not-compiled 'no C compiler'
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
import datetime
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

WIDTH = 80
# As pytest names them, in its order.
OUTCOMES = ('failed', 'passed', 'skipped', 'errors', 'rerun')


@dataclass
class Run:
    """One run of pytest."""

    build: str
    suites: list[ElementTree.Element] = field(default_factory=list)

    def counts(self) -> Counter[str]:
        """Return how many tests ended how."""
        found = Counter({
            outcome: sum(int(suite.get(attribute, 0)) for suite in self.suites)
            for outcome, attribute in (('failed', 'failures'), ('errors', 'errors'),
                                       ('skipped', 'skipped'), ('passed', 'tests'))})
        found['passed'] -= found['failed'] + found['errors'] + found['skipped']
        return found

    def seconds(self) -> float:
        """Return how long it took."""
        return sum(float(suite.get('time', 0)) for suite in self.suites)

    def failures(self) -> Iterator[str]:
        """Yield a line for each test that did not pass."""
        for case in (case for suite in self.suites for case in suite.iter('testcase')):
            for tag, word in (('failure', 'FAILED'), ('error', 'ERROR')):
                found = case.find(tag)
                if found is not None:
                    why = (found.get('message', '').splitlines() or [''])[0]
                    yield (f'{word} ({self.build} build) {case.get("classname")}::'
                           f'{case.get("name")} - {why}')


def read(build: str, path: Path) -> Run:
    """Read the file of a run; one that is not there, or was cut short, is an error in it."""
    try:
        suites = list(ElementTree.parse(path).getroot().iter('testsuite'))
    except (OSError, ElementTree.ParseError) as error:
        suites = [_nothing(f'the tests of the {build} build left no results: {error}')]
    for suite in suites:
        suite.set('name', f'{build} build')
    return Run(build, suites)


def _nothing(why: str) -> ElementTree.Element:
    suite = ElementTree.Element('testsuite', tests='1', errors='1', failures='0', skipped='0')
    case = ElementTree.SubElement(suite, 'testcase', classname='scripts.test', name='results')
    ElementTree.SubElement(case, 'error', message=why)
    return suite


def join(runs: list[Run], not_compiled: str) -> ElementTree.ElementTree[ElementTree.Element]:
    """Make one file of all; with the reason when the compiled build was not tested."""
    root = ElementTree.Element('testsuites', name='pytest tests')
    if not_compiled:
        root.set('not-compiled', not_compiled)
    root.extend(suite for run in runs for suite in run.suites)
    return ElementTree.ElementTree(root)


def in_words(counts: Counter[str]) -> str:
    """Write counts as pytest does."""
    words = [f'{counts[outcome]} {outcome}' for outcome in OUTCOMES if counts[outcome]]
    return re.sub(r'\b1 errors', '1 error', ', '.join(words)) or 'no tests ran'


def closing_line(runs: list[Run], reruns: int = 0) -> str:
    """
    Sum up all runs, in the manner of pytest.

    :param reruns: how many of the tests passed only when they were repeated.
    """
    counts = sum((run.counts() for run in runs), Counter(rerun=reruns))
    seconds = sum(run.seconds() for run in runs)
    clock = datetime.timedelta(seconds=int(seconds))
    text = f' {in_words(counts)} in {seconds:.2f}s ({clock}) '
    return text.center(WIDTH, '=')


def main(arguments: list[str]) -> int:
    """Join, and tell how it went."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('joined', type=Path)
    parser.add_argument('runs', nargs='+', metavar='BUILD=FILE')
    parser.add_argument('--not-compiled', default='', metavar='REASON')
    given = parser.parse_args(arguments)
    named = [each.partition('=') for each in given.runs]
    runs = [read(build, Path(file)) for build, _, file in named]
    given.joined.parent.mkdir(parents=True, exist_ok=True)
    join(runs, given.not_compiled).write(given.joined, 'utf-8', xml_declaration=True)
    print(f' {" and ".join(run.build for run in runs)} build '.center(WIDTH, '='))
    for line in (line for run in runs for line in run.failures()):
        print(line)
    for run in runs:
        print(f'{run.build} build: {in_words(run.counts())} in {run.seconds():.2f}s')
    if given.not_compiled:
        print(f'compiled build: not tested, {given.not_compiled}')
    print(closing_line(runs))
    counts = sum((run.counts() for run in runs), Counter[str]())
    return 1 if counts['failed'] or counts['errors'] or not counts['passed'] else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))

#!/usr/bin/env python3
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
Compare small costs of the kernel in two trees, in pure Python and compiled, beside bare loops.

Each of the two is a folder with a copy of this repository, such as a ``git worktree``::

    ./scripts/bench compare_trees ../old .                      # 5 rounds, 5 minutes
    ./scripts/bench compare_trees ../old . --rounds 3 --cases single,together --json costs.json

In each round every tree and build has a fresh process (``kernel_costs.py``), set up for real time
alike. They take turns at each case, once in this order and once in the reverse one, so that what
disturbs the machine meets all of them; a round's figure is the mean of both. Shown are the medians
of the rounds with the lowest and the highest; ratios are taken round by round. Build the compiled
parts before: ``python setup.py build_ext --inplace`` in each tree. Nothing else should run
meanwhile.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import contextmanager
from contextlib import ExitStack
from dataclasses import dataclass
import fcntl
import json
import os
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
from typing import Any

CHILD = Path(__file__).parent / 'kernel_costs.py'
LOCK = Path(tempfile.gettempdir()) / 'rt_robot_os_bench.lock'  # that of `bench`
SWITCH = 'RT_ROBOT_OS_COMPILE'
BUILDS = {'pure': '0', 'compiled': '1'}
FLOOR = 'floor'
# (title, unit, share of --seconds): rates and what comes at 500 Hz need more of them.
CASES: Mapping[str, tuple[str, str, float]] = {
    'single': ('job of one task at 200 Hz, CPU; floor: bare wake-up', 'us', 1.0),
    'ten': ('job, 10 tasks together, CPU', 'us', 0.5),
    'together': ('job, 100 tasks together, CPU; floor: plain loop', 'us', 0.5),
    'thousand': ('job, 1000 tasks together, CPU', 'us', 0.5),
    'spread': ('job, 100 tasks 50 us apart, CPU', 'us', 0.5),
    'publish': ('publish 64 B', 'us', 0.2),
    'take': ('publish and take 64 B', 'us', 0.2),
    'to_task': ('publish 64 B to a waiting task, hot', 'us', 0.2),
    'delay': ('delay of 64 B at 500 Hz, p50', 'us', 1.0),
    'bare_delay': ('  bare loop with the same sleep', 'us', 1.0),
    'reached': ('1000 tasks at 200 Hz together', 'Hz', 1.0),
    'reached_spread': ('1000 tasks at 200 Hz, 5 us apart', 'Hz', 1.0),
    'call': ('call of an empty function', 'us', 0.2),
}
# Measured with another one, in short turns.
BESIDE: Mapping[str, Sequence[str]] = {'delay': ('bare_delay',)}
Values = dict[str, dict[str, 'list[float | None]']]


@dataclass(frozen=True)
class Subject:
    """
    What is measured: a build of a tree, or bare loops.

    :ivar name: ``old pure``, ``new compiled``, or ``floor``.
    """

    name: str
    tree: Path
    switch: str


class Child:
    """A process that measures a case when it is asked to; ended with the ``with`` block."""

    def __init__(self, subject: Subject) -> None:
        kind = FLOOR if subject.name == FLOOR else 'kernel'
        self._name = subject.name
        self._process = subprocess.Popen(
            [sys.executable, str(CHILD), kind], text=True, cwd=subject.tree,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**os.environ, 'PYTHONPATH': str(subject.tree), SWITCH: subject.switch})
        self.said = self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        answer: dict[str, Any] = json.loads(line) if line else {
            'error': f'ended with code {self._process.wait()}'}
        return answer

    def measure(self, case: str, seconds: float) -> dict[str, float]:
        """
        Measure.

        :return: what was found, by case; nothing where this subject has no such case.
        """
        assert self._process.stdin is not None
        self._process.stdin.write(f'{case} {seconds}\n')
        self._process.stdin.flush()
        answer = self._answer()
        if 'error' in answer:
            raise SystemExit(f'compare_trees: {self._name}, case {case}: {answer["error"]}')
        return answer

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *error: object) -> None:
        self._process.communicate()


def subjects(old: Path, new: Path, builds: Sequence[str]) -> list[Subject]:
    """List what is compared."""
    return [*(Subject(f'{name} {build}', tree, BUILDS[build])
              for build in builds for name, tree in (('old', old), ('new', new))),
            Subject(FLOOR, new, '0')]


def available(wanted: Sequence[Subject]) -> list[Subject]:
    """Say of each what it is, or why it is left out; return those that can be measured."""
    found, refused = [], set()
    for subject in wanted:
        with Child(subject) as child:
            said = child.said
        print(f'{subject.name}: {said.get("text") or "left out: " + said["error"]}')
        if 'error' not in said:
            found.append(subject)
            refused |= {*said['refused']}
    print(f'Linux refused: {", ".join(sorted(refused))}' if refused
          else 'In force: SCHED_FIFO, one CPU, locked memory, timer slack of 1 ns')
    return found


@contextmanager
def alone() -> Iterator[None]:
    """Wait until no `bench` measures: two at the same priority on one CPU starve each other."""
    fd = os.open(LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


def measure(known: Sequence[Subject], cases: Sequence[str], seconds: float, rounds: int
            ) -> Values:
    """Let all take turns at each case, forth and back, round by round."""
    shown = [name for case in cases for name in (case, *BESIDE.get(case, ()))]
    values: Values = {case: {subject.name: [] for subject in known} for case in shown}
    for number in range(rounds):
        with ExitStack() as stack:
            children = [(subject.name, stack.enter_context(Child(subject))) for subject in known]
            for case in cases:
                share_s = seconds * CASES[case][2]
                with alone():
                    forth = {name: child.measure(case, share_s) for name, child in children}
                    back = {name: child.measure(case, share_s)
                            for name, child in reversed(children)}
                for part in (case, *BESIDE.get(case, ())):
                    for name, one in forth.items():
                        values[part][name].append(
                            (one[part] + back[name][part]) / 2 if part in one else None)
        print(f'round {number + 1} of {rounds}', file=sys.stderr)
    return values


def ratios(above: Sequence[float | None], below: Sequence[float | None]) -> list[float]:
    """Divide round by round."""
    return [a / b for a, b in zip(above, below) if a is not None and b]


def spread(values: Sequence[float | None]) -> str:
    """Write the median with the lowest and the highest; a dash without any."""
    known = [value for value in values if value is not None]
    if not known:
        return '-'
    middle, low, high = statistics.median(known), min(known), max(known)
    return f'{middle:.4g} ({low:.4g}..{high:.4g})'


def table(values: Values, names: Sequence[str]) -> Iterator[str]:
    """Write what was measured."""
    width = max(len(title) for title, _, _ in CASES.values()) + 5
    yield ' ' * width + ''.join(f'{name:>28}' for name in names)
    for case, found in values.items():
        title, unit, _ = CASES[case]
        yield f'{title + ", " + unit:<{width}}' + ''.join(
            f'{spread(found[name]):>28}' for name in names)


def _short(case: str) -> str:
    return CASES[case][0].partition(';')[0].strip()


def comparisons(values: Values, names: Sequence[str]) -> Iterator[str]:
    """Write the ratios of the trees and builds, and what is over the floor."""
    pairs = [pair for pair in (('new compiled', 'old compiled'), ('new pure', 'old pure'),
                               ('new compiled', 'new pure'), ('old compiled', 'old pure'))
             if {*pair} <= {*names}]
    yield from ('', 'Ratios, round by round:')
    for one, two in pairs:
        for case, found in values.items():
            if some := ratios(found[one], found[two]):
                yield f'  {one} / {two}: {_short(case)}: {spread(some)}'
    for name in (name for name in names if name != FLOOR):
        for case, found in values.items():
            if some := ratios(found[name], found[FLOOR]):
                yield f'  {name} / floor: {_short(case)}: {spread(some)}'
        if {'delay', 'bare_delay'} <= {*values} and (some := ratios(
                values['delay'][name], values['bare_delay'][name])):
            yield f'  {name}: delay / bare loop with the same sleep: {spread(some)}'


# (text, case, dividend, divisor: a subject or a case of the same one, limit, at most)
_AIMS = (
    ('job of one task, CPU / bare clock_nanosleep', 'single', 'new compiled', FLOOR, 1.5, True),
    ('job, 100 together, new / old', 'together', 'new compiled', 'old compiled', 0.45, True),
    ('publish and take, new / old', 'take', 'new compiled', 'old compiled', 0.4, True),
    ('publish to a waiting task, new / old', 'to_task', 'new compiled', 'old compiled', 0.4, True),
    ('delay at 500 Hz, new / old', 'delay', 'new compiled', 'old compiled', 0.4, True),
    ('delay at 500 Hz / bare loop', 'delay', 'new compiled', 'bare_delay', 1.5, True),
    ('1000 tasks together, Hz', 'reached', 'new compiled', '', 199.9, False),
    ('1000 tasks spread, Hz', 'reached_spread', 'new compiled', '', 195.0, False),
    ('pure: job, 100 together, new / old', 'together', 'new pure', 'old pure', 1.3, True),
    ('pure: publish and take, new / old', 'take', 'new pure', 'old pure', 1.3, True),
    ('pure: delay at 500 Hz, new / old', 'delay', 'new pure', 'old pure', 1.3, True),
)


def verdicts(values: Values) -> Iterator[str]:
    """Compare with what was aimed at."""
    yield from ('', 'Targets (median of the rounds):')
    for text, case, name, below, limit, at_most in _AIMS:
        found = values.get(case, {})
        some: Sequence[float | None] = found.get(name, [])
        if below:
            other = values.get(below, {}).get(name) if below in CASES else found.get(below)
            some = ratios(some, other or [])
        known = [value for value in some if value is not None]
        if not known:
            continue
        middle = statistics.median(known)
        met = middle <= limit if at_most else middle >= limit
        yield (f'  {text}: {"<=" if at_most else ">="} {limit:g}: {spread(known)} '
               f'{"reached" if met else "MISSED"}')


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='compare_trees', description=(__doc__ or '').strip(),
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('old', type=Path)
    parser.add_argument('new', type=Path)
    parser.add_argument('--rounds', type=int, default=5, metavar='N')
    parser.add_argument('--seconds', type=float, default=0.6, metavar='S',
                        help='of a turn at the longest cases (default 0.6)')
    parser.add_argument('--builds', default=','.join(BUILDS), help='default: %(default)s')
    asked = [case for case in CASES if not any(case in beside for beside in BESIDE.values())]
    parser.add_argument('--cases', default=','.join(asked), help='default: %(default)s')
    parser.add_argument('--json', type=Path, metavar='FILE', help='keep every value')
    given = parser.parse_args(argv)
    for option, known in (('builds', [*BUILDS]), ('cases', asked)):
        words = getattr(given, option).split(',')
        setattr(given, option, words)
        if unknown := [word for word in words if word not in known]:
            parser.error(f'--{option} {unknown[0]}: there are {", ".join(known)}')
    for tree in (given.old, given.new):
        if not (tree / 'rt_robot_os' / '__init__.py').is_file():
            parser.error(f'{tree}: no copy of this repository: has no rt_robot_os/__init__.py')
    if given.rounds < 1 or not 0.001 <= given.seconds <= 3600:
        parser.error('--rounds is at least 1, --seconds is from 0.001 to 3600')
    return given


def main(argv: Sequence[str]) -> int:
    """Measure and print."""
    given = _arguments(argv)
    known = available(subjects(given.old.absolute(), given.new.absolute(), given.builds))
    values = measure(known, given.cases, given.seconds, given.rounds)
    names = [subject.name for subject in known]
    print('\n'.join((*table(values, names), *comparisons(values, names), *verdicts(values))))
    if given.json is not None:
        given.json.write_text(json.dumps(values, indent=1) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))

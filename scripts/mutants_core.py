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
Plant faults in the C core, one at a time, and see whether the tests find them.

    .venv/bin/python scripts/mutants_core.py [--only NAME] [--cases 300]

Each mutant is a copy of the package with one text of a C file replaced, compiled. It is compared
with the pure build in random scenarios (``scripts/compare_builds.py``); one that is not found
there has to be found by the tests of the kernel and of the topics. A text that is not in its file
any more is an error: update the mutant.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from core_build import build
from core_build import copy_tree
from core_build import environment
from core_build import STABLE

TESTS = ('test/kernel', 'test/topics')
# Tests of the real clock that a busy machine skips or that take long; the mutants are logical.
PATIENCE_S = 600.0


@dataclass(frozen=True)
class Mutant:
    """A fault: where, what is replaced, and by what."""

    name: str
    file: str
    right: str
    wrong: str


CORE, TASK, RING = 'kernel/_core.c', 'kernel/_task.c', 'topics/_ring.c'
MUTANTS = (
    # What must be found, by the comparison or by the tests.
    Mutant('wrong bucket', TASK, 'int shift = 60 -', 'int shift = 61 -'),
    Mutant('forgotten coalesced count', CORE, '        task->coalesced++;', '        ;'),
    Mutant('a level of its own preempts', CORE, '    if (level <= core->level)\n        set_ready',
           '    if (level < core->level)\n        set_ready'),
    Mutant('wrong order among equals', CORE,
           'other->due_ns == timer.due_ns && other->order < timer.order',
           'other->due_ns == timer.due_ns && other->order > timer.order'),
    Mutant('lost spare timer', CORE,
           '    core->spare_ns = spare_ns;\n    return set_timer(core, 1, spare_ns);',
           '    core->spare_ns = spare_ns;\n    return 0;'),
    Mutant('forgotten reference to a timer', CORE,
           '    *timer_at(list, low) = timer;\n    Py_INCREF(timer.target);',
           '    *timer_at(list, low) = timer;'),
    Mutant('dropped record', TASK, '        box->count++;\n    else if',
           '        box->count += record->kind != OVERRUN;\n    else if'),
    Mutant('lapped reader', RING, '        if (topic->head - wanted > depth) {',
           '        if (topic->head - wanted > depth + 1) {'),
    Mutant('level not restored', CORE, '    core->current = NULL;\n    core->level = level;',
           '    core->current = NULL;'),
    Mutant('follow-up forgotten', CORE,
           'if (failure == NULL && !task->follow_up && !task->inside)',
           'if (failure == NULL && !task->inside)'),
    Mutant('swapped start and release', CORE, '.a = release_ns,\n                     .b = '
           'task->start_ns', '.a = task->start_ns,\n                     .b = release_ns'),
    Mutant('budget armed late', CORE, 'smaller(interrupt_ns, time_ns + task->budget_ns)',
           'smaller(interrupt_ns, time_ns + task->budget_ns + 1)'),
    Mutant('missed releases not counted', CORE, '            task->missed += unserved;',
           '            ;'),
    Mutant('jitter of the wrong period', TASK, 'gap_ns - task->interval_ns',
           'gap_ns - task->period_ns'),
    Mutant('stamp of the sample before', RING, 'topic->stamps[index] = stamp_ns ? stamp_ns : '
           'at_ns;', 'topic->stamps[(index + 1) & topic->mask] = stamp_ns ? stamp_ns : at_ns;'),
    Mutant('too many references to a task that runs', CORE,
           '    core->level = level;\n    Py_XDECREF((PyObject *)before);\n}\n\n'
           '/* Runs every ready task', '    core->level = level;\n}\n\n'
           '/* Runs every ready task'),
)


def killer(folder: Path, cases: int) -> str:
    """Say what found the fault; nothing when nothing did."""
    steps = (
        ('scenarios', [str(folder / 'scripts' / 'compare_builds.py'), '--cases', str(cases),
                       '--stop-at-first']),
        ('tests', ['-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider', *TESTS]))
    for name, command in steps:
        try:
            done = subprocess.run([sys.executable, *command], cwd=folder, env=environment(folder),
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                  timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            return f'{name}: no end within {PATIENCE_S:g} s'
        if done.returncode:
            last = [line for line in done.stdout.splitlines() if line.strip()]
            told = [line for line in last if line.startswith(('FAILED', 'They differ'))]
            return f'{name}: {(told or last or [""])[-1]}'
    return ''


def main() -> int:
    """Try them all; the exit code is the number of mutants that live."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--only', default='', help='those with this text in their name')
    parser.add_argument('--cases', type=int, default=1000)
    options = parser.parse_args()
    alive = []
    with tempfile.TemporaryDirectory(prefix='rt_robot_os_mutants_') as name:
        folder = Path(name)
        copy_tree(folder)
        for mutant in MUTANTS:
            if options.only not in mutant.name:
                continue
            begin_s = time.monotonic()
            path = folder / 'rt_robot_os' / mutant.file
            text = path.read_text()
            if text.count(mutant.right) != 1:
                parser.error(f'mutant {mutant.name!r}: its text is {text.count(mutant.right)} '
                             f'times in {mutant.file}, but must be there once: update the mutant')
            path.write_text(text.replace(mutant.right, mutant.wrong))
            build(folder, ('-O1', '-w', *STABLE))
            found = killer(folder, options.cases)
            path.write_text(text)
            if not found:
                alive.append(mutant.name)
            print(f'{"killed" if found else "ALIVE":6} {mutant.name:40} '
                  f'{time.monotonic() - begin_s:4.0f} s  {found}', flush=True)
    print(f'{len(alive)} live' + (f': {", ".join(alive)}' if alive else ''))
    return len(alive)


if __name__ == '__main__':
    sys.exit(main())

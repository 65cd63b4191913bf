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
Say which lines of the C core the tests of the kernel and of the topics do not reach (gcov).

    .venv/bin/python scripts/coverage_core.py [--cases 200] [PYTEST ARGUMENT ...]

A copy of the package is compiled with ``--coverage``; the tests run there, random
scenarios, and scenarios in which allocations fail.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import subprocess
import sys
import tempfile

from core_build import build
from core_build import C_SOURCES
from core_build import copy_tree
from core_build import environment
from core_build import STABLE

TESTS = ('test/kernel', 'test/topics', 'test/test_compiled.py')
WANTED_PERCENT = 95.0


def report(folder: Path) -> float:
    """Print the lines that were not reached; give how many percent were."""
    notes = [str(path) for path in folder.rglob('*.gcno')]
    subprocess.run(['gcov', '--relative-only', *notes], cwd=folder, check=True,
                   stdout=subprocess.DEVNULL)
    reached = known = 0
    for source in C_SOURCES:
        path = folder / f'{Path(source).name}.gcov'
        if not path.exists():
            continue
        missed = []
        for line in path.read_text().splitlines():
            count, number, text = line.split(':', 2)
            if count.strip() == '-' or int(number) == 0:
                continue
            known += 1
            if count.strip().startswith('#'):
                missed.append(f'{number.strip():>6}: {text}')
            else:
                reached += 1
        print(f'{source}: {len(missed)} lines not reached')
        print('\n'.join(missed))
    return 100.0 * reached / max(known, 1)


def main() -> int:
    """Run the tests and report; the exit code says whether enough was reached."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--cases', type=int, default=200)
    options, pytest_arguments = parser.parse_known_args()
    with tempfile.TemporaryDirectory(prefix='rt_robot_os_coverage_') as name:
        folder = Path(name)
        copy_tree(folder)
        build(folder, ('-O0', '--coverage', *STABLE))
        covered = environment(folder)
        for command in (
                ['-m', 'pytest', '-q', '-p', 'no:cacheprovider', *(pytest_arguments or TESTS)],
                ['scripts/compare_builds.py', '--cases', str(options.cases)],
                ['scripts/failing_allocations.py', '--step', '7']):
            subprocess.run([sys.executable, *command], cwd=folder, env=covered)
        percent = report(folder)
    print(f'{percent:.1f} % of the lines of the C core are reached (wanted: {WANTED_PERCENT:g})')
    return int(percent < WANTED_PERCENT)


if __name__ == '__main__':
    os.environ.setdefault('PYTHONDONTWRITEBYTECODE', '1')
    sys.exit(main())

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
Run the C core with the sanitizers of the compiler, which end what does something undefined.

    .venv/bin/python scripts/sanitize_core.py [--seconds 30] [--cases 300] [--tests]

A copy of the package is compiled with ``-fsanitize=address,undefined`` and run by the usual
Python, with the sanitizer's library loaded before it: random scenarios (``compare_builds.py``),
everything at once with signals at random instants (``stress_core.py``), and with ``--tests`` the
tests of the kernel and of the topics. About a third of the usual speed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import subprocess
import sys
import tempfile

from core_build import build
from core_build import compiler
from core_build import copy_tree
from core_build import environment
from core_build import STABLE

FLAGS = ('-O1', '-g', '-fno-omit-frame-pointer', '-fsanitize=address,undefined',
         '-fno-sanitize-recover=undefined')


def libraries() -> str:
    """Return what has to be loaded before Python."""
    return ' '.join(subprocess.run(
        [compiler(), f'-print-file-name={name}'], check=True, text=True,
        stdout=subprocess.PIPE).stdout.strip() for name in ('libasan.so', 'libubsan.so'))


def main() -> int:
    """Run all; the exit code says whether something was found."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--seconds', type=float, default=30.0)
    parser.add_argument('--cases', type=int, default=300)
    parser.add_argument('--tests', action='store_true')
    options = parser.parse_args()
    status = 0
    with tempfile.TemporaryDirectory(prefix='rt_robot_os_sanitized_') as name:
        folder = Path(name)
        copy_tree(folder)
        build(folder, (*FLAGS, *STABLE))
        # Python itself leaves things behind at its end, on purpose.
        sanitized = environment(
            folder, LD_PRELOAD=libraries(), PYTHONMALLOC='malloc',
            ASAN_OPTIONS='detect_leaks=0:abort_on_error=1', UBSAN_OPTIONS='print_stacktrace=1')
        commands = [
            ['scripts/compare_builds.py', '--cases', str(options.cases), '--seed', '11'],
            ['scripts/stress_core.py', '--seconds', str(options.seconds)],
            ['scripts/failing_allocations.py', '--step', '40']]
        if options.tests:
            commands.append(['-m', 'pytest', '-q', '-p', 'no:cacheprovider', 'test/kernel',
                             'test/topics'])
        for command in commands:
            print(f'$ {" ".join(command)}', flush=True)
            done = subprocess.run([sys.executable, *command], cwd=folder, env=sanitized)
            status |= done.returncode != 0
    return status


if __name__ == '__main__':
    sys.exit(main())

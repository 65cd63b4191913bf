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
Measure how long a newcomer waits: from a fresh clone without an environment to the first sample.

    ./scripts/bench first_sample            # with the downloads that pip has stored
    ./scripts/bench first_sample --cold     # with all downloads

It clones this repository at HEAD into a temporary folder, runs `./scripts/run robot` there until
the first device is active, and prints the time, the processor time, the size of the environment
and the number of its distributions. Run it on a quiet machine; the processor time bears a load.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import resource
import subprocess
import tempfile
import time

ROOT = Path(__file__).resolve().parents[2]
ACTIVE = ']: active'


def first_sample(clone: Path, environment: dict[str, str]) -> float:
    """
    Run the robot of a clone until its first device is active.

    :return: the time in seconds.
    :raises SystemExit: it ended before.
    """
    began = time.monotonic()
    robot = subprocess.Popen([clone / 'scripts' / 'run', 'robot', '--simulate'], cwd=clone,
                             env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             text=True)
    assert robot.stdout is not None
    try:
        for line in robot.stdout:
            print(f'  {line.rstrip()}', flush=True)
            if ACTIVE in line:
                return time.monotonic() - began
        raise SystemExit(f'the robot ended with {robot.wait()}')
    finally:
        if robot.poll() is None:
            robot.terminate()
        robot.communicate()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0].strip())
    parser.add_argument('--cold', action='store_true', help='with an empty cache of pip')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix='first-sample-') as name:
        folder = Path(name)
        subprocess.run(['git', 'clone', '--quiet', ROOT, folder / 'clone'], check=True)
        environment = {**os.environ, 'RT_ROBOT_OS_VENV': str(folder / 'venv'),
                       'RT_ROBOT_OS_RUNTIME_DIR': str(folder / 'run')}
        (folder / 'run').mkdir(mode=0o700)
        if arguments.cold:
            environment['PIP_CACHE_DIR'] = str(folder / 'cache')
        took_s = first_sample(folder / 'clone', environment)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        size = sum(path.lstat().st_size for path in (folder / 'venv').rglob('*')
                   if not path.is_dir())
        distributions = len(list((folder / 'venv').glob('lib/python*/site-packages/*.dist-info')))
    print(f'{took_s:.0f} s to the first sample, {used.ru_utime + used.ru_stime:.0f} s of '
          f'processor time, {size / 1e6:.0f} MB, {distributions} distributions, load '
          f'{os.getloadavg()[0]:.1f}')


if __name__ == '__main__':
    main()

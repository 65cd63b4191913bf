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
Compare the compiled kernel with the pure one, in many more scenarios than the tests have time for.

    .venv/bin/python scripts/compare_builds.py [--cases 10000] [--seed 1]

Each scenario is made at random, from the seed, and run on both builds, each in a process of its
own. Everything that can be seen is compared. The first one in which they differ, or one of them
crashes or never ends, is made as small as possible and printed, with where they differ; it belongs
into ``test/kernel/differential_regressions.py`` then.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'kernel')]

from differential_builds import Builds  # noqa: E402, I100
from differential_scenario import Scenario  # noqa: E402
from differential_scenario import text_of  # noqa: E402
from differential_strategies import scenarios  # noqa: E402
from hypothesis import given  # noqa: E402
from hypothesis import HealthCheck  # noqa: E402
from hypothesis import Phase  # noqa: E402
from hypothesis import seed  # noqa: E402
from hypothesis import settings  # noqa: E402

TELL_EVERY_S = 10.0


def compare(builds: Builds, cases: int, number: int, small: bool = True
            ) -> tuple[int, Scenario | None, str]:
    """
    Compare the builds.

    :param number: the seed.
    :param small: make a scenario in which they differ as small as possible.
    :return: how many scenarios there were, the smallest that differs, and where it does.
    """
    failing: list[tuple[Scenario, str]] = []
    count, told_s = 0, time.monotonic()

    @settings(max_examples=cases, database=None, deadline=None, report_multiple_bugs=False,
              suppress_health_check=list(HealthCheck),
              phases=[Phase.generate, Phase.shrink] if small else [Phase.generate])
    @seed(number)
    @given(scenarios())
    def run(scenario: Scenario) -> None:
        nonlocal count, told_s
        count += not failing
        if time.monotonic() - told_s > TELL_EVERY_S:
            told_s = time.monotonic()
            print(f'{count} cases' + (', making a failing one smaller' if failing else ''),
                  flush=True)
        found = builds.difference(scenario)
        if found:
            failing.append((scenario, found))
        assert not found

    try:
        run()
    except AssertionError:
        return count, *failing[-1]
    return count, None, ''


def main() -> int:
    """Compare, and print what came of it."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--cases', type=int, default=10_000)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--stop-at-first', action='store_true',
                        help='do not make the scenario smaller in which they differ')
    parser.add_argument('--pure', action='store_true',
                        help='compare the pure build with itself: what these scenarios cost')
    options = parser.parse_args()
    begin_s = time.monotonic()
    with Builds(one=False, two=not options.pure) as builds:
        count, scenario, found = compare(builds, options.cases, options.seed,
                                         small=not options.stop_at_first)
    if builds.endless:
        print(f'{len(builds.endless)} did not end on either build, such as\n'
              f'{text_of(builds.endless[0])}')
    if scenario is not None:
        print(f'\n{text_of(scenario)}\n\n{found}\n\nThey differ, after {count} cases '
              f'(--seed {options.seed}).')
        return 1
    print(f'{count} cases, no difference (--seed {options.seed}, '
          f'{time.monotonic() - begin_s:.0f} s)')
    return 0


if __name__ == '__main__':
    sys.exit(main())

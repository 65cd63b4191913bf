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

"""The runner: many scenarios, each drawn from its number, in one process or in several."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any
from typing import TypeVar

_Outcome = TypeVar('_Outcome')
_CHUNK = 4
# Of a process of the pool: what runs a scenario there.
_in_pool: list[Callable[[int], Any]] = []


def run_scenarios(run: Callable[[int], _Outcome], numbers: Iterable[int], jobs: int = 1
                  ) -> Iterator[_Outcome]:
    """
    Run scenarios and yield their outcomes in the order of the numbers.

    :param run: makes the fixture of a number, runs it and checks what became of it; where there
        are several processes it must be possible to pickle it.
    :param numbers: each is the seed of one scenario.
    :param jobs: processes at a time.
    """
    if jobs < 2:
        yield from map(run, numbers)
        return
    with ProcessPoolExecutor(jobs, get_context('spawn'), _prepare, (run,)) as pool:
        yield from pool.map(_run_here, numbers, chunksize=_CHUNK)


def _prepare(run: Callable[[int], Any]) -> None:
    """Give a process of the pool what it runs."""
    _in_pool.append(run)


def _run_here(number: int) -> Any:
    return _in_pool[-1](number)

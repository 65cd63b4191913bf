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

"""The black box of a kernel that goes on: a copy is whole wherever a job comes in between."""

from __future__ import annotations

from collections.abc import Callable
import sys

from at_line import AtLine
from at_line import of_files
import pytest

from rt_robot_os.core.dumps.dump_parts import join
from rt_robot_os.core.dumps.dump_parts import live_parts
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.black_box import BlackBoxDump
from rt_robot_os.kernel.black_box import dump

RECORDS = 64
FILES = {function.__code__.co_filename for function in (live_parts, dump)}


def by_parts(kernel: Kernel) -> BlackBoxDump:
    return join(live_parts(kernel, 'test'))


def as_a_whole(kernel: Kernel) -> BlackBoxDump:
    return dump(kernel.black_box, kernel.tasks, 'test', kernel.now_ns(), kernel.start_ns)


def copied(copy: Callable[[Kernel], BlackBoxDump], step: int) -> tuple[BlackBoxDump, int]:
    """Copy a full black box while a job adds records before the n-th instruction."""
    kernel = Kernel(VirtualClock(), black_box_records=RECORDS)
    numbers = iter(range(10 ** 9))

    def add(count: int = 3) -> None:
        for _ in range(count):
            kernel.black_box.mark(next(numbers), 'job')

    add(RECORDS + 5)
    between = AtLine(step, add, of_files(*FILES), event='opcode')
    sys.settrace(between)
    try:
        found = copy(kernel)
    finally:
        sys.settrace(None)
    return found, between.seen


@pytest.mark.parametrize('copy', [by_parts, as_a_whole])
def test_a_job_at_any_instruction_spoils_no_copy(
        untraced: None, copy: Callable[[Kernel], BlackBoxDump]) -> None:
    step, seen = 1, 1
    # After the first instructions the copy is made and the rest repeats itself.
    while step <= min(seen, 400):
        found, seen = copied(copy, step)
        moments = [record[2] for record in found.records]
        assert len(moments) == RECORDS
        assert moments == list(range(moments[0], moments[0] + RECORDS))
        assert found.full
        step += 1
    assert step > 50

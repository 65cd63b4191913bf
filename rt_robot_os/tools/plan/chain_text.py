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

"""Chains of tasks in a report for people."""

from __future__ import annotations

from collections.abc import Iterator

from rt_robot_os.tools.plan.chains import ChainResult
from rt_robot_os.tools.plan.text_table import ms
from rt_robot_os.tools.plan.text_table import table
from rt_robot_os.tools.plan.text_table import wrapped


def chain_lines(chain: ChainResult) -> Iterator[str]:
    """Write a chain: its stages, and how long it takes at most."""
    rows = [(f'  {stage.task}', str(stage.priority),
             '?' if stage.response_ns is None else ms(stage.response_ns))
            for stage in chain.stages]
    yield ''
    yield from table(('  chain', 'prio', 'response\nms'), rows)
    yield from wrapped(verdict_text(chain))


def verdict_text(chain: ChainResult) -> str:
    """Say how long a chain takes at most, and whether that is too long."""
    first, last = chain.stages[0].task, chain.stages[-1].task
    what = f'chain from {first!r} to {last!r}'
    if chain.bound_ns is None:
        return f'{what}: no bound: {chain.reason}'
    text = f'{what}: at most {ms(chain.bound_ns)} ms'
    if not chain.limit_ns:
        return text
    if chain.late:
        return f'{text}, {ms(chain.bound_ns - chain.limit_ns)} ms more than the limit of ' \
            f'{ms(chain.limit_ns)} ms'
    return f'{text}, within the limit of {ms(chain.limit_ns)} ms'

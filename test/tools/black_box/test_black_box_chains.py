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

"""Which job released which: from a real kernel's dump, and from dumps that could mislead."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.kernel import BlackBoxDump
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TaskFacts
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.tools.black_box import chain_text
from rt_robot_os.tools.black_box import find_chains
from rt_robot_os.tools.black_box import History
from rt_robot_os.tools.black_box import understand
from rt_robot_os.topics import Bus

MS = 1_000_000
US = 1_000
SINK, AGENT, BASE, BUSY = range(4)
TASKS = (TaskFacts('sink/arrival', 40, 0), TaskFacts('agent', 30, 0),
         TaskFacts('base/arrival', 75, 0), TaskFacts('busy', 1, 0))


def history(*records: tuple[Any, ...]) -> History:
    return understand(BlackBoxDump('asked', 100 * MS, 0, TASKS, (), records, False))


def names(found: History, chain: Any) -> list[str]:
    return [found.tasks[job.task].name for job in chain.jobs]


def a_chain(*more: tuple[Any, ...]) -> History:
    """Tell of an alarm: the sink at 10 ms, the agent below it, the base preempts the agent."""
    return history(
        *more,
        (INTERRUPT, SINK, 10 * MS, 'fd 7'), (PUBLISH, SINK, 11 * MS, 'packets', 1),
        (JOB, SINK, 10 * MS, 10 * MS, 12 * MS, 0),
        (PUBLISH, AGENT, 14 * MS, 'cmd_vel', 1),
        (JOB, BASE, 14 * MS, 14 * MS, 15 * MS, 0),
        (JOB, AGENT, 11 * MS, 12 * MS, 20 * MS, 0),
        (JOB, BUSY, 5 * MS, 5 * MS, 30 * MS, 0))


def test_a_chain_is_followed_through_waiting_and_preempting_jobs() -> None:
    found = a_chain()
    chain, = find_chains(found, ['sink', 'base'])
    assert names(found, chain) == ['sink/arrival', 'agent', 'base/arrival']
    assert chain.length_ns == 5 * MS
    assert find_chains(found, ['sink', 'agent', 'base']) == (chain,)
    assert find_chains(found, ['agent', 'base'])[0].length_ns == 4 * MS
    assert find_chains(found, ['base', 'sink']) == ()


def test_what_bytes_or_a_timer_released_is_no_part_of_a_chain() -> None:
    # The board answers while the agent runs, which published before: that is no command.
    found = a_chain((INTERRUPT, BASE, 17 * MS, 'fd 9'), (JOB, BASE, 17 * MS, 17 * MS, 18 * MS, 0))
    assert [chain.jobs[-1].release_ns for chain in find_chains(found, ['sink', 'base'])] == [
        14 * MS]
    assert find_chains(a_chain(), ['busy', 'base']) == ()


def test_the_text_has_each_stage_and_who_was_in_the_way() -> None:
    text = chain_text(a_chain(), ['sink', 'base'])
    lines = text.splitlines()
    assert lines[0].startswith('1 chain from sink to base: 5.0 ms at least')
    assert 'the longest, -90.000 ms, 5.0 ms:' in lines
    stage = next(line for line in lines if ' agent ' in line)
    assert 'starts after  1.0 ms, behind sink/arrival 1.0 ms; ends at 10.000 ms' in stage


@pytest.mark.parametrize('given, message', [
    (['sink', 'nobody'], "there is no task 'nobody' in this dump"),
    (['base', 'sink'], "no job of 'sink' in this dump was caused by one of 'base'"),
    (['sink', 'busy', 'base'], 'through busy')])
def test_what_is_not_there_is_told(given: Sequence[str], message: str) -> None:
    with pytest.raises(BlackBoxError, match=message):
        chain_text(a_chain(), given)


def test_the_kernel_itself_tells_the_chain_of_a_sample() -> None:
    pytest.importorskip('std_msgs.msg', reason='ROS 2 messages are not installed')
    clock = VirtualClock()
    kernel = Kernel(clock)
    bus = Bus(kernel)
    for topic in ('a', 'b'):
        bus.declare(topic, 'std_msgs/msg/Float64')
    publishers = {topic: bus.publisher(topic) for topic in ('a', 'b')}

    def job(cost_us: int, topic: str = '') -> None:
        clock.spend(cost_us * US)
        if topic:
            publishers[topic].publish()
        clock.spend(cost_us * US)

    kernel.add_task('first', lambda: job(100, 'a'), priority=20, rate_hz=50.0)
    middle = kernel.add_task('middle', lambda: job(200, 'b'), priority=30)
    last = kernel.add_task('last', lambda: job(50), priority=10)
    kernel.add_task('other', lambda: job(10), priority=40, rate_hz=1000.0)
    for topic, task in (('a', middle), ('b', last)):
        bus.subscribe(topic, task.name, task=task)
    kernel.run(100 * MS)
    found = understand(kernel.black_box_dump('asked'))
    chains = find_chains(found, ['first', 'last'])
    assert len(chains) >= 4
    assert all(names(found, chain) == ['first', 'middle', 'last'] for chain in chains)
    # 200 of the first, 400 of the middle, 100 of its own, and the other's.
    assert all(700 * US <= chain.length_ns < 800 * US for chain in chains)

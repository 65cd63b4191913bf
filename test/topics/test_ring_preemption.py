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
Publish at each instruction of take(), latest() and publish(): nothing is torn, doubled or lost.

A task of higher priority, released at the chosen instruction as a timer interrupt would do it,
publishes a burst to its end, on top of whatever the reader or the other publisher was about to do.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
import sys
from types import CodeType
from types import FrameType
from typing import Any

import pytest

from rt_robot_os.base.compiled import state
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription
from rt_robot_os.topics import Topic

pytest.importorskip('geometry_msgs', reason='the ROS 2 message packages are not installed')

DEPTH = 4
TOOL = 4  # of sys.monitoring; coverage, debuggers and profilers have others
CODES = () if state().compiled else tuple(function.__code__ for function in (
    Subscription.take, Subscription.latest, Subscription.copy_large, Publisher.publish,
    Publisher.publish_cdr, Publisher.send, Publisher.commit))
pytestmark = pytest.mark.interpreted


class AtInstruction:
    """Call something at the n-th instruction of some functions that is executed."""

    def __init__(self, step: int, action: Callable[[], None]) -> None:
        self.seen = 0
        self._step = step
        self._action = action
        self._acting = False

    def reached(self) -> None:
        if self._acting:
            return
        self.seen += 1
        if self.seen == self._step:
            self._acting = True
            self._action()
            self._acting = False

    def on_instruction(self, code: CodeType, offset: int) -> None:
        self.reached()

    def on_trace(self, frame: FrameType, event: str, arg: Any) -> Any:
        if frame.f_code not in CODES:
            return None
        frame.f_trace_opcodes = True
        if event == 'opcode':
            self.reached()
        return self.on_trace


@contextmanager
def watching(watcher: AtInstruction) -> Iterator[None]:
    if sys.version_info < (3, 12):
        before = sys.gettrace()
        sys.settrace(watcher.on_trace)
        try:
            yield
        finally:
            sys.settrace(before)
        return
    monitoring = sys.monitoring
    monitoring.use_tool_id(TOOL, 'test_ring_preemption')
    try:
        monitoring.register_callback(
            TOOL, monitoring.events.INSTRUCTION, watcher.on_instruction)
        for code in CODES:
            monitoring.set_local_events(TOOL, code, monitoring.events.INSTRUCTION)
        yield
    finally:
        for code in CODES:
            monitoring.set_local_events(TOOL, code, 0)
        monitoring.free_tool_id(TOOL)


class Scene:
    """A topic; a high task that publishes a burst; a low one that reads or publishes."""

    def __init__(self, tail: bool, burst: int) -> None:
        self.kernel = Kernel(VirtualClock(start_ns=1_000_000))
        self.bus = Bus(self.kernel)
        self.tail = tail
        if tail:
            self.topic: Topic = self.bus.declare('t', 'std_msgs/msg/String', tail=64, depth=DEPTH)
        else:
            self.topic = self.bus.declare('t', 'geometry_msgs/msg/Twist', depth=DEPTH)
        self.low, self.high = self.bus.publisher('t'), self.bus.publisher('t')
        self.published: list[int] = []
        self.read: list[tuple[int, int]] = []
        self.reader = self.bus.subscribe('t', 'reader')
        self.number = 0
        self.injector = self.kernel.add_task(
            'high', lambda: [self.publish(self.high) for _ in range(burst)], priority=90)

    def publish(self, publisher: Publisher, as_cdr: bool = False) -> None:
        self.number += 1
        number = self.number
        self.published.append(number)
        if as_cdr:
            content = {'data': self.text(number)} if self.tail else {
                part: {axis: number for axis in 'xyz'} for part in ('linear', 'angular')}
            publisher.publish_cdr(self.topic.layout.from_dict(content), number)
            return
        if self.tail:
            publisher.msg.data = self.text(number)
        else:
            publisher.msg.linear = publisher.msg.angular = (number, number, number)
        publisher.publish(number)

    @staticmethod
    def text(number: int) -> str:
        return f'{number} ' * (number % 9 + 1)

    def note(self) -> None:
        """Check that what was read is one message as it was published."""
        message = self.reader.msg
        if self.tail:
            number = int(message.data.split()[0])
            assert message.data == self.text(number)
        else:
            values = {float(v) for part in (message.linear, message.angular) for v in part}
            assert len(values) == 1, f'torn: {values}'
            number = int(values.pop())
        assert self.reader.stamp_ns == number, 'the stamp is of another sample'
        self.read.append((self.reader.seq, number))

    def run(self, step: int, low_job: Callable[[], None]) -> int:
        self.kernel.add_task('low', low_job, priority=10, rate_hz=1.0)
        watcher = AtInstruction(step, lambda: self.kernel.release(self.injector))
        with watching(watcher):
            self.kernel.run(1)
        assert not self.kernel.failures, self.kernel.failures[0]
        return watcher.seen

    def check(self) -> None:
        """Compare what was published with what was read, lost and passed over."""
        while self.reader.take():
            self.note()
        assert self.topic.head == len(self.published)
        numbers = [seq for seq, _ in self.read]
        assert numbers == sorted(set(numbers)), 'doubled or out of order'
        found = self.reader.statistics()
        assert len(self.read) == found.reads
        assert found.reads + found.lost + found.skipped == len(self.published)
        assert not self.kernel.locked
        assert not self.kernel.pending


def at_each_step(scenario: Callable[[int], int]) -> int:
    step, total = 1, 1
    while step <= total:
        total = scenario(step)
        step += 1
    return total


@pytest.mark.parametrize('tail', [False, True], ids=['fixed', 'tail'])
@pytest.mark.parametrize('burst', [1, DEPTH, DEPTH + 1, 3 * DEPTH])
@pytest.mark.parametrize('read', ['take', 'latest'])
def test_a_reader_may_be_preempted_anywhere(tail: bool, burst: int, read: str) -> None:
    def scenario(step: int) -> int:
        scene = Scene(tail, burst)

        def low_job() -> None:
            while getattr(scene.reader, read)():
                scene.note()

        for _ in range(DEPTH - 1):
            scene.publish(scene.low)
        seen = scene.run(step, low_job)
        scene.check()
        if seen >= step:
            assert len(scene.published) == DEPTH - 1 + burst
        if read == 'latest':
            assert scene.read[-1][1] == scene.published[-1]
        return seen

    assert at_each_step(scenario) > 50


@pytest.mark.parametrize('tail', [False, True], ids=['fixed', 'tail'])
@pytest.mark.parametrize('as_cdr', [False, True], ids=['publish', 'publish_cdr'])
def test_a_publisher_may_be_preempted_anywhere_by_another(tail: bool, as_cdr: bool) -> None:
    def scenario(step: int) -> int:
        scene = Scene(tail, burst=1)

        def low_job() -> None:
            for _ in range(2):
                scene.publish(scene.low, as_cdr)

        seen = scene.run(step, low_job)
        scene.check()
        assert sorted(number for _, number in scene.read) == scene.published
        return seen

    assert at_each_step(scenario) > 50


def test_a_subscribed_task_reads_each_sample_although_publishers_preempt_each_other() -> None:
    def scenario(step: int) -> int:
        scene = Scene(tail=False, burst=2)

        def top_job() -> None:
            while scene.reader.take():
                scene.note()

        top = scene.kernel.add_task('top', top_job, priority=99)
        scene.bus.subscribe('t', 'top', task=top)
        seen = scene.run(step, lambda: scene.publish(scene.low))
        assert sorted(number for _, number in scene.read) == scene.published
        scene.check()
        assert top.releases == top.runs + top.coalesced
        return seen

    assert at_each_step(scenario) > 20

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

"""Whom publications release, and when: any readers against a model."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus

pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')

PUBLISHER = 10
# Priority; released by each n-th publication, 0 by each without a trigger; publishes itself.
READERS = st.lists(st.tuples(st.sampled_from([5, PUBLISHER, 50, 51]), st.integers(0, 3),
                             st.booleans()), max_size=5)
WAYS = st.lists(st.sampled_from(['publish', 'publish_cdr', 'pause']), max_size=12)


class Scene:
    """One task publishes; readers note how much has been published when they run."""

    def __init__(self, tail: int | None) -> None:
        self.kernel = Kernel(VirtualClock())
        self.bus = Bus(self.kernel)
        self.bus.declare('t', 'std_msgs/msg/String', tail=tail, depth=64)
        self.bus.declare('echo', 'std_msgs/msg/Int64')
        self.publisher = self.bus.publisher('t')
        self.echo = self.bus.publisher('echo')
        self.echoed: list[int] = []
        self.kernel.add_task('echoed', lambda: self.echoed.append(self.bus.topic('echo').head),
                             priority=90)
        self.bus.topic('echo').wake_on_publish(self.kernel.tasks[0])

    def add_reader(self, number: int, priority: int, every: int, echoes: bool) -> list[int]:
        seen: list[int] = []

        def job() -> None:
            seen.append(self.bus.topic('t').head)
            while reader.take():
                assert self.bus.topic('t').stamp_of(reader.seq) == reader.stamp_ns
            if echoes:
                before = len(self.echoed)
                self.echo.publish()
                assert len(self.echoed) == before + 1, 'a higher one runs before it returns'

        task = self.kernel.add_task(f'reader{number}', job, priority=priority)
        reader = self.bus.subscribe('t', task.name, task=None if every else task)
        if every:
            self.bus.release_every('t', task, every)
        return seen

    def run(self, ways: list[str]) -> None:
        def job() -> None:
            for way in ways:
                if way == 'pause':
                    self.kernel.clock.spend(1000)
                elif way == 'publish':
                    self.publisher.publish()
                else:
                    self.publisher.publish_cdr(bytes(self.bus.topic('t').layout.prototype))

        self.kernel.add_task('publisher', job, priority=PUBLISHER, rate_hz=1.0)
        self.kernel.run(500_000_000)


@given(readers=READERS, ways=WAYS, tail=st.sampled_from([None, 16]))
def test_each_reader_runs_as_often_and_as_early_as_it_should(
        readers: list[tuple[int, int, bool]], ways: list[str], tail: int | None) -> None:
    scene = Scene(tail)
    seen = [scene.add_reader(number, *reader) for number, reader in enumerate(readers)]
    scene.run(ways)
    total = len(ways) - ways.count('pause')
    for (priority, every, _), heads, task in zip(readers, seen, scene.kernel.tasks[1:]):
        releases = total // (every or 1)
        assert task.releases == releases
        if priority > PUBLISHER:  # before the publication returned
            assert heads == [(number + 1) * (every or 1) for number in range(releases)]
            assert task.coalesced == 0
        else:  # once, when the publisher had ended
            assert heads == ([total] if releases else [])
            assert task.coalesced == max(0, releases - 1)
    assert len(scene.echoed) == sum(len(heads) for (_, _, echoes), heads in zip(readers, seen)
                                    if echoes)
    assert not scene.kernel.failures
    assert not scene.kernel.locked

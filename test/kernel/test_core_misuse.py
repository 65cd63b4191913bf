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


"""What only a faulty program does to the types of the C core ends with an error, no crash."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rt_robot_os.base.compiled import NATIVE
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus

pytestmark = pytest.mark.skipif(NATIVE is None, reason='there is no C core in this build')
pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')


@pytest.fixture
def bus(kernel: Kernel) -> Bus:
    made = Bus(kernel)
    made.declare('fixed', 'std_msgs/msg/Int64', depth=2)
    made.declare('tail', 'std_msgs/msg/String', tail=8, depth=2)
    return made


def unmade(kind: str) -> Any:
    """Give an object whose __init__ did not run."""
    owner = getattr(NATIVE, kind)
    return owner.__new__(owner)


UNMADE: dict[str, Callable[[], Any]] = {
    'release': lambda: unmade('KernelCore').release(Task),
    'begin_timers': lambda: unmade('KernelCore').begin_timers(),
    'schedule': lambda: unmade('KernelCore').schedule(1, print, 200),
    'length_of': lambda: unmade('TopicCore').length_of(0),
    'publish': lambda: unmade('PublisherCore').publish(),
    'send': lambda: unmade('PublisherCore').send(b''),
    'commit': lambda: unmade('PublisherCore').commit(1, 0, 0),
    'take': lambda: unmade('SubscriptionCore').take(),
    'latest': lambda: unmade('SubscriptionCore').latest(),
    'skip': lambda: unmade('SubscriptionCore').skip(),
    'unread': lambda: unmade('SubscriptionCore').unread,
}


@pytest.mark.parametrize('name', UNMADE)
def test_an_object_that_was_never_made(name: str) -> None:
    with pytest.raises((AttributeError, TypeError, IndexError)):
        UNMADE[name]()


WRONG: dict[str, Callable[[Kernel, Bus], Any]] = {
    'level': lambda kernel, bus: kernel.schedule(1, print, 200),
    'negative level': lambda kernel, bus: kernel.release_due(-1, 1),
    'cancelled level': lambda kernel, bus: kernel.cancel(1, 103),
    'no time': lambda kernel, bus: kernel.collect_due('now'),
    'no task': lambda kernel, bus: kernel.arrive('task', 1),
    'no task to add': lambda kernel, bus: kernel.add_timer(None, 1, 1),
    'no task to withdraw': lambda kernel, bus: kernel.withdraw(None),
    'current': lambda kernel, bus: setattr(kernel, 'current', 'task'),
    'no level': lambda kernel, bus: kernel.ready_above('high'),
    'histogram': lambda kernel, bus: kernel.tasks[0].counts(3),
    'priority': lambda kernel, bus: setattr(kernel.tasks[0], 'priority', 500),
    'record': lambda kernel, bus: kernel.black_box.add([1]),
    'latest': lambda kernel, bus: kernel.black_box.latest('all'),
    'stamp': lambda kernel, bus: bus.publisher('fixed').publish('now'),
    'two stamps': lambda kernel, bus: bus.publisher('fixed').publish(1, 2),
    'keyword': lambda kernel, bus: bus.publisher('fixed').publish(stamp=1),
    'no data': lambda kernel, bus: bus.publisher('fixed').send(),
    'data': lambda kernel, bus: bus.publisher('fixed').send(b'123'),
    'long data': lambda kernel, bus: bus.publisher('tail').send(bytes(500)),
    'text as data': lambda kernel, bus: bus.publisher('tail').send('text'),
    'length': lambda kernel, bus: bus.publisher('tail').commit(500, 0, 0),
    'buffer': lambda kernel, bus: setattr(bus.publisher('tail'), 'buffer', 5),
    'no buffer': lambda kernel, bus: delattr(bus.subscribe('tail', 'me'), 'buffer'),
    'short buffer': lambda kernel, bus: bus.subscribe(
        'fixed', 'me', buffer=memoryview(bytearray(3)), initial=True).take(),
    'storage': lambda kernel, bus: NATIVE.TopicCore(
        kernel, 'x', bus.topic('fixed').layout, [1, 2], bytearray(4)),
    'depth': lambda kernel, bus: NATIVE.TopicCore(
        kernel, 'x', bus.topic('fixed').layout, [1, 2, 3], bytearray(400)),
    'made again': lambda kernel, bus: bus.topic('fixed').__init__(  # type: ignore[misc]
        kernel, 'fixed', bus.topic('fixed').layout),
    'clock': lambda kernel, bus: NATIVE.KernelCore(None, kernel.black_box),
    'black box': lambda kernel, bus: NATIVE.KernelCore(VirtualClock(), None),
}


@pytest.mark.parametrize('name', WRONG)
def test_a_wrong_argument(name: str, kernel: Kernel, bus: Bus) -> None:
    kernel.add_task('task', lambda: None, priority=1)
    bus.publisher('fixed').publish()
    with pytest.raises((AttributeError, TypeError, ValueError, IndexError, OverflowError)):
        WRONG[name](kernel, bus)
    assert not kernel.locked

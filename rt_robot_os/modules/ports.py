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

"""The ends of topics that a module declares at class level."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final
from typing import overload
from typing import TYPE_CHECKING

from rt_robot_os.errors import TopicError
from rt_robot_os.kernel import Task
from rt_robot_os.schema import TopicRead
from rt_robot_os.schema import TopicSpec
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

if TYPE_CHECKING:
    from rt_robot_os.modules.base import Module

WAKE_ON_ALL: Final = 'all'


@dataclass(frozen=True)
class Input(TopicRead):
    """
    A topic that a module reads; in an instance the attribute is a :class:`Subscription`.

    Its name is the default of the setting ``<attribute>_topic``.
    """

    def __post_init__(self) -> None:
        number = isinstance(self.wake, int) and self.wake >= 0
        if not number and self.wake != WAKE_ON_ALL:
            raise TopicError(f'input {self.topic!r}: wake {self.wake!r} must be True, False, a '
                             f"number of publications, or 'all'")

    @overload
    def __get__(self, instance: None, owner: type) -> Input: ...

    @overload
    def __get__(self, instance: Module, owner: type) -> Subscription: ...

    def __get__(self, instance: Module | None, owner: type) -> Input | Subscription:
        if instance is None:
            return self
        raise TopicError(f'module {instance.name!r}: the input {self.topic!r} can be used from '
                         'configure() on, not in __init__')


@dataclass(frozen=True)
class Output(TopicSpec):
    """
    A topic that a module writes; in an instance the attribute is a :class:`Publisher`.

    Its name is the default of the setting ``<attribute>_topic``; ``rate_hz`` 0 is the module's.
    """

    @overload
    def __get__(self, instance: None, owner: type) -> Output: ...

    @overload
    def __get__(self, instance: Module, owner: type) -> Publisher: ...

    def __get__(self, instance: Module | None, owner: type) -> Output | Publisher:
        if instance is None:
            return self
        raise TopicError(f'module {instance.name!r}: the output {self.topic!r} can be used from '
                         'configure() on, not in __init__')


def connect(bus: Bus, task: Task, ports: Mapping[str, tuple[Input | Output, str]]
            ) -> dict[str, Publisher | Subscription]:
    """
    Connect the ports of a module.

    :param ports: by attribute: the port, and the name of its topic as it is set.
    :raises TopicError: an input's topic is declared by nobody, or of another type.
    """
    found: dict[str, Publisher | Subscription] = {}
    together: list[str] = []
    for attribute, (port, topic) in ports.items():
        if isinstance(port, Output):
            found[attribute] = bus.publisher(topic, task)
            continue
        found[attribute] = _subscribe(bus, task, port, topic)
        if port.wake == WAKE_ON_ALL:
            together.append(topic)
        elif port.wake > 1:  # type: ignore[operator]  # a number, as Input checked
            bus.release_every(topic, task, int(port.wake))
    if together:
        bus.release_on_all(together, task)
    return found


def _subscribe(bus: Bus, task: Task, port: Input, topic: str) -> Subscription:
    given = bus.topic(topic).layout.type_name
    if port.message and given != port.message:
        raise TopicError(f'module {task.name!r}: its input {topic!r} must be a {port.message}, '
                         f'but that topic is a {given}; set another topic')
    wake = task if port.wake is True or port.wake == 1 else None
    if task.logical is None:
        return bus.subscribe(topic, task.name, initial=port.initial, newest=port.newest, task=wake)
    subscription = bus.subscribe_logically(topic, task, initial=port.initial)
    if wake is not None:
        raise TopicError(f'module {task.name!r}: with logical execution time its rate releases '
                         f'it, not its input {topic!r}; take one of the two out')
    return subscription

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
Ports: the topics that a device or a module reads and writes, declared at class level.

They are part of the topics, below devices and modules, because they involve only topics, the
settings with their names, and the task that they release.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import replace
from types import MappingProxyType
from typing import ClassVar
from typing import Final
from typing import overload
from typing import TypeVar

from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.live_settings import LiveSettings
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicRead
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.kernel import Task
from rt_robot_os.topics.bus import Bus
from rt_robot_os.topics.publisher import Publisher
from rt_robot_os.topics.subscription import Subscription

WAKE_ON_ALL: Final = 'all'
PortT = TypeVar('PortT', 'Input', 'Output')


@dataclass(frozen=True)
class Input(TopicRead):
    """
    A subscribed topic; in an instance the attribute is a :class:`Subscription`.

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
    def __get__(self, instance: PortOwner, owner: type) -> Subscription: ...

    def __get__(self, instance: PortOwner | None, owner: type) -> Input | Subscription:
        if instance is None:
            return self
        raise instance._not_connected(f'input {self.topic!r}')


@dataclass(frozen=True)
class Output(TopicSpec):
    """
    A published topic; in an instance the attribute is a :class:`Publisher`.

    Its name is the default of the setting ``<attribute>_topic``. With ``rate_hz`` 0 it is expected
    at the rate of the module, or at the ``output_rate_hz`` of the device if it has that setting.

    :ivar follows: attribute of an input of the module: one sample is published for each of the
        input, so its rate limits the expected rate, whatever the rate of the module.
    """

    follows: str = ''

    @overload
    def __get__(self, instance: None, owner: type) -> Output: ...

    @overload
    def __get__(self, instance: PortOwner, owner: type) -> Publisher: ...

    def __get__(self, instance: PortOwner | None, owner: type) -> Output | Publisher:
        if instance is None:
            return self
        raise instance._not_connected(f'output {self.topic!r}')


class PortOwner(LiveSettings):
    """
    The owner of ports: a device or a module.

    :cvar NOUN: which of the two, for messages.
    :cvar CONNECTED_FROM: the first of its methods in which its ports can be used.
    :ivar listed: the subscriptions of :meth:`listed_inputs`.
    """

    NOUN: ClassVar[str]
    CONNECTED_FROM: ClassVar[str]
    listed: Mapping[str, Subscription] = MappingProxyType({})

    @classmethod
    def ports(cls) -> dict[str, Input | Output]:
        """Return the inputs and outputs by attribute, those of base classes first."""
        found: dict[str, Input | Output] = {}
        for owner in reversed(cls.__mro__):
            for attribute, value in vars(owner).items():
                if isinstance(value, Input | Output):
                    found[attribute] = value
                else:
                    found.pop(attribute, None)  # removed by a subclass
        return found

    @classmethod
    def fields(cls) -> tuple[Field, ...]:
        """
        Return all settings: SETTINGS and a topic name for each port.

        A class with that key in its SETTINGS defines its description and default there.
        """
        given = {field.name for field in cls.SETTINGS}
        names = tuple(
            Field(f'{attribute}_topic', str, port.topic,
                  f'topic that {"is read" if isinstance(port, Input) else "is written"} '
                  f'as {attribute}')
            for attribute, port in cls.ports().items() if f'{attribute}_topic' not in given)
        return (*cls.SETTINGS, *names)

    def topic_of(self, attribute: str) -> str:
        """Return the configured topic of a port."""
        configured = self.settings.get(f'{attribute}_topic')
        # Also called by steps: searching all ports would take 0.1 ms.
        return str(self.ports()[attribute].topic if configured is None else configured)

    def connected(self, attribute: str) -> bool:
        """Return whether the settings use a port; an unused one is not connected."""
        return True

    def listed_inputs(self) -> Mapping[str, Input]:
        """
        Return the inputs that the settings list, by key.

        They are subscribed like those of the class and available in :attr:`listed` by that key;
        with ``wake`` a publication releases the task.
        """
        return {}

    def output_rate_hz(self) -> float:
        """Return the rate of outputs without a ``rate_hz``; 0 when unknown."""
        return 0.0

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the published topics: one for each used output."""
        return tuple(
            TopicSpec(self.topic_of(attribute), port.message, port.fixed, port.depth,
                      port.rate_hz or self.output_rate_hz(), port.tail, port.most_hz)
            for attribute, port in self.used(Output).items())

    def reads(self) -> tuple[TopicRead, ...]:
        """Return the subscribed topics: each used input with its configured topic."""
        return (*(replace(port, topic=self.topic_of(attribute))
                  for attribute, port in self.used(Input).items()),
                *self.listed_inputs().values())

    def subscriptions(self) -> tuple[str, ...]:
        """Return the names of the subscribed topics."""
        return tuple(each.topic for each in self.reads())

    def used(self, kind: type[PortT]) -> dict[str, PortT]:
        """Return the used ports of a kind, by attribute."""
        return {attribute: port for attribute, port in self.ports().items()
                if isinstance(port, kind) and self.connected(attribute)}

    def connect(self, bus: Bus, task: Task, released: Task | None = None) -> None:
        """
        Connect the ports that are not connected yet; every topic must have been declared.

        :param task: of the owner.
        :param released: the task that inputs release; by default the same.
        :raises TopicError: an input's topic is not declared, or of another type.
        """
        self.__dict__.update(connect(self, bus, task, released or task, {
            attribute: port for attribute, port in self.ports().items()
            if self.connected(attribute) and attribute not in self.__dict__}))
        if not self.listed:
            self.listed = {
                key: _subscribe(self, bus, task, released or task, port, port.topic)
                for key, port in self.listed_inputs().items()}

    def _not_connected(self, port: str) -> TopicError:
        return TopicError(f'{self.NOUN} {self.name!r}: the {port} can be used from '
                          f'{self.CONNECTED_FROM} on, not in __init__')


def connect(owner: PortOwner, bus: Bus, task: Task, released: Task,
            ports: Mapping[str, Input | Output]) -> dict[str, Publisher | Subscription]:
    """
    Connect ports of a device or a module.

    :param released: the task that inputs release.
    :raises TopicError: an input's topic is not declared, or of another type.
    """
    found: dict[str, Publisher | Subscription] = {}
    together: list[str] = []
    for attribute, port in ports.items():
        topic = owner.topic_of(attribute)
        if isinstance(port, Output):
            found[attribute] = bus.publisher(topic, task)
            continue
        found[attribute] = _subscribe(owner, bus, task, released, port, topic)
        if port.wake == WAKE_ON_ALL:
            together.append(topic)
        elif port.wake > 1:  # type: ignore[operator]  # a number, as Input checked
            bus.release_every(topic, released, int(port.wake))
    if together:
        bus.release_on_all(together, released)
    return found


def _subscribe(owner: PortOwner, bus: Bus, task: Task, released: Task, port: Input, topic: str
               ) -> Subscription:
    given = bus.topic(topic).layout.type_name
    who = f'{owner.NOUN} {owner.name!r}'
    if port.message and given != port.message:
        raise TopicError(f'{who}: its input {topic!r} must be a {port.message}, '
                         f'but that topic is a {given}; set another topic')
    wake = released if port.wake is True or port.wake == 1 else None
    if task.logical is None:
        return bus.subscribe(topic, owner.name, initial=port.initial, newest=port.newest,
                             task=wake)
    if wake is not None:
        raise TopicError(f'{who}: with logical execution time its rate releases '
                         f'it, not its input {topic!r}; remove one of the two')
    return bus.subscribe_logically(topic, task, initial=port.initial)

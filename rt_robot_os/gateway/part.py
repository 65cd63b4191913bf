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
The parts of the gateway, each with its topics of the robot and its kinds of messages.

A part declares the topics it reads and publishes, the messages of the server it receives, and its
additions to the greeting. The gateway has one object of each, made with
:class:`GatewayContext`, and calls it as written here::

    class Horn(Part):
        receives = (HonkMessage,)

        def publishes(self) -> tuple[str, ...]:
            return ('horn',)

        def receive(self, message):
            self.context.robot.publish('horn', string_message(message.how))

A class of messages such as ``HonkMessage`` stands in :mod:`rt_robot_os.messages.uplink`, and in
the table of kinds there.

Two threads call a part: the link's (``take`` of :class:`~.reading.Reads` and
:meth:`Part.met_robot`), and the network's, an asyncio loop (all others). Neither may be blocked by
    a disk or a device.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from typing import NamedTuple
from typing import Protocol

from rt_robot_os.gateway.connection import Talk
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.robot_link import RobotLink
from rt_robot_os.gateway.settings import GatewaySettings
from rt_robot_os.link.client import TopicInfo
from rt_robot_os.messages.uplink.greeting import DriveLimits
from rt_robot_os.messages.uplink.greeting import NodePosition
from rt_robot_os.messages.uplink.importance import Importance
from rt_robot_os.messages.uplink.messages import UplinkMessage


class Record(NamedTuple):
    """
    A record that must arrive exactly once.

    :ivar type: such as ``alarm_event``.
    :ivar content: JSON.
    :ivar utc_ns: its time, by this machine's clock.
    """

    importance: Importance
    type: str  # noqa: A003
    content: Mapping[str, Any]
    utc_ns: int


@dataclass(frozen=True)
class Greeting:
    """
    The additions of a part to the first message to the server; those of all parts are joined.

    :ivar capabilities: what the robot can do.
    :ivar cameras: their names.
    :ivar map: SHA-256 of the map.
    """

    capabilities: tuple[str, ...] = ()
    cameras: tuple[str, ...] = ()
    nodes: tuple[NodePosition, ...] = ()
    map: str = ''  # noqa: A003
    limits: DriveLimits = DriveLimits()


class Sending(Protocol):
    """The interface of the connection ``/robot/state`` for parts. Thread-safe."""

    @property
    def connected(self) -> bool:
        """Whether the server has returned the greeting and responds."""

    def send(self, message: UplinkMessage) -> bool:
        """Queue a message ahead of records and signals; False when the queue is full."""

    def wake(self) -> None:
        """Wake the sender to check for new data."""

    def send_newest(self, message: UplinkMessage) -> None:
        """Queue a message, replacing a queued one of its kind."""


@dataclass(frozen=True)
class GatewayContext:
    """
    The dependencies of a part.

    :ivar robot: topics of the core.
    :ivar server: the connection for state.
    :ivar keep: stores a record, which is soon on the disk and sent to the server once. Any thread.
    :ivar connect: opens one more lasting connection: takes a path such as ``/robot/media`` and
        what talks on it, as :class:`~rt_robot_os.gateway.connection.ServerConnection` does.
    :ivar tell: reports a problem in a line of text.
    :ivar folder: of the gateway's files.
    """

    robot: RobotLink
    server: Sending
    settings: GatewaySettings
    keep: Callable[[Record], None]
    connect: Callable[[str, Talk], Any]
    tell: Callable[[str], None]
    folder: Path


class Part:
    """
    One part; see the module. A part overrides what it needs.

    :ivar receives: the classes of messages that are for it; each class is for one part.
    """

    receives: tuple[type[UplinkMessage], ...] = ()

    def __init__(self, context: GatewayContext) -> None:
        self.context = context

    def reads(self) -> Sequence[Reads]:
        """Return the topics that it reads; those that the robot lacks are passed over."""
        return ()

    def publishes(self) -> Sequence[str]:
        """Return the topics that it publishes; those that the robot lacks are passed over."""
        return ()

    def hello(self) -> Greeting:
        """Return what it adds to the greeting."""
        return Greeting()

    def met_robot(self, topics: Mapping[str, TopicInfo]) -> None:
        """Handle a connection to a core, perhaps a new one, with these topics. Link's thread."""

    def met_server(self) -> None:
        """Handle the server's greeting."""

    def lost_server(self) -> None:
        """Handle the loss of the connection."""

    def receive(self, message: UplinkMessage) -> None:
        """
        Receive a message of one of its classes.

        :raises ValueError: it is not valid now; this is only counted and reported.
        """

    def reject(self, kind: str) -> None:
        """Note that a message of one of its kinds was malformed; it is counted and reported."""

    async def run(self) -> None:
        """Work until cancelled."""

    def statistics(self) -> Mapping[str, Any]:
        """Return its counters. Any thread."""
        return {}

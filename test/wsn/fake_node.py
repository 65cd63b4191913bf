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

"""A node without a radio: what a protocol sends is kept, and its timers run on a clock by hand."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any
from typing import NamedTuple

from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Received


class Sent(NamedTuple):
    """A frame that a protocol gave to the radio."""

    destination: int
    am_type: int
    payload: bytes
    acknowledge: bool


class Delivered(NamedTuple):
    """A packet that reached the sink."""

    am_type: int
    payload: bytes
    origin: int
    application: bytes


class FakeTimer:
    """A timer that runs down when the node's clock is moved."""

    def __init__(self, node: FakeNode, call: Callable[[], None]) -> None:
        self._node = node
        self._call = call
        self._period_ns = 0
        self.due_ns: int | None = None

    def start(self, delay_ns: int) -> None:
        """Run down once."""
        self._period_ns = 0
        self.due_ns = self._node.time_ns + delay_ns

    def every(self, period_ns: int) -> None:
        """Run down again and again."""
        self._period_ns = period_ns
        self.due_ns = self._node.time_ns + period_ns

    def stop(self) -> None:
        """Do not run down."""
        self.due_ns = None

    def fire(self) -> None:
        """Run down now."""
        assert self.due_ns is not None, 'the timer does not run'
        self.due_ns = self.due_ns + self._period_ns if self._period_ns else None
        self._call()


class FakeSender:
    """A place for one frame; the test says when it is through."""

    def __init__(self, done: Callable[[bool], None]) -> None:
        self._done = done
        self.busy = False
        self.frame: Sent | None = None

    def send(self, destination: int, am_type: int, payload: bytes, acknowledge: bool) -> bool:
        """Keep a frame."""
        if self.busy:
            return False
        self.busy = True
        self.frame = Sent(destination, am_type, payload, acknowledge)
        return True

    def rewrite(self, destination: int, payload: bytes) -> None:
        """Change the frame that was kept."""
        assert self.frame is not None, 'nothing was sent'
        self.frame = self.frame._replace(destination=destination, payload=payload)

    def done(self, acknowledged: bool = False) -> Sent:
        """Say that the frame is through, and return it."""
        assert self.frame is not None, 'nothing was sent'
        frame, self.frame = self.frame, None
        self.busy = False
        self._done(acknowledged)
        return frame


class FakeNode:
    """
    A node under a test.

    :ivar delivered: at the sink's serial line.
    :ivar notes: what the protocol told of, name first.
    """

    def __init__(self, address: int, seed: int = 1) -> None:
        self.address = address
        self.random = Random(seed)
        self.time_ns = 0
        self.timers: list[FakeTimer] = []
        self.senders: list[FakeSender] = []
        self.delivered: list[Delivered] = []
        self.notes: list[tuple[Any, ...]] = []

    def now_ns(self) -> int:
        """Return the time since the node started."""
        return self.time_ns

    def timer(self, call: Callable[[], None]) -> FakeTimer:
        """Make a timer."""
        self.timers.append(FakeTimer(self, call))
        return self.timers[-1]

    def sender(self, done: Callable[[bool], None]) -> FakeSender:
        """Make a sender."""
        self.senders.append(FakeSender(done))
        return self.senders[-1]

    def deliver(self, am_type: int, payload: bytes, origin: int, application: bytes) -> None:
        """Keep a packet."""
        self.delivered.append(Delivered(am_type, payload, origin, application))

    def note(self, event: str, *numbers: int) -> None:
        """Keep an event."""
        self.notes.append((event, *numbers))

    def run_until(self, time_ns: int) -> None:
        """Move the clock; timers run down in the order of their times."""
        while True:
            due = [timer for timer in self.timers
                   if timer.due_ns is not None and timer.due_ns <= time_ns]
            if not due:
                break
            timer = min(due, key=lambda one: one.due_ns or 0)
            self.time_ns = max(self.time_ns, timer.due_ns or 0)
            timer.fire()
        self.time_ns = time_ns

    def run_binary_ms(self, duration: float) -> None:
        """Move the clock by so many 1/1024 s."""
        self.run_until(self.time_ns + round(duration * BINARY_MS_NS))

    def on_air(self) -> list[Sent]:
        """Return the frames that wait at the radio."""
        return [sender.frame for sender in self.senders if sender.frame is not None]

    def through(self, acknowledged: bool = False) -> list[Sent]:
        """Send all frames that wait at the radio, and return them."""
        return [sender.done(acknowledged)
                for sender in list(self.senders) if sender.frame is not None]


def received(frame: Sent, source: int, lqi: int = 106, rssi_dbm: int = -70) -> Received:
    """Make of what a node sent what another takes from the air."""
    return Received(frame.destination, source, frame.am_type, frame.payload, lqi, rssi_dbm)


def heard_by(address: int, frame: Sent) -> bool:
    """Tell whether a node of that address takes the frame, other than to snoop."""
    return frame.destination in (address, BROADCAST)

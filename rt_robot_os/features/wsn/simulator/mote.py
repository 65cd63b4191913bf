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

"""A simulated mote: a protocol, an application, a radio, a clock that drifts, and a battery."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import NamedTuple
from typing import Protocol

from rt_robot_os.features.wsn.routing.protocol import Received
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.simulator.air import Position
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.energy import Battery
from rt_robot_os.features.wsn.simulator.events import Event
from rt_robot_os.features.wsn.simulator.events import EventQueue
from rt_robot_os.features.wsn.simulator.transceiver import FrameSender
from rt_robot_os.features.wsn.simulator.transceiver import Transceiver

_BILLION = 1_000_000_000


class MoteNetwork(Protocol):
    """
    What a mote has of its network.

    :ivar queue: of the events.
    :ivar seed: of everything that is random.
    :ivar on_note: see ``Network``.
    """

    queue: EventQueue
    seed: int
    on_note: Callable[[int, Mote, str, tuple[int, ...]], None] | None

    def source_of(self, frame: Transmission) -> int:
        """Return what a frame says of its sender."""

    def generated(self, mote: Mote, application: bytes) -> None:
        """Remember when a packet was made."""

    def delivered(self, sink: Mote, am_type: int, payload: bytes, origin: int,
                  application: bytes) -> None:
        """Count a packet that the sink delivers."""


class MoteTimer:
    """A timer of a mote, on the mote's clock; see ``Timer`` of the protocols."""

    __slots__ = ('_mote', '_call', '_event', '_begun_ns', '_period_ns', '_rounds')

    def __init__(self, mote: Mote, call: Callable[[], None]) -> None:
        """Make a timer that does not run."""
        self._mote = mote
        self._call = call
        self._event = Event(call)
        self._begun_ns = 0
        self._period_ns = 0
        self._rounds = 0

    def start(self, delay_ns: int) -> None:
        """Run down once from now on."""
        mote = self._mote
        if not mote.is_on:
            return
        queue = mote.queue
        self._event.call = self._call
        queue.at(queue.now_ns + max(0, mote.true_ns(delay_ns)),
                 self._event)

    def every(self, period_ns: int) -> None:
        """
        Run down again and again.

        :raises ValueError: for a period that is not positive.
        """
        if period_ns <= 0:
            raise ValueError(f'a period of {period_ns} ns: it has to be positive')
        if not self._mote.is_on:
            return
        self._begun_ns = self._mote.queue.now_ns
        self._period_ns = period_ns
        self._rounds = 0
        self._event.call = self._again
        self._plan_next()

    def _plan_next(self) -> None:
        self._rounds += 1
        local_ns = self._rounds * self._period_ns
        mote = self._mote
        mote.queue.at(self._begun_ns + mote.true_ns(local_ns),
                      self._event)

    def _again(self) -> None:
        self._plan_next()
        self._call()

    def stop(self) -> None:
        """Do not run down."""
        self._mote.queue.cancel(self._event)


class Traffic(NamedTuple):
    """
    What the application on a mote sends.

    :ivar period_ns: between packets, on the mote's clock.
    :ivar build: makes the bytes of a packet from the mote and the packet's number, 0 and up; no
        two packets of a mote may be the same, else they are not told apart.
    :ivar first_ns: from the start of the mote to its first packet; None: random in a period.
    :ivar jitter_ns: each packet is late by a random time up to this.
    """

    period_ns: int
    build: Callable[[Mote, int], bytes]
    first_ns: int | None = None
    jitter_ns: int = 0


class Mote:
    """
    A simulated mote; to its protocol it is the ``Node``.

    :ivar address: of 16 bits.
    :ivar number: unique in the simulation; the address where there is one network.
    :ivar random: for delays of the protocol.
    :ivar is_root: it is the sink.
    :ivar position: x, y and height in m.
    :ivar router: its protocol.
    :ivar radio: its radio.
    :ivar is_on: it has power and is awake.
    :ivar drift_ppb: its clock is fast by so many in a billion.
    :ivar battery: None for one that never empties.
    :ivar generated: packets of its application.
    :ivar refused: of these, packets that the protocol had no room for.
    :ivar delivered: of these, packets that the sink got.
    :ivar boots: how often it has started.
    :ivar is_removed: it was taken out of the network for good.
    """

    __slots__ = (
        'address', 'number', 'random', 'is_root', 'position', 'router', 'radio', 'is_on',
        'drift_ppb', 'battery', 'generated', 'refused', 'delivered', 'boots', 'is_removed',
        'queue', '_network', '_timers', '_booted_ns', '_traffic', '_first_timer', '_period_timer',
        '_late_timer')

    def __init__(self, network: MoteNetwork, address: int, is_root: bool,
                 position: Position, drift_ppb: int, number: int) -> None:
        """Make a mote that is off; ``Network.add`` does so."""
        self.address = address
        self.number = number
        self.random = Random(f'{network.seed} node {number}')
        self.is_root = is_root
        self.position = position
        self.is_on = False
        self.drift_ppb = drift_ppb
        self.battery: Battery | None = None
        self.generated = 0
        self.refused = 0
        self.delivered = 0
        self.boots = 0
        self.is_removed = False
        self.queue: EventQueue = network.queue
        self.router: Router
        self.radio: Transceiver
        self._network = network
        self._timers: list[MoteTimer] = []
        self._booted_ns = 0
        self._traffic: Traffic | None = None
        self._first_timer = self.timer(self._first_due)
        self._period_timer = self.timer(self._due)
        self._late_timer = self.timer(self._generate)

    # What the protocol has of it.

    def now_ns(self) -> int:
        """Return the time since the mote started, on its own clock."""
        since = self.queue.now_ns - self._booted_ns
        return since + since * self.drift_ppb // _BILLION

    def true_ns(self, local_ns: int) -> int:
        """Return how long a time on the mote's clock really is."""
        return local_ns - local_ns * self.drift_ppb // (_BILLION + self.drift_ppb)

    def timer(self, call: Callable[[], None]) -> MoteTimer:
        """Make a timer that calls when it has run down."""
        timer = MoteTimer(self, call)
        self._timers.append(timer)
        return timer

    def sender(self, done: Callable[[bool], None]) -> FrameSender:
        """Make a sender; ``done`` is called when its frame is through."""
        return FrameSender(self.radio, done)

    def deliver(self, am_type: int, payload: bytes, origin: int, application: bytes) -> None:
        """Hand a data packet to the sink's serial line."""
        self._network.delivered(self, am_type, payload, origin, application)

    def note(self, event: str, *numbers: int) -> None:
        """Tell of something for logs and pictures."""
        on_note = self._network.on_note
        if on_note is not None:
            on_note(self.queue.now_ns, self, event, numbers)

    # What the radio tells it.

    def received(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Take a frame for this node or for all."""
        self.router.receive(Received(
            frame.destination, self._network.source_of(frame), frame.am_type, frame.payload, lqi,
            rssi_dbm))

    def overheard(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Take a frame for another node."""
        self.router.snoop(Received(
            frame.destination, self._network.source_of(frame), frame.am_type, frame.payload, lqi,
            rssi_dbm))

    # What a scenario does with it.

    def boot(self) -> None:
        """Start, with nothing known; one that runs starts anew."""
        if self.is_on:
            self.kill()
        if self.is_removed or (self.battery is not None and self.battery.is_empty):
            return
        self._booted_ns = self.queue.now_ns
        self.boots += 1
        self.is_on = True
        self.radio.switch_on()
        if self.battery is not None:
            self.battery.switch_on(self.queue.now_ns)
        self.router.start()
        self._start_traffic()
        self.note('boot', self.boots)

    def kill(self) -> None:
        """Take away the power; ``boot`` gives it back."""
        if not self.is_on:
            return
        self.router.stop()
        for timer in self._timers:
            timer.stop()
        self.radio.switch_off()
        self.is_on = False
        if self.battery is not None:
            self.battery.switch_off(self.queue.now_ns, self.radio)
        self.note('off')

    def originate(self, application: bytes) -> bool:
        """
        Give the protocol a packet for the sink.

        :return: False when the mote is off or the protocol has no room.
        """
        if not self.is_on:
            return False
        self.generated += 1
        self._network.generated(self, application)
        if self.router.originate(application):
            return True
        self.refused += 1
        return False

    @property
    def traffic(self) -> Traffic | None:
        """Return what the application sends; it can be set at any time."""
        return self._traffic

    @traffic.setter
    def traffic(self, traffic: Traffic | None) -> None:
        self._traffic = traffic
        for timer in (self._first_timer, self._period_timer, self._late_timer):
            timer.stop()
        if self.is_on:
            self._start_traffic()

    def _start_traffic(self) -> None:
        traffic = self._traffic
        if traffic is None:
            return
        first_ns = traffic.first_ns
        if first_ns is None:
            first_ns = int(self.random.random() * traffic.period_ns)
        self._first_timer.start(first_ns)

    def _first_due(self) -> None:
        """Send the first packet, and the others from now on."""
        assert self._traffic is not None
        self._period_timer.every(self._traffic.period_ns)
        self._due()

    def _due(self) -> None:
        """Send a packet, late where that is wanted."""
        assert self._traffic is not None
        if self._traffic.jitter_ns:
            self._late_timer.start(int(self.random.random() * self._traffic.jitter_ns))
        else:
            self._generate()

    def _generate(self) -> None:
        traffic = self._traffic
        assert traffic is not None
        self.originate(traffic.build(self, self.generated))

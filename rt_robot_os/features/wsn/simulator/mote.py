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
    The interface of a network to its motes.

    :ivar queue: event queue.
    :ivar seed: seed of all random numbers.
    :ivar on_note: see ``Network``.
    """

    queue: EventQueue
    seed: int
    on_note: Callable[[int, Mote, str, tuple[int, ...]], None] | None

    def source_of(self, frame: Transmission) -> int:
        """Return the sender address in a frame."""

    def generated(self, mote: Mote, application: bytes) -> None:
        """Store the creation time of a packet."""

    def delivered(self, sink: Mote, am_type: int, payload: bytes, origin: int,
                  application: bytes) -> None:
        """Count a packet that the sink delivers."""


class MoteTimer:
    """A timer of a mote, on the mote's clock; see ``Timer`` of the protocols."""

    __slots__ = ('_mote', '_call', '_event', '_begun_ns', '_period_ns', '_rounds')

    def __init__(self, mote: Mote, call: Callable[[], None]) -> None:
        """Create a stopped timer."""
        self._mote = mote
        self._call = call
        self._event = Event(call)
        self._begun_ns = 0
        self._period_ns = 0
        self._rounds = 0

    def start(self, delay_ns: int) -> None:
        """Start the timer for one call."""
        mote = self._mote
        if not mote.is_on:
            return
        queue = mote.queue
        self._event.call = self._call
        queue.at(queue.now_ns + max(0, mote.true_ns(delay_ns)),
                 self._event)

    def every(self, period_ns: int) -> None:
        """
        Start the timer for periodic calls.

        :raises ValueError: the period is not positive.
        """
        if period_ns <= 0:
            raise ValueError(f'a period of {period_ns} ns: must be positive')
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
        """Stop the timer."""
        self._mote.queue.cancel(self._event)


class Traffic(NamedTuple):
    """
    The packets of the application on a mote.

    :ivar period_ns: between packets, on the mote's clock.
    :ivar build: returns the bytes of a packet for the mote and the packet's number from 0; all
        packets of a mote must differ.
    :ivar first_ns: from the start of the mote to its first packet; None: random in a period.
    :ivar jitter_ns: largest random delay of a packet.
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
    :ivar random: random numbers for delays of the protocol.
    :ivar is_root: it is the sink.
    :ivar position: x, y and height in m.
    :ivar router: its routing protocol.
    :ivar radio: its radio.
    :ivar is_on: it has power and is awake.
    :ivar drift_ppb: relative error of its clock in 1e-9; positive for fast.
    :ivar battery: None for one that never discharges.
    :ivar generated: packets of its application.
    :ivar refused: of these, packets that did not fit into the queue of the protocol.
    :ivar delivered: of these, packets that the sink received.
    :ivar boots: number of boots.
    :ivar is_removed: it was removed from the network.
    """

    __slots__ = (
        'address', 'number', 'random', 'is_root', 'position', 'router', 'radio', 'is_on',
        'drift_ppb', 'battery', 'generated', 'refused', 'delivered', 'boots', 'is_removed',
        'queue', '_network', '_timers', '_booted_ns', '_traffic', '_first_timer', '_period_timer',
        '_late_timer')

    def __init__(self, network: MoteNetwork, address: int, is_root: bool,
                 position: Position, drift_ppb: int, number: int) -> None:
        """Create a mote that is off; called by ``Network.add``."""
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

    # Interface to the protocol.

    def now_ns(self) -> int:
        """Return the time since the mote started, on its own clock."""
        since = self.queue.now_ns - self._booted_ns
        return since + since * self.drift_ppb // _BILLION

    def true_ns(self, local_ns: int) -> int:
        """Return the true length of a time on the mote's clock."""
        return local_ns - local_ns * self.drift_ppb // (_BILLION + self.drift_ppb)

    def timer(self, call: Callable[[], None]) -> MoteTimer:
        """Create a timer with its callback."""
        timer = MoteTimer(self, call)
        self._timers.append(timer)
        return timer

    def sender(self, done: Callable[[bool], None]) -> FrameSender:
        """Create a sender; ``done`` is called when its transmission has ended."""
        return FrameSender(self.radio, done)

    def deliver(self, am_type: int, payload: bytes, origin: int, application: bytes) -> None:
        """Pass a data packet to the sink's serial line."""
        self._network.delivered(self, am_type, payload, origin, application)

    def note(self, event: str, *numbers: int) -> None:
        """Report an event for logs and figures."""
        on_note = self._network.on_note
        if on_note is not None:
            on_note(self.queue.now_ns, self, event, numbers)

    # Interface to the radio.

    def received(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Receive a frame for this node, or a broadcast."""
        self.router.receive(Received(
            frame.destination, self._network.source_of(frame), frame.am_type, frame.payload, lqi,
            rssi_dbm))

    def overheard(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Receive a frame for another node."""
        self.router.snoop(Received(
            frame.destination, self._network.source_of(frame), frame.am_type, frame.payload, lqi,
            rssi_dbm))

    # Interface to the scenario.

    def boot(self) -> None:
        """Boot, or reboot, with an empty state."""
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
        """Switch off the power; ``boot`` switches it on."""
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
        Send a packet to the sink.

        :return: False when the mote is off or the queue of the protocol is full.
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
        """Return the traffic of the application; it can be set at any time."""
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
        """Send the first packet, and start the period."""
        assert self._traffic is not None
        self._period_timer.every(self._traffic.period_ns)
        self._due()

    def _due(self) -> None:
        """Send a packet after its random delay."""
        assert self._traffic is not None
        if self._traffic.jitter_ns:
            self._late_timer.start(int(self.random.random() * self._traffic.jitter_ns))
        else:
            self._generate()

    def _generate(self) -> None:
        traffic = self._traffic
        assert traffic is not None
        self.originate(traffic.build(self, self.generated))

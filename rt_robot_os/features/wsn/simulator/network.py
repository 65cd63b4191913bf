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

"""A network of simulated motes."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Final

from rt_robot_os.features.wsn.radio.mac import MacProfile
from rt_robot_os.features.wsn.radio.mac import TINYOS2
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.simulator.air import Position
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.energy import Battery
from rt_robot_os.features.wsn.simulator.energy import PowerModel
from rt_robot_os.features.wsn.simulator.events import Event
from rt_robot_os.features.wsn.simulator.events import EventQueue
from rt_robot_os.features.wsn.simulator.medium import Medium
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.mote import Traffic
from rt_robot_os.features.wsn.simulator.transceiver import Transceiver

#: Makes the protocol of a node: the node, and whether it is the root.
RouterFactory = Callable[[Node, bool], Router]

#: Number of packets on their way whose creation time is stored.
_OUTSTANDING: Final = 200_000
_NS_PER_S: Final = 1_000_000_000
_DRIFT_PPM: Final = 20.0


class Network:
    """
    Motes that run a protocol over a medium.

    :ivar queue: event queue; ``queue.now_ns`` is the time.
    :ivar medium: radio medium.
    :ivar mac: profile of the medium access.
    :ivar seed: seed of all random numbers.
    :ivar motes: by number, which is the address where there is one network; of two with
        the same number the last.
    :ivar duplicates: packets that the sink delivered again.
    :ivar latencies_ns: from origin to sink, of each packet delivered.
    :ivar on_deliver: called with each packet that the sink delivers, including duplicates:
        ``on_deliver(mote, am_type, payload, origin, application)``.
    :ivar on_note: called with each event of the protocols:
        ``on_note(now_ns, mote, event, numbers)``.
    """

    def __init__(self, medium: Medium, protocol: RouterFactory, *, mac: MacProfile = TINYOS2,
                 seed: int = 1, drift_ppm: float = _DRIFT_PPM,
                 power: PowerModel | None = None) -> None:
        """
        Create a network without motes.

        :param protocol: factory of the protocol of a mote.
        :param drift_ppm: standard deviation of the drift of the motes' clocks.
        :param power: power model of the motes; None: batteries never discharge.
        """
        self.queue = EventQueue()
        self.medium = medium
        self.mac = mac
        self.seed = seed
        self.motes: dict[int, Mote] = {}
        self.duplicates = 0
        self.latencies_ns: list[int] = []
        self.on_deliver: Callable[[Mote, int, bytes, int, bytes], None] | None = None
        self.on_note: Callable[[int, Mote, str, tuple[int, ...]], None] | None = None
        self._protocol = protocol
        self._power = power
        self._random = Random(f'{seed} network')
        self._drift_ppm = drift_ppm
        self._numbers: dict[tuple[int, int], int] = {}
        self._acks_awaited: list[list[Transceiver]] = [[] for _ in range(256)]
        self._outstanding: dict[tuple[int, bytes], int] = {}
        self._account = Event(self._account_batteries)
        medium.seed(seed)

    def add(self, address: int, position: Position = (0.0, 0.0, 0.0), *,
            is_root: bool = False, power_dbm: float = 0.0, boot_ns: int = 0,
            traffic: Traffic | None = None, used_mah: float = 0.0, pan: int = 0,
            number: int | None = None) -> Mote:
        """
        Add a mote.

        :param position: x, y and height in m.
        :param boot_ns: time of its boot.
        :param used_mah: charge already used of its battery.
        :param pan: which of several networks in the same area it belongs to.
        :param number: unique among all of them; None: the address.
        :raises ValueError: the address is not valid for a mote.
        """
        if not 0 <= address < 0xFFFF:
            raise ValueError(f'mote {address}: the address must be from 0 to 65534')
        drift = int(self._random.gauss(0, self._drift_ppm) * 1000) if self._drift_ppm else 0
        number = address if number is None else number
        mote = Mote(self, address, is_root, position, drift, number)
        mote.radio = Transceiver(address, power_dbm, self.queue, self.medium, self.mac, mote,
                                 self._acks_awaited)
        mote.radio.pan, mote.radio.number = pan, number
        self._numbers[pan, address] = number
        if self._power is not None:
            mote.battery = Battery(self._power, used_mah)
            if not self._account.number:
                self._plan_account()
        mote.router = self._protocol(mote, is_root)
        mote.traffic = traffic
        self.motes[number] = mote
        self.medium.attach(mote.radio, position)
        if type(mote.router).snoop is not Router.snoop:
            self.medium.snooped = self._snooped
        self.at(max(boot_ns, self.queue.now_ns), mote.boot)
        return mote

    def _snooped(self, frame: Transmission) -> bool:
        """Return whether the protocol snoops a frame for another node."""
        mote = self.motes.get(frame.sender.number)
        return mote is None or mote.router.snoops(frame.am_type, frame.payload)

    def number_of(self, address: int, mote: Mote) -> int:
        """Return the number of the node that a mote knows by an address, or the address itself."""
        return self._numbers.get((mote.radio.pan, address), address)

    def remove(self, number: int) -> None:
        """
        Remove a mote.

        :raises KeyError: there is no such mote.
        """
        mote = self.motes.pop(number)
        mote.kill()
        mote.is_removed = True
        self.medium.detach(mote.radio)

    def move(self, number: int, position: Position) -> None:
        """Move a mote."""
        mote = self.motes[number]
        mote.position = position
        self.medium.moved(mote.radio, position)

    def at(self, time_ns: int, call: Callable[[], None]) -> Event:
        """Schedule a call, such as a fault; the event may be cancelled at ``queue``."""
        event = Event(call)
        self.queue.at(time_ns, event)
        return event

    def run_until(self, time_ns: int) -> None:
        """Run all events up to a time, inclusive."""
        self.queue.run_until(time_ns)

    def source_of(self, frame: Transmission) -> int:
        """Return the sender address in a frame; -1 in TinyOS 1.x, which has none."""
        return frame.sender.address if self.mac.version > 1 else -1

    def generated(self, mote: Mote, application: bytes) -> None:
        """Store the creation time of a packet."""
        outstanding = self._outstanding
        outstanding[mote.number, application] = self.queue.now_ns
        if len(outstanding) > _OUTSTANDING:
            del outstanding[next(iter(outstanding))]

    def delivered(self, sink: Mote, am_type: int, payload: bytes, origin: int,
                  application: bytes) -> None:
        """Count a packet that the sink delivers."""
        number = self.number_of(origin, sink)
        made_ns = self._outstanding.pop((number, application), None)
        if made_ns is None:
            self.duplicates += 1
        else:
            self.latencies_ns.append(self.queue.now_ns - made_ns)
            mote = self.motes.get(number)
            if mote is not None:
                mote.delivered += 1
        if self.on_deliver is not None:
            self.on_deliver(sink, am_type, payload, origin, application)

    def _plan_account(self) -> None:
        assert self._power is not None
        period_ns = int(60 * _NS_PER_S / max(self._power.acceleration, 1.0))
        self.queue.at(self.queue.now_ns + max(period_ns, _NS_PER_S // 10), self._account)

    def _account_batteries(self) -> None:
        """Switch off motes whose batteries are empty."""
        now_ns = self.queue.now_ns
        for mote in list(self.motes.values()):
            battery = mote.battery
            if battery is not None and mote.is_on and not mote.is_root:
                battery.account(now_ns, mote.radio)
                if battery.is_empty:
                    mote.kill()
                    mote.note('empty')
        self._plan_account()

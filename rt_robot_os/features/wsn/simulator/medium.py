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
The radio medium between the motes: which of them receive a frame, and why others do not.

The medium does no work for nodes that a frame does not concern. Reception is decided at the end of
a frame, from the frames that overlapped with it; a busy channel when a node assesses it.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Iterable
from random import Random
from typing import Final

from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.simulator.air import ACK
from rt_robot_os.features.wsn.simulator.air import Position
from rt_robot_os.features.wsn.simulator.air import Radio
from rt_robot_os.features.wsn.simulator.air import Transmission

RECEIVED: Final = 0
WEAK: Final = 1
COLLISION: Final = 2
BUSY: Final = 3
SENDING: Final = 4
OFF: Final = 5
NO_LINK: Final = 6
CUT: Final = 7
_MASK: Final = (1 << 64) - 1
_CHANCES: Final = 1 << 53

#: Outcomes of a frame at a node that it was addressed to, by number.
OUTCOMES: Final = (
    'received', 'weak', 'collision', 'receiving_another', 'sending', 'off', 'no_link',
    'cut')


class Medium(ABC):
    """
    Base of all media: the frames on the air and their delivery.

    :ivar outcomes: count of each of ``OUTCOMES``: once for each frame and each node that it was
        addressed to and that has a link; once for the frame ``no_link`` without any, and ``cut``
        when its sender was switched off meanwhile.
    :ivar lqi: of the last frame received.
    :ivar rssi_dbm: of the last frame received.
    :ivar overhears: deliver frames for other nodes to all nodes as well.
    :ivar snooped: returns whether a frame for another node is delivered to all nodes anyway.
    :ivar on_end: called at the end of each frame, including acknowledgements.
    :ivar trace: the same, with the receivers; for frames to one node all receivers only with
        ``overhears``. This is slow, as all receivers of an acknowledgement are evaluated.
    """

    def __init__(self) -> None:
        """Create a medium without radios."""
        self.outcomes = [0] * len(OUTCOMES)
        self.lqi = 0
        self.rssi_dbm = 0
        self.overhears = False
        self.snooped: Callable[[Transmission], bool] | None = None
        self.on_end: Callable[[Transmission], None] | None = None
        self.trace: Callable[[Transmission, list[Radio]], None] | None = None
        self.random = Random(0)
        self._salt = 0
        self._on_air: list[Transmission] = []
        self._by_address: dict[int, list[Radio]] = {}
        self._out_of_step: list[Radio] = []

    def seed(self, seed: int) -> None:
        """Set the seed of the random numbers."""
        self.random.seed(f'{seed} air')
        self._salt = Random(f'{seed} overheard').getrandbits(64)

    def attach(self, radio: Radio, position: Position) -> None:
        """
        Add a radio.

        :param position: x, y and height in m.
        """
        radio.near = (self._on_air,)
        self._by_address.setdefault(radio.pan << 16 | radio.address, []).append(radio)

    def detach(self, radio: Radio) -> None:
        """Remove a radio; its frame on the air ends normally."""
        self._by_address[radio.pan << 16 | radio.address].remove(radio)

    def moved(self, radio: Radio, position: Position) -> None:
        """Note a new position or transmit power of a radio."""

    @abstractmethod
    def hearers(self, radio: Radio) -> tuple[Radio, ...]:
        """Return the radios that may receive frames of a radio."""

    @abstractmethod
    def is_busy(self, radio: Radio, now_ns: int) -> bool:
        """Return whether a radio that listens finds the channel busy."""

    @abstractmethod
    def hear(self, frame: Transmission, radio: Radio) -> int:
        """Return the outcome (``OUTCOMES``) of a frame that has just ended at a radio."""

    def received_by(self, radio: Radio, now_ns: int) -> Transmission | None:
        """Return the data frame or beacon that a radio is receiving, where the medium knows."""
        return None

    def set_out_of_step(self, radio: Radio, is_out_of_step: bool) -> None:
        """Set whether a radio gets all frames it receives, whatever their destination."""
        if is_out_of_step != radio.is_out_of_step:
            radio.is_out_of_step = is_out_of_step
            if is_out_of_step:
                self._out_of_step.append(radio)
            else:
                self._out_of_step.remove(radio)

    def begin(self, frame: Transmission) -> None:
        """Start a frame; it overlaps with those already on the air."""
        near = frame.sender.near
        for cell in near:
            for other in cell:
                if frame.overlaps is None:
                    frame.overlaps = []
                frame.overlaps.append(other)
                frame.unfinished += 1
                if other.overlaps is None:
                    other.overlaps = []
                other.overlaps.append(frame)
                other.unfinished += 1
        frame.cell = near[0]
        frame.cell.append(frame)

    def end_frame(self, frame: Transmission) -> None:
        """End a frame and deliver it to its receivers."""
        receivers: list[Radio] = []
        destination = frame.destination
        if destination == BROADCAST:
            self.give_to_all(frame, receivers)
        else:
            self._give_to_one(frame, destination, receivers)
            if self.is_overheard(frame):
                self._give_to_others(frame, destination, receivers)
            elif self._out_of_step:
                self._give_out_of_step(frame)
        self.finish(frame)
        if self.on_end is not None:
            self.on_end(frame)
        if self.trace is not None:
            self.trace(frame, receivers)

    def end_ack(self, ack: Transmission, waiting: Iterable[Radio]) -> None:
        """
        End an acknowledgement.

        :param waiting: radios that wait for one with its number: all of them accept it.
        """
        receivers = [radio for radio in waiting
                     if not radio.is_out_of_step and not self.hear(ack, radio)]
        if self._out_of_step:
            self._give_out_of_step(ack)
        if self.trace is not None:
            others = [radio for radio in self.hearers(ack.sender)
                      if radio not in waiting and not self.hear(ack, radio)]
            self.finish(ack)
            self.trace(ack, receivers + others)
        else:
            self.finish(ack)
        if self.on_end is not None:
            self.on_end(ack)
        for radio in receivers:
            radio.acked()

    def is_overheard(self, frame: Transmission) -> bool:
        """Return whether a frame for one node is delivered to the others, too."""
        return self.overhears or (self.snooped is not None and self.snooped(frame))

    def _give_out_of_step(self, frame: Transmission) -> None:
        """Deliver a frame to radios out of step, unless they get it anyway."""
        for radio in tuple(self._out_of_step):
            if radio.address != frame.destination or frame.am_type == ACK:
                if not self.hear(frame, radio):
                    radio.store(frame, self.lqi, self.rssi_dbm)

    def is_acknowledged(self, frame: Transmission, receiver: Radio) -> bool:
        """Return whether an acknowledgement arrives, for media that do not send them as frames."""
        return True

    def is_falsely_acknowledged(self) -> bool:
        """Return whether a lost frame is acknowledged, for media without such frames."""
        return False

    def finish(self, frame: Transmission) -> None:
        """Remove a frame from the air."""
        frame.cell.remove(frame)
        frame.unfinished -= 1
        if frame.overlaps is not None:
            # No frame is left that could overlap with the finished ones.
            for other in frame.overlaps:
                other.unfinished -= 1
                if not other.unfinished:
                    other.overlaps = None
            if not frame.unfinished:
                frame.overlaps = None

    def give_to_all(self, frame: Transmission, receivers: list[Radio]) -> None:
        """Deliver a frame to all its receivers."""
        outcomes = self.outcomes
        nobody = True
        for radio in self.hearers(frame.sender):
            nobody = False
            outcome = self.hear(frame, radio)
            outcomes[outcome] += 1
            if not outcome:
                receivers.append(radio)
                radio.take(frame, self.lqi, self.rssi_dbm)
        outcomes[NO_LINK] += nobody

    def cut(self, frame: Transmission) -> None:
        """Abort a frame whose sender is switched off; no node receives it."""
        if frame in frame.cell:
            self.finish(frame)
            if frame.am_type != ACK:
                self.outcomes[CUT] += 1

    def _give_to_one(self, frame: Transmission, destination: int,
                     receivers: list[Radio]) -> None:
        """Deliver a frame to the nodes with an address."""
        radios = self._by_address.get(frame.sender.pan << 16 | destination)
        if not radios:
            self.outcomes[NO_LINK] += 1
            return
        for radio in tuple(radios):
            outcome = self.hear(frame, radio)
            self.outcomes[outcome] += 1
            if not outcome:
                receivers.append(radio)
                radio.take(frame, self.lqi, self.rssi_dbm)
            else:
                radio.miss(frame)

    def _give_to_others(self, frame: Transmission, destination: int,
                        receivers: list[Radio]) -> None:
        """Deliver a frame to nodes other than its destination."""
        for radio in self.hearers(frame.sender):
            if radio.address != destination and not self.hear(frame, radio):
                receivers.append(radio)
                radio.overhear(frame, self.lqi, self.rssi_dbm)

    def draw(self, frame: Transmission, radio: Radio, step: int) -> float:
        """
        Return a random number from 0 to 1, 1 not included.

        Numbers for overheard frames do not affect the others, so that a run is the same with and
        without overhearing.

        :param step: index of the number among those for a frame at a radio.
        """
        if frame.destination == BROADCAST or frame.destination == radio.address:
            return self.random.random()
        return self.chance(frame, radio, step)

    def chance(self, frame: Transmission, radio: Radio, step: int) -> float:
        """Return a number that depends only on seed, frame, radio and step."""
        mixed = (self._salt + frame.begin_ns * 0x9E3779B97F4A7C15
                 + (frame.sender.number << 40 | radio.number << 16 | step)
                 * 0xD1B54A32D192ED03) & _MASK
        mixed = (mixed ^ mixed >> 30) * 0xBF58476D1CE4E5B9 & _MASK
        mixed = (mixed ^ mixed >> 27) * 0x94D049BB133111EB & _MASK
        return (mixed >> 11) / _CHANCES

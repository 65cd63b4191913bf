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
The air between the motes: who hears a frame, and who does not, and why.

Nothing is done for nodes that a frame does not concern. Whether one receives it is decided when it
ends, from what was on the air meanwhile; whether the channel is busy, when a node looks.
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

#: What became of a frame at a node that it was for, by number.
OUTCOMES: Final = (
    'received', 'weak', 'collision', 'receiving_another', 'sending', 'off', 'no_link',
    'cut')


class Medium(ABC):
    """
    What is common to all media: what is on the air, and to whom it is given.

    :ivar outcomes: how often each of ``OUTCOMES`` occurred: once for each frame and each node that
        it was for and that could hear it; once for the frame ``no_link`` when there was none, and
        ``cut`` when its sender was switched off meanwhile.
    :ivar lqi: of the frame that was received last.
    :ivar rssi_dbm: of the same.
    :ivar overhears: frames for others are given to all as well.
    :ivar snooped: says which of these are given to all although not all have to be.
    :ivar on_end: called with each frame, acknowledgements too, when it has ended.
    :ivar trace: the same, and with who received it; of frames for one node all of them only with
        ``overhears``. It takes time: all that hear an acknowledgement are looked at.
    """

    def __init__(self) -> None:
        """Start with nobody there."""
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
        """Begin the series of random numbers."""
        self.random.seed(f'{seed} air')
        self._salt = Random(f'{seed} overheard').getrandbits(64)

    def attach(self, radio: Radio, position: Position) -> None:
        """
        Let a radio hear and be heard.

        :param position: x, y and height in m.
        """
        radio.near = (self._on_air,)
        self._by_address.setdefault(radio.pan << 16 | radio.address, []).append(radio)

    def detach(self, radio: Radio) -> None:
        """Take a radio away; its frame on the air ends as if it were there."""
        self._by_address[radio.pan << 16 | radio.address].remove(radio)

    def moved(self, radio: Radio, position: Position) -> None:
        """Take note that a radio is somewhere else, or sends with another power."""

    @abstractmethod
    def hearers(self, radio: Radio) -> tuple[Radio, ...]:
        """Return who may receive what a radio sends."""

    @abstractmethod
    def is_busy(self, radio: Radio, now_ns: int) -> bool:
        """Return whether a radio that listens finds the channel busy."""

    @abstractmethod
    def hear(self, frame: Transmission, radio: Radio) -> int:
        """Return what becomes of a frame that has just ended at a radio: one of ``OUTCOMES``."""

    def received_by(self, radio: Radio, now_ns: int) -> Transmission | None:
        """Return the data frame or beacon that a radio is receiving, where the medium knows."""
        return None

    def set_out_of_step(self, radio: Radio, is_out_of_step: bool) -> None:
        """Give a radio all that it receives, or no longer, whoever it is for."""
        if is_out_of_step != radio.is_out_of_step:
            radio.is_out_of_step = is_out_of_step
            if is_out_of_step:
                self._out_of_step.append(radio)
            else:
                self._out_of_step.remove(radio)

    def begin(self, frame: Transmission) -> None:
        """Put a frame on the air; what is there already overlaps with it."""
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
        """Take a frame off the air and give it to those who receive it."""
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
        Take an acknowledgement off the air.

        :param waiting: radios that wait for one with its number: all of them take it.
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
        """Return whether a frame for one node is given to the others too."""
        return self.overhears or (self.snooped is not None and self.snooped(frame))

    def _give_out_of_step(self, frame: Transmission) -> None:
        """Give a frame to radios that are out of step, unless they get it anyhow."""
        for radio in tuple(self._out_of_step):
            if radio.address != frame.destination or frame.am_type == ACK:
                if not self.hear(frame, radio):
                    radio.store(frame, self.lqi, self.rssi_dbm)

    def is_acknowledged(self, frame: Transmission, receiver: Radio) -> bool:
        """Decide, where acknowledgements are not sent, whether that of a receiver arrives."""
        return True

    def is_falsely_acknowledged(self) -> bool:
        """Decide, where acknowledgements are not sent, whether one comes for a lost frame."""
        return False

    def finish(self, frame: Transmission) -> None:
        """Take a frame off the air."""
        frame.cell.remove(frame)
        frame.unfinished -= 1
        if frame.overlaps is not None:
            # What overlapped with frames that are all over is of no use to anybody.
            for other in frame.overlaps:
                other.unfinished -= 1
                if not other.unfinished:
                    other.overlaps = None
            if not frame.unfinished:
                frame.overlaps = None

    def give_to_all(self, frame: Transmission, receivers: list[Radio]) -> None:
        """Give a frame to all that receive it."""
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
        """Take a frame off the air whose sender is switched off; nobody receives it."""
        if frame in frame.cell:
            self.finish(frame)
            if frame.am_type != ACK:
                self.outcomes[CUT] += 1

    def _give_to_one(self, frame: Transmission, destination: int,
                     receivers: list[Radio]) -> None:
        """Give a frame to those with an address."""
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
        """Give a frame to those that it is not for."""
        for radio in self.hearers(frame.sender):
            if radio.address != destination and not self.hear(frame, radio):
                receivers.append(radio)
                radio.overhear(frame, self.lqi, self.rssi_dbm)

    def draw(self, frame: Transmission, radio: Radio, step: int) -> float:
        """
        Return a random number from 0 to 1, 1 not included.

        What is drawn for frames of others leaves the rest as it is, so that a run is the same
        whether or not somebody looks at them.

        :param step: one for each thing that is drawn for a frame at a radio.
        """
        if frame.destination == BROADCAST or frame.destination == radio.address:
            return self.random.random()
        return self.chance(frame, radio, step)

    def chance(self, frame: Transmission, radio: Radio, step: int) -> float:
        """Return the same from nothing but seed, frame, radio and step, whoever asks first."""
        mixed = (self._salt + frame.begin_ns * 0x9E3779B97F4A7C15
                 + (frame.sender.number << 40 | radio.number << 16 | step)
                 * 0xD1B54A32D192ED03) & _MASK
        mixed = (mixed ^ mixed >> 30) * 0xBF58476D1CE4E5B9 & _MASK
        mixed = (mixed ^ mixed >> 27) * 0x94D049BB133111EB & _MASK
        return (mixed >> 11) / _CHANCES

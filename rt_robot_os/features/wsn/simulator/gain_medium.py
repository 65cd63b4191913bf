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
The radio medium with a physical model: signal strength, noise and interference decide.

A radio that has started to receive a frame receives no other before its end; meanwhile others are
noise to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor
from math import log10
from typing import Final

from rt_robot_os.features.wsn.radio.cc2420 import is_received
from rt_robot_os.features.wsn.radio.cc2420 import lqi
from rt_robot_os.features.wsn.radio.cc2420 import STRONG_SNR_DB
from rt_robot_os.features.wsn.radio.cc2420 import WEAKEST_SNR_DB
from rt_robot_os.features.wsn.radio.mac import MacProfile
from rt_robot_os.features.wsn.radio.noise import NS_PER_SAMPLE
from rt_robot_os.features.wsn.radio.path_loss import Fading
from rt_robot_os.features.wsn.simulator.air import Position
from rt_robot_os.features.wsn.simulator.air import Radio
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.medium import BUSY
from rt_robot_os.features.wsn.simulator.medium import COLLISION
from rt_robot_os.features.wsn.simulator.medium import Medium
from rt_robot_os.features.wsn.simulator.medium import NO_LINK
from rt_robot_os.features.wsn.simulator.medium import OFF
from rt_robot_os.features.wsn.simulator.medium import RECEIVED
from rt_robot_os.features.wsn.simulator.medium import SENDING
from rt_robot_os.features.wsn.simulator.medium import WEAK

# Signal-to-noise ratio from which a radio detects the start of a frame.
_SYNCHRONISATION_SNR_DB: Final = 1.0
_FALSE_ACK: Final = 0.001
# Steps of the random numbers for a frame at a radio; below, one for each other frame.
_AT_BEGIN: Final = 256
_AT_END: Final = 257
_LQI: Final = 258
# Ratio from which the noise does not change the measured signal strength.
_CLEAR_SNR_DB: Final = 12.0
_NOTHING_DBM: Final = -999.0
# One in this number of noise values may be below the floor for receivable signals.
_CALM_SHARE: Final = 100


def _milliwatts(dbm: float) -> float:
    """Convert a power to mW, so that powers can be added."""
    return float(10 ** (dbm / 10))


class GainMedium(Medium):
    """
    A medium with the gains of ``set_gain``, and noise.

    With the profile ``tossim`` the rules are TOSSIM's: reception is decided at the start of a
    frame, at its end, and at the start of each other frame meanwhile. With other profiles it is
    decided once, with the largest sum of noise and interference.
    """

    def __init__(self, noise: Sequence[int], mac: MacProfile) -> None:
        """
        Create a medium without radios.

        :param noise: in dBm, one value for each ms; see ``rt_robot_os.features.wsn.radio.noise``.
        """
        super().__init__()
        self._noise = list(noise)
        self._length = len(self._noise)
        self._tossim = mac.is_tossim
        self._cca_dbm = mac.cca_dbm
        ordered = sorted(self._noise)
        self._median_dbm = ordered[self._length // 2]
        self._lowest_dbm = ordered[self._length // _CALM_SHARE] + WEAKEST_SNR_DB
        self._gains: dict[int, dict[int, float]] = {}
        # The same by receiver, so that for a new radio only its neighbours are examined.
        self._senders: dict[int, dict[int, float]] = {}
        self._fading: Fading | None = None

    def set_gain(self, sender: int, receiver: int, gain_db: float) -> None:
        """
        Set the gain from one address to another.

        :param gain_db: relative to the transmit power: negative.
        """
        self._gains.setdefault(sender, {})[receiver] = gain_db
        self._senders.setdefault(receiver, {})[sender] = gain_db
        for radio in self._by_address.get(sender, ()):
            for other in self._by_address.get(receiver, ()):
                if other is not radio:
                    radio.links[other] = radio.power_dbm + gain_db
            radio.hearers = None

    def attach(self, radio: Radio, position: Position) -> None:
        """Add a radio, with the gains of ``set_gain``."""
        super().attach(radio, position)
        radio.noise_place = self.random.randrange(self._length)
        self.moved(radio, position)

    def detach(self, radio: Radio) -> None:
        """Remove a radio."""
        super().detach(radio)
        for address in self._senders.get(radio.address, ()):
            for other in self._by_address.get(address, ()):
                if other.links.pop(radio, None) is not None:
                    other.hearers = None

    def moved(self, radio: Radio, position: Position) -> None:
        """Note a new transmit power of a radio."""
        gains = self._gains.get(radio.address, {})
        radio.links = {other: radio.power_dbm + gain for address, gain in gains.items()
                       for other in self._by_address.get(address, ()) if other is not radio}
        radio.hearers = None
        for address, gain in self._senders.get(radio.address, {}).items():
            for other in self._by_address.get(address, ()):
                if other is not radio:
                    other.links[radio] = other.power_dbm + gain
                    other.hearers = None

    def add_noise(self, more_db: int) -> None:
        """
        Raise the noise everywhere.

        :param more_db: negative to lower it.
        """
        self._noise = [value + more_db for value in self._noise]
        self._lowest_dbm += more_db
        for radios in self._by_address.values():
            for radio in radios:
                radio.hearers = None

    def links_of(self, radio: Radio) -> dict[Radio, float]:
        """Return the signal strength of a radio at all radios in range, in dBm."""
        return radio.links

    def hearers(self, radio: Radio) -> tuple[Radio, ...]:
        """Return the radios that may receive frames of a radio."""
        hearers = radio.hearers
        if hearers is None:
            links = self.links_of(radio)
            hearers = radio.hearers = tuple(
                other for other, power in links.items()
                if power > self._lowest_dbm and other.pan == radio.pan)
        return hearers

    def noise_dbm(self, radio: Radio, now_ns: int) -> int:
        """Return the noise at a radio."""
        return self._noise[(now_ns // NS_PER_SAMPLE + radio.noise_place) % self._length]

    def is_busy(self, radio: Radio, now_ns: int) -> bool:
        """Return whether the sum of noise and signals reaches the CCA threshold."""
        noise = self._noise[(now_ns // NS_PER_SAMPLE + radio.noise_place) % self._length]
        if noise >= self._cca_dbm:
            return True
        total = 0.0
        for cell in radio.near:
            for frame in cell:
                if frame.begin_ns <= now_ns:
                    power = frame.sender.links.get(radio)
                    if power is not None:
                        total += _milliwatts(power)
        return total > 0 and 10 * log10(total + _milliwatts(noise)) >= self._cca_dbm

    def hear(self, frame: Transmission, radio: Radio) -> int:
        """Return the outcome of a frame that has just ended at a radio."""
        power = frame.sender.links.get(radio)
        if power is None:
            return NO_LINK
        if self._fading is not None:
            power += self._fading.at(frame.sender.number, radio.number, frame.begin_ns)
        begin_ns = frame.begin_ns
        if not radio.is_on or radio.on_since_ns > begin_ns:
            return OFF
        if frame.overlaps is not None:
            return self._hear_among_others(frame, radio, power)
        place = radio.noise_place
        at_begin = power - self._noise[(begin_ns // NS_PER_SAMPLE + place) % self._length]
        snr_db = power - self._noise[(frame.end_ns // NS_PER_SAMPLE + place) % self._length]
        if self._tossim:
            if at_begin < STRONG_SNR_DB and not is_received(
                    at_begin, self.draw(frame, radio, _AT_BEGIN)):
                return WEAK
        elif at_begin < snr_db:
            snr_db = at_begin
        if snr_db < STRONG_SNR_DB and not is_received(snr_db, self.draw(frame, radio, _AT_END)):
            return WEAK
        self.lqi = lqi(snr_db, self.draw(frame, radio, _LQI))
        self.rssi_dbm = floor(power) if at_begin > _CLEAR_SNR_DB else floor(
            10 * log10(_milliwatts(power) + _milliwatts(power - at_begin)))
        return RECEIVED

    def give_to_all(self, frame: Transmission, receivers: list[Radio]) -> None:
        """Deliver a frame to all its receivers; as ``hear`` of each, but faster."""
        if frame.overlaps is not None or self._fading is not None or self._tossim:
            super().give_to_all(frame, receivers)
            return
        series, length, random = self._noise, self._length, self.random.random
        begin_ns = frame.begin_ns
        begin, end = begin_ns // NS_PER_SAMPLE, frame.end_ns // NS_PER_SAMPLE
        links = frame.sender.links
        hearers = self.hearers(frame.sender)
        weak = off = 0
        for radio in hearers:
            if not radio.is_on or radio.on_since_ns > begin_ns:
                off += 1
                continue
            place = radio.noise_place
            power = links.get(radio, _NOTHING_DBM)
            noise = series[(begin + place) % length]
            at_end = series[(end + place) % length]
            snr_db = power - (noise if noise > at_end else at_end)
            if snr_db < STRONG_SNR_DB and not is_received(snr_db, random()):
                weak += 1
                continue
            receivers.append(radio)
            rssi_dbm = floor(power) if power - noise > _CLEAR_SNR_DB else floor(
                10 * log10(_milliwatts(power) + _milliwatts(noise)))
            radio.take(frame, lqi(snr_db, random()), rssi_dbm)
        outcomes = self.outcomes
        outcomes[RECEIVED] += len(receivers)
        outcomes[WEAK] += weak
        outcomes[OFF] += off
        outcomes[NO_LINK] += not hearers

    def _hear_among_others(self, frame: Transmission, radio: Radio, power: float) -> int:
        """Return the outcome of a frame that overlapped with others."""
        outcome = self._start(frame, radio, power)
        if outcome:
            return outcome
        begin_ns, end_ns = frame.begin_ns, frame.end_ns
        place = radio.noise_place
        at_begin = self._noise[(begin_ns // NS_PER_SAMPLE + place) % self._length]
        at_end = self._noise[(end_ns // NS_PER_SAMPLE + place) % self._length]
        others = []
        for other in frame.overlaps or ():
            if other.sender is radio:
                if other.end_ns > begin_ns:
                    return SENDING
            elif other.end_ns > begin_ns and other.begin_ns < end_ns:
                level = other.sender.links.get(radio)
                if level is not None:
                    others.append((other, level))
        if self._tossim:
            for other, level in others:
                if other.begin_ns > begin_ns and not is_received(
                        power - level, self.chance(frame, radio, other.dsn)):
                    return COLLISION
            worst = sum(_milliwatts(level) for other, level in others if other.end_ns > end_ns)
            noise = at_end
        else:
            worst = self._worst(begin_ns, others)
            noise = max(at_begin, at_end)
        snr_db = power - 10 * log10(_milliwatts(noise) + worst)
        if not is_received(snr_db, self.draw(frame, radio, _AT_END)):
            return COLLISION if worst > _milliwatts(noise) else WEAK
        self.lqi = lqi(snr_db, self.draw(frame, radio, _LQI))
        self.rssi_dbm = floor(10 * log10(_milliwatts(power) + _milliwatts(at_begin)))
        return RECEIVED

    @staticmethod
    def _worst(begin_ns: int, others: list[tuple[Transmission, float]]) -> float:
        """Return the largest sum of the interference at any time since a frame began."""
        worst = 0.0
        for first, _ in others:
            when = max(first.begin_ns, begin_ns)
            worst = max(worst, sum(_milliwatts(level) for other, level in others
                                   if other.begin_ns <= when < other.end_ns))
        return worst

    def _start(self, frame: Transmission, radio: Radio, power: float) -> int:
        """Return why a radio did not start to receive a frame; 0 when it did."""
        if frame.starts is None:
            frame.starts = {}
        known = frame.starts.get(radio)
        if known is None:
            known = frame.starts[radio] = self._find_start(frame, radio, power)
        return known

    def _find_start(self, frame: Transmission, radio: Radio, power: float) -> int:
        """Compute this from the frames that were on the air when the frame began."""
        if not radio.is_on:
            return OFF
        begin_ns = frame.begin_ns
        noise = _milliwatts(
            self._noise[(begin_ns // NS_PER_SAMPLE + radio.noise_place) % self._length])
        total = noise
        busy = False
        for other in frame.overlaps or ():
            if other.begin_ns > begin_ns or other.end_ns <= begin_ns:
                continue
            if other.sender is radio:
                return SENDING
            level = other.sender.links.get(radio)
            if level is None:
                continue
            total += _milliwatts(level)
            if other.begin_ns < begin_ns and not busy:
                busy = not self._start(other, radio, level) and self._still_receives(
                    other, radio, begin_ns)
        snr_db = power - 10 * log10(total)
        if self._tossim:
            if not is_received(snr_db, self.chance(frame, radio, _AT_BEGIN)):
                return COLLISION if total > 2 * noise else WEAK
        elif snr_db < _SYNCHRONISATION_SNR_DB:
            return COLLISION if total > 2 * noise else WEAK
        return BUSY if busy else RECEIVED

    def _still_receives(self, frame: Transmission, radio: Radio, now_ns: int) -> bool:
        """Return whether a radio still receives a frame; in TOSSIM until any other one ends."""
        if self._tossim:
            for other in frame.overlaps or ():
                if frame.begin_ns < other.end_ns <= now_ns and radio in other.sender.links:
                    return False
        return True

    def is_acknowledged(self, frame: Transmission, receiver: Radio) -> bool:
        """Decide, as in TOSSIM, whether the acknowledgement of a receiver arrives."""
        sender = frame.sender
        power = self.links_of(receiver).get(sender, 1.0)
        total = _milliwatts(self.noise_dbm(sender, frame.end_ns))
        for other in frame.overlaps or ():
            if other.begin_ns <= frame.end_ns < other.end_ns:
                level = other.sender.links.get(sender)
                if level is not None:
                    total += _milliwatts(level)
        return is_received(power - 10 * log10(total), self.random.random())

    def is_falsely_acknowledged(self) -> bool:
        """Decide, as in TOSSIM, whether a lost frame counts as received."""
        return self.random.random() < _FALSE_ACK

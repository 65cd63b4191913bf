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
The radio medium as a list of links, each with a reception rate, an RSSI and an LQI.

Frames that overlap at a radio that both could have reached are lost, whatever their strength.
"""

from __future__ import annotations

from rt_robot_os.features.wsn.radio.mac import MacProfile
from rt_robot_os.features.wsn.simulator.air import ACK
from rt_robot_os.features.wsn.simulator.air import Link
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


class LinkMedium(Medium):
    """A medium with the links of ``set_link``, which may change at any time."""

    def __init__(self, mac: MacProfile) -> None:
        """Create a medium without radios."""
        super().__init__()
        self._cca_dbm = mac.cca_dbm
        self._links: dict[int, dict[int, Link]] = {}
        # By receiver, so that for a new radio only its neighbours are examined.
        self._senders: dict[int, dict[int, None]] = {}

    def set_link(self, sender: int, receiver: int, link: Link | None) -> None:
        """
        Set the link from one address to another.

        :param link: None: no link, as with a rate of 0.
        :raises ValueError: the rate or the LQI is out of range.
        """
        if link is not None and not 0 <= link.reception_rate <= 1:
            raise ValueError(
                f'link {sender} to {receiver}: rate {link.reception_rate}: must be from 0 to 1')
        if link is None or link.reception_rate == 0:
            self._links.get(sender, {}).pop(receiver, None)
            self._senders.get(receiver, {}).pop(sender, None)
        else:
            self._links.setdefault(sender, {})[receiver] = link
            self._senders.setdefault(receiver, {})[sender] = None
        for radio in self._by_address.get(sender, ()):
            self._refresh(radio)

    def _refresh(self, radio: Radio) -> None:
        """Update the radios that hear a radio."""
        links = self._links.get(radio.address, {})
        radio.fixed_links = {other: link for address, link in links.items()
                             for other in self._by_address.get(address, ()) if other is not radio}
        radio.hearers = tuple(radio.fixed_links)

    def attach(self, radio: Radio, position: Position) -> None:
        """Add a radio, with the links of ``set_link``."""
        super().attach(radio, position)
        self._refresh(radio)
        self._refresh_those_heard_by(radio)

    def detach(self, radio: Radio) -> None:
        """Remove a radio."""
        super().detach(radio)
        self._refresh_those_heard_by(radio)

    def _refresh_those_heard_by(self, radio: Radio) -> None:
        for address in self._senders.get(radio.address, ()):
            for other in self._by_address.get(address, ()):
                self._refresh(other)

    def hearers(self, radio: Radio) -> tuple[Radio, ...]:
        """Return the radios that may receive frames of a radio."""
        return radio.hearers or ()

    def is_acknowledged(self, frame: Transmission, receiver: Radio) -> bool:
        """Return whether an acknowledgement arrives, if they are not sent as frames."""
        link = receiver.fixed_links.get(frame.sender)
        return link is not None and self.random.random() < link.reception_rate

    def is_busy(self, radio: Radio, now_ns: int) -> bool:
        """Return whether a signal reaches the CCA threshold."""
        for frame in self._on_air:
            if frame.begin_ns <= now_ns:
                link = frame.sender.fixed_links.get(radio)
                if link is not None and link.rssi_dbm >= self._cca_dbm:
                    return True
        return False

    def received_by(self, radio: Radio, now_ns: int) -> Transmission | None:
        """
        Return the data frame or beacon that a radio is receiving.

        Acknowledgements are excluded: when they begin, TinyOS still reads the acknowledged frame,
        and the bus to the chip is busy until they have ended
        (``SpiResource`` in ``CC2420TransmitP``).
        """
        for frame in self._on_air:
            if frame.begin_ns < now_ns < frame.end_ns and frame.am_type != ACK:
                link = frame.sender.fixed_links.get(radio)
                if link is not None and not self._start(frame, radio, link):
                    return frame
        return None

    def hear(self, frame: Transmission, radio: Radio) -> int:
        """Return the outcome of a frame that has just ended at a radio."""
        link = frame.sender.fixed_links.get(radio)
        if link is None:
            return NO_LINK
        if not radio.is_on or radio.on_since_ns > frame.begin_ns:
            return OFF
        if frame.overlaps is None:
            if link.reception_rate < 1 and self.draw(frame, radio, 0) >= link.reception_rate:
                return WEAK
        else:
            outcome = self._start(frame, radio, link)
            if outcome:
                return outcome
            for other in frame.overlaps:
                if frame.begin_ns <= other.begin_ns < frame.end_ns:
                    if other.sender is radio:
                        return SENDING
                    if radio in other.sender.fixed_links:
                        return COLLISION
        self.lqi = link.lqi
        self.rssi_dbm = link.rssi_dbm
        return RECEIVED

    def _start(self, frame: Transmission, radio: Radio, link: Link) -> int:
        """Return why a radio did not start to receive a frame; 0 when it did."""
        if frame.starts is None:
            frame.starts = {}
        known = frame.starts.get(radio)
        if known is None:
            known = frame.starts[radio] = self._find_start(frame, radio, link)
        return known

    def _find_start(self, frame: Transmission, radio: Radio, link: Link) -> int:
        """Compute this from the frames that were on the air when the frame began."""
        if not radio.is_on:
            return OFF
        for other in frame.overlaps or ():
            if other.begin_ns < frame.begin_ns < other.end_ns:
                if other.sender is radio:
                    return SENDING
                before = other.sender.fixed_links.get(radio)
                if before is not None and not self._start(other, radio, before):
                    return BUSY
        if link.reception_rate < 1 and self.chance(frame, radio, 0) >= link.reception_rate:
            return WEAK
        return RECEIVED

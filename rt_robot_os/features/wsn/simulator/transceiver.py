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

"""The radio of a mote: medium access (CSMA), transmission and acknowledgements."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol

from rt_robot_os.features.wsn.radio.cc2420 import LARGEST_MPDU_BYTES
from rt_robot_os.features.wsn.radio.mac import MacProfile
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.simulator.air import ACK
from rt_robot_os.features.wsn.simulator.air import Radio
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.air_log import bytes_of
from rt_robot_os.features.wsn.simulator.events import Event
from rt_robot_os.features.wsn.simulator.events import EventQueue
from rt_robot_os.features.wsn.simulator.medium import Medium
from rt_robot_os.features.wsn.simulator.receive_fifo import Arrival
from rt_robot_os.features.wsn.simulator.receive_fifo import bytes_until
from rt_robot_os.features.wsn.simulator.receive_fifo import in_fifo
from rt_robot_os.features.wsn.simulator.receive_fifo import ReceiveFifo


class Listener(Protocol):
    """The receiver of the frames of a radio."""

    def received(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Receive a frame for this node, or a broadcast."""

    def overheard(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Receive a frame for another node."""


class FrameSender:
    """
    A buffer for one frame at a radio.

    :ivar busy: the frame is waiting or being sent.
    """

    __slots__ = ('busy', 'destination', 'am_type', 'payload', 'acknowledge', 'done', '_radio')

    def __init__(self, radio: Transceiver, done: Callable[[bool], None]) -> None:
        """:param done: called at the end of the transmission, with whether it was acknowledged."""
        self.busy = False
        self.destination = 0
        self.am_type = 0
        self.payload = b''
        self.acknowledge = False
        self.done = done
        self._radio = radio

    def send(self, destination: int, am_type: int, payload: bytes, acknowledge: bool) -> bool:
        """
        Pass a frame to the radio; see ``Sender`` of the protocols.

        The transmission of one that is too long for any radio ends without a frame on the air.
        """
        radio = self._radio
        if self.busy or not radio.is_on:
            return False
        self.busy = True
        self.destination = destination
        self.am_type = am_type
        self.payload = payload
        self.acknowledge = acknowledge
        radio.enqueue(self)
        return True

    def rewrite(self, destination: int, payload: bytes) -> None:
        """Change the frame in transit; see ``Sender`` of the protocols."""
        if self.busy:
            self._radio.rewrite(self, destination, payload)


class Transceiver(Radio):
    """
    The radio of a mote.

    :ivar too_long_frames: frames that were not sent because of their length.
    :ivar cut_off_frames: frames of others whose reception ended with its own transmission.
    :ivar unread_frames: frames received, but lost in the receive FIFO.
    """

    __slots__ = ('too_long_frames', 'cut_off_frames', 'unread_frames', '_fifo',
                 '_largest_payload', '_queue', '_medium', '_mac', '_listener',
                 '_waiting', '_sending', '_frame', '_event', '_ack_event', '_ack', '_dsn',
                 '_acked', '_acks_awaited')

    def __init__(self, address: int, power_dbm: float, queue: EventQueue, medium: Medium,
                 mac: MacProfile, listener: Listener, acks_awaited: list[list[Transceiver]],
                 ) -> None:
        """
        Create a radio that is off.

        :param acks_awaited: radios that wait for an acknowledgement, by sequence number; one
            mapping for all radios.
        """
        super().__init__(address, power_dbm)
        self.too_long_frames = 0
        self.cut_off_frames = 0
        self.unread_frames = 0
        self._fifo: ReceiveFifo | None = None
        self._largest_payload = LARGEST_MPDU_BYTES - mac.overhead_bytes
        self._queue = queue
        self._medium = medium
        self._mac = mac
        self._listener = listener
        self._waiting: deque[FrameSender] = deque()
        self._sending: FrameSender | None = None
        self._frame: Transmission | None = None
        self._event = Event(self._assess_channel)
        self._ack_event = Event(self._send_ack)
        self._ack: Transmission | None = None
        self._dsn = medium.random.randrange(256)
        self._acked = False
        self._acks_awaited = acks_awaited

    def switch_on(self) -> None:
        """Start listening."""
        self.is_on = True
        self.on_since_ns = self._queue.now_ns

    def switch_off(self) -> None:
        """Drop the frames to send; a frame on the air is aborted."""
        self.is_on = False
        if self._sending is not None:
            self._sending.busy = False
            self._stop_waiting()
        self._sending = None
        for sender in self._waiting:
            sender.busy = False
        self._waiting.clear()
        self._queue.cancel(self._event)
        self._queue.cancel(self._ack_event)
        for frame in (self._frame, self._ack):
            if frame is not None:
                self._medium.cut(frame)
        self._frame = self._ack = None
        self._fifo = None
        self._medium.set_out_of_step(self, False)

    def enqueue(self, sender: FrameSender) -> None:
        """Queue the frame of a sender."""
        if self._sending is None:
            self._begin(sender)
        else:
            self._waiting.append(sender)

    def rewrite(self, sender: FrameSender, destination: int, payload: bytes) -> None:
        """
        Change a frame that was passed to the radio, as far as this is possible in TinyOS.

        A CC2420 has a copy of the frame that it sends. TOSSIM's receivers read the sender's
        memory at the end of the frame, and its flag that requests an acknowledgement is also the
        one that reports it (``TossimPacketModelC``).
        """
        if sender is self._sending:
            if not self._mac.is_tossim:
                return
            frame = self._frame
            is_in_flight = self._event.call == self._no_ack
            if frame is not None:
                frame.destination, frame.payload = destination, payload
                is_in_flight = self._queue.now_ns >= frame.begin_ns
            self._acked |= is_in_flight and sender.acknowledge
        sender.destination, sender.payload = destination, payload

    def _begin(self, sender: FrameSender) -> None:
        """Wait for a random time, then assess the channel."""
        self._sending = sender
        low, count, step = self._mac.initial
        ticks = low + step * int(self._medium.random.random() * count)
        self._event.call = self._assess_channel
        self._queue.at(self._queue.now_ns + int(ticks * self._mac.unit_ns), self._event)

    def _assess_channel(self) -> None:
        """Send if the channel is clear, else wait again."""
        mac, queue = self._mac, self._queue
        now_ns = queue.now_ns
        if self._ack is not None or self._medium.is_busy(self, now_ns):
            self._wait_again()
        elif mac.second_cca_ns:
            self._event.call = self._assess_again
            queue.at(now_ns + mac.second_cca_ns, self._event)
        else:
            self._transmit(now_ns)

    def _wait_again(self) -> None:
        low, count, step = self._mac.congestion
        ticks = low + step * int(self._medium.random.random() * count)
        self._event.call = self._assess_channel
        self._queue.at(self._queue.now_ns + int(ticks * self._mac.unit_ns), self._event)

    def _assess_again(self) -> None:
        """Send if the channel is still clear."""
        now_ns = self._queue.now_ns
        if self._ack is not None or self._medium.is_busy(self, now_ns):
            self._wait_again()
        else:
            self._transmit(now_ns)

    def _transmit(self, now_ns: int) -> None:
        """Start the transmission."""
        sender = self._sending
        assert sender is not None
        mac = self._mac
        acknowledge = sender.acknowledge
        if len(sender.payload) > self._largest_payload:
            self.too_long_frames += 1
            self._finish(False)
            return
        if mac.keeps_cut_off:
            self._cut_off_reception(now_ns)
        self._dsn = dsn = (self._dsn + 1) & 0xFF
        begin_ns = now_ns + mac.turnaround_ns
        end_ns = begin_ns + mac.air_time_ns(len(sender.payload), acknowledge)
        self._acked = False
        self._frame = frame = Transmission(
            self, sender.destination, sender.am_type, sender.payload, acknowledge, dsn, begin_ns,
            end_ns)
        self._medium.begin(frame)
        self.sent_frames += 1
        self.air_ns += end_ns - begin_ns
        self._event.call = self._sent
        self._queue.at(end_ns, self._event)

    def _sent(self) -> None:
        """Deliver the frame to its receivers; wait for the acknowledgement."""
        frame = self._frame
        assert frame is not None
        mac = self._mac
        self._frame = None
        # Scheduled before the receivers act, so that they may act at the same time.
        if frame.acknowledge or mac.is_tossim:
            self._event.call = self._no_ack
            self._queue.at(frame.end_ns + mac.ack_wait_ns, self._event)
            if not mac.is_tossim:
                self._acks_awaited[frame.dsn].append(self)
            self._medium.end_frame(frame)
        else:
            self._medium.end_frame(frame)
            self._finish(False)

    def _no_ack(self) -> None:
        """End the wait for an acknowledgement."""
        self._stop_waiting()
        self._finish(self._acked)

    def _stop_waiting(self) -> None:
        waiting = self._acks_awaited[self._dsn]
        if self in waiting:
            waiting.remove(self)

    def acked(self) -> None:
        """Receive an acknowledgement with the sequence number of the frame sent."""
        if self._mac.is_tossim:
            self._acked = True
            return
        self._queue.cancel(self._event)
        self._stop_waiting()
        self._finish(True)

    def _finish(self, acked: bool) -> None:
        """Notify the sender, and start the next one."""
        sender = self._sending
        assert sender is not None
        self._sending = None
        sender.busy = False
        if self._waiting:
            self._begin(self._waiting.popleft())
        sender.done(acked)

    def take(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Receive a frame for this node, or a broadcast."""
        if self._fifo is not None:
            self.store(frame, lqi, rssi_dbm)
            return
        self._read(frame, lqi, rssi_dbm)

    def overhear(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Receive a frame for another node."""
        if self._fifo is not None:
            self.store(frame, lqi, rssi_dbm)
            return
        self._listener.overheard(frame, lqi, rssi_dbm)

    def _read(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Acknowledge a frame for this node or for all, and pass it on."""
        self.received_frames += 1
        if frame.acknowledge:
            self._acknowledge(frame)
        self._listener.received(frame, lqi, rssi_dbm)

    def _cut_off_reception(self, now_ns: int) -> None:
        """Leave a partly received frame in the FIFO at the start of a transmission."""
        frame = self._medium.received_by(self, now_ns)
        if frame is None:
            return
        count = bytes_until(frame, now_ns)
        if not count:
            return
        self.cut_off_frames += 1
        if self._fifo is None:
            self._fifo = ReceiveFifo()
            self._medium.set_out_of_step(self, True)
        data = bytes_of(frame, self._mac.version)[:count]
        self._process_arrivals(self._fifo.cut_off(data, now_ns), None)

    def store(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Add a frame to the FIFO that is out of step; process what the mote reads."""
        fifo = self._fifo
        assert fifo is not None
        data = in_fifo(bytes_of(frame, self._mac.version), lqi, rssi_dbm)
        self.unread_frames += 1
        self._process_arrivals(fifo.complete(frame, data), frame)

    def _process_arrivals(self, arrivals: list[Arrival], newest: Transmission | None) -> None:
        """
        Process what the mote reads from a FIFO that is out of step.

        :param newest: the only frame that can still be acknowledged.
        """
        fifo = self._fifo
        if fifo is not None and fifo.is_in_step:
            self._fifo = None
            self._medium.set_out_of_step(self, False)
        self.unread_frames -= len(arrivals)
        for arrival in arrivals:
            frame = arrival.frame
            assert frame is not None
            if frame.am_type == ACK:
                if self in self._acks_awaited[frame.dsn]:
                    self.acked()
            elif frame.destination not in (self.address, BROADCAST):
                if self._medium.is_overheard(frame):
                    self._listener.overheard(frame, arrival.lqi, arrival.rssi_dbm)
            elif frame is newest:
                self._read(frame, arrival.lqi, arrival.rssi_dbm)
            else:
                self.received_frames += 1
                self._listener.received(frame, arrival.lqi, arrival.rssi_dbm)

    def miss(self, frame: Transmission) -> None:
        """Lose a frame for this node; TOSSIM acknowledges a few of these."""
        if (self._mac.is_tossim and frame.acknowledge and self.is_on and self._frame is None
                and self._medium.is_falsely_acknowledged()):
            self._acknowledge(frame)

    def _acknowledge(self, frame: Transmission) -> None:
        """Acknowledge a frame according to the MAC profile."""
        mac = self._mac
        if frame.destination == BROADCAST and not mac.broadcast_acks:
            return
        if mac.is_tossim:
            if self._medium.is_acknowledged(frame, self):
                self.sent_acks += 1
                frame.sender.acked()
        elif self._ack is None:
            begin_ns = frame.end_ns + mac.ack_delay_ns
            self._ack = Transmission(self, frame.sender.address, ACK, b'', False, frame.dsn,
                                     begin_ns, begin_ns + mac.ack_air_ns)
            self._ack_event.call = self._send_ack
            self._queue.at(max(begin_ns - mac.turnaround_ns, self._queue.now_ns), self._ack_event)

    def _send_ack(self) -> None:
        """Send the acknowledgement, unless this radio is sending."""
        ack = self._ack
        assert ack is not None
        if self._frame is not None:
            self._ack = None
            return
        self._medium.begin(ack)
        self.sent_acks += 1
        self.air_ns += ack.end_ns - ack.begin_ns
        self._ack_event.call = self._ack_sent
        self._queue.at(ack.end_ns, self._ack_event)

    def _ack_sent(self) -> None:
        """Deliver the acknowledgement to radios that wait for its sequence number."""
        ack = self._ack
        assert ack is not None
        self._ack = None
        self._medium.end_ack(ack, tuple(self._acks_awaited[ack.dsn]))

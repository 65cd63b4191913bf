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
The serial device: everything between a port and the frames of a protocol.

The port is a serial line, or carries the same bytes over a network (``network.py``).

A driver for a serial device adds a decoder and handles the frames; see ``devices/witmotion``.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import ClassVar
from typing import Final
from typing import Generic
from typing import Protocol
from typing import TypeVar

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.device import SamplePublisher
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.serial.port import address_of
from rt_robot_os.devices.serial.port import more_of
from rt_robot_os.devices.serial.port import open_port
from rt_robot_os.devices.serial.port import Port
from rt_robot_os.devices.serial.port import prepare_port
from rt_robot_os.devices.serial.port import silence_of
from rt_robot_os.devices.signatures import SIGNATURES

# Start bit, eight data bits, stop bit.
BITS_PER_BYTE: Final = 10
# Limit of the bytes that one job decodes; further bytes wait for the next jobs. Enough for 80 kB/s
# at ten jobs per second; the worst possible bytes take some milliseconds.
JOB_BYTES: Final = 8192
# Bytes kept to identify the sender: some sentences, or some dozen frames.
_STRANGE: Final = 512


class StampedFrame(Protocol):
    """
    A decoded frame.

    :ivar end: index just after the last byte of the frame in the chunk that completed it; 0 or
        less if it arrived in an earlier chunk, within the false start of a longer frame.
    """

    @property
    def end(self) -> int:
        """Return the index."""


FrameT = TypeVar('FrameT', bound=StampedFrame)
FrameOutT = TypeVar('FrameOutT', bound=StampedFrame, covariant=True)


class SerialDecoder(Protocol[FrameOutT]):
    """
    Decodes bytes to frames, with bounded memory, and never raises.

    Each byte fed is in one of the frames, or rejected, or pending.

    :ivar frames: valid frames so far.
    :ivar rejected_bytes: bytes that belong to no valid frame.
    :ivar rejected_frames: frames with a bad checksum; their bytes are rejected bytes.
    """

    frames: int
    rejected_bytes: int
    rejected_frames: int

    @property
    def pending_bytes(self) -> int:
        """Return the number of bytes kept until the rest of their frame arrives."""

    def feed(self, data: bytes) -> Sequence[FrameOutT]:
        """Decode the next bytes of the stream and return the frames that they complete."""

    def reset(self) -> None:
        """Reject the pending bytes: the stream restarts."""


def serial_settings(
    *, baud: int, frame_id: str, topic: str, rate_hz: float, rates_hz: tuple[float, ...] = (),
) -> tuple[Field, ...]:
    """
    Declare the settings that every serial device has, with the defaults of one device.

    :param baud: default speed in bits per second.
    :param frame_id: default of ``header.frame_id``.
    :param topic: default name of the main topic.
    :param rate_hz: default of the rate at which the device sends.
    :param rates_hz: the only possible rates; empty allows all.
    """
    return (
        Field('port', str, REQUIRED, 'Serial port, best one of /dev/serial/by-id; or '
              'tcp://host:port, udp://host:port, udp-listen://:port, gpsd://host; '
              'sim is a simulated device.'),
        Field('baud', int, baud,
              'Speed of the serial line; 0 for a pty. Ignored on a network.', unit='bit/s',
              minimum=0, maximum=4_000_000),
        Field('frame_id', str, frame_id, 'Coordinate frame of the samples.'),
        Field('topic', str, topic, 'Topic of the samples.'),
        Field('depth', int, 16, 'Samples that each topic keeps.',
              choices=(2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)),
        Field('output_rate_hz', float, rate_hz, 'Samples per second that the device sends.',
              unit='Hz', minimum=0.05, maximum=10_000.0, choices=rates_hz),
    )


class SerialDevice(Device, Generic[FrameT]):
    """
    A device on a serial port.

    The arrival of a frame is back-dated by the transmission time of the bytes that followed it in
    the same read; it is never before the arrival of the previous frame. One job decodes at most
    ``JOB_BYTES``.

    :cvar make_port: opens its port.
    :cvar TAKES_FORWARDER: its port may be a serial forwarder of motes, ``sf://host:port``.
    """

    TAPPED = True
    TAKES_FORWARDER: ClassVar[bool] = False
    make_port: Callable[[str, int], Port] = staticmethod(open_port)

    def __init__(
        self, name: str, settings: Mapping[str, Any], decoder: SerialDecoder[FrameT],
    ) -> None:
        """
        Store settings and decoder; nothing is opened.

        :param decoder: decodes the bytes to frames.
        :raises ConfigError: the port is neither a path nor an address.
        """
        super().__init__(name, settings)
        # Bytes of a network do not arrive one by one, so their frames are not back-dated.
        networked = address_of(
            name, 'port', settings['port'], self.TAKES_FORWARDER) is not None
        baud: int = 0 if networked else settings['baud']
        self._baud = baud
        self._decoder = decoder
        self._byte_ns = BITS_PER_BYTE * NS_PER_S // baud if baud else 0
        self._port: Port | None = None
        self._bytes_read = 0
        self._dropped_write_bytes = 0
        self._samples = 0
        self._last_frame_ns = 0
        self._alive_ns = 0
        self._previous_read_ns = 0
        self._ignored_frames = 0
        self._strange = b''
        # Bytes of the last read of the port, at `_came_ns`, that wait for a later job.
        self._left = b''
        self._came_ns = 0
        self._deferred_bytes = 0

    @abstractmethod
    def handle(self, frame: FrameT, arrival_ns: int) -> int:
        """
        Handle one frame; in the loop.

        :return: number of samples published.
        """

    def restart(self) -> None:
        """Reset the state of the stream: the port was just opened."""

    def is_set_up(self) -> bool:
        """Return whether the set-up is complete; frames before do not make the device ACTIVE."""
        return True

    def idle(self, now_ns: int) -> int:
        """
        Handle time-outs without a frame; called at the end of every read.

        :return: number of samples published.
        """
        return 0

    def bind(self, publishers: Sequence[SamplePublisher]) -> None:
        """
        Bind the publishers, and prepare opening and diagnosing the port.

        :raises TopicError: their number is not that of the publications.
        """
        super().bind(publishers)
        if self.is_live:
            SIGNATURES.prepare()
            prepare_port(self.settings['port'])

    def open(self) -> None:  # noqa: A003
        """
        Open the port exclusively; bytes received before are discarded.

        :raises DeviceError: the port cannot be opened.
        """
        self.close()
        try:
            self._port = self.make_port(self.settings['port'], self.settings['baud'])
        except DeviceError as error:
            raise DeviceError(f'{self.name}: {error}') from error
        self._decoder.reset()
        self._previous_read_ns = 0
        self._strange = b''
        self.restart()

    def close(self) -> None:
        """Close the port; may be called twice and does not raise."""
        port, self._port = self._port, None
        if port is not None:
            self._bytes_read += port.bytes_read
            self._dropped_write_bytes += port.dropped_write_bytes
            self._decoder.rejected_bytes += len(self._left)
            self._left = b''
            port.close()

    def fileno(self) -> int | None:
        """Return the file descriptor of the port, None when it is closed."""
        return None if self._port is None else self._port.fileno()

    def read(self, now_ns: int) -> int:
        """
        Read, decode and publish the available bytes; safe in the loop, does not block.

        :raises DeviceError: the port is gone or was not opened.
        """
        if self._left:
            data = self._next_part(now_ns)
        else:
            try:
                data = self._opened().read()
            except DeviceError as error:
                raise DeviceError(f'{self.name}: {error}') from error
            if self.tap is not None:
                self.tap.read(now_ns, data)
            # After a gap the arrival is unknown: bytes may be as old as the gap.
            self._came_ns = self.unread_since_ns or now_ns
            if len(data) > JOB_BYTES:
                data, self._left = data[:JOB_BYTES], data[JOB_BYTES:]
                self._deferred_bytes += len(self._left)
        samples = self._decode(data) if data else 0
        samples += self.idle(now_ns)
        if not self._left:
            self._previous_read_ns = self._came_ns
        self._samples += samples
        return samples

    def _next_part(self, now_ns: int) -> bytes:
        """Return the waiting bytes that this job decodes; the port is not read."""
        if self.tap is not None:
            self.tap.read(now_ns, b'')
        left = self._left
        self._left = left[JOB_BYTES:]
        return left[:JOB_BYTES]

    def _decode(self, data: bytes) -> int:
        """Handle the frames of the bytes that arrived at ``_came_ns``; the rest waits."""
        behind = len(data) + len(self._left)
        samples = 0
        frames = self._decoder.feed(data)
        # Kept for the diagnosis while no valid frame arrives.
        self._strange = b'' if frames else (self._strange + data)[-_STRANGE:]
        for frame in frames:
            arrival_ns = self._came_ns - (behind - frame.end) * self._byte_ns
            if arrival_ns < self._last_frame_ns:
                arrival_ns = self._last_frame_ns
            samples += self.handle(frame, arrival_ns)
            self._last_frame_ns = arrival_ns
            if self.is_set_up():
                self._alive_ns = arrival_ns
        return samples

    def send(self, data: bytes) -> None:
        """
        Send bytes to the device without blocking.

        :raises DeviceError: the port is gone or was not opened.
        """
        try:
            self._opened().write(data)
        except DeviceError as error:
            raise DeviceError(f'{self.name}: {error}') from error

    def diagnosis(self) -> str:
        """Return which device sent the bytes without a valid frame."""
        return SIGNATURES.identify(self._strange, self._baud)

    def silence(self) -> str:
        """Return what to check when no bytes arrive."""
        return silence_of(self._port) or self.IF_SILENT

    def statistics(self) -> DeviceStatistics:
        """Return the current counters."""
        return self._counters()

    def _counters(self, *, lost_samples: int = 0, contradicted: int = 0,
                  more: dict[str, Value] | None = None) -> DeviceStatistics:
        port = self._port
        return DeviceStatistics(
            bytes_read=self._bytes_read + (port.bytes_read if port else 0),
            frames=self._decoder.frames,
            samples=self._samples,
            rejected_bytes=self._decoder.rejected_bytes,
            rejected_frames=self._decoder.rejected_frames,
            ignored_frames=self._ignored_frames,
            last_frame_ns=self._alive_ns,
            lost_samples=lost_samples,
            contradicted_samples=contradicted,
            dropped_write_bytes=self._dropped_write_bytes
            + (port.dropped_write_bytes if port else 0),
            more={**more_of(port), **(more or {})},
            deferred_bytes=self._deferred_bytes,
        )

    @property
    def is_live(self) -> bool:
        """Return whether its bytes come from a port, not from a recording or a test."""
        return self.make_port is open_port

    @property
    def pending_bytes(self) -> int:
        """Return the number of bytes kept until the rest of their frame arrives."""
        return self._decoder.pending_bytes

    @property
    def waiting_bytes(self) -> int:
        """Return the number of bytes that wait for a later job."""
        return len(self._left)

    def _opened(self) -> Port:
        if self._port is None:
            raise DeviceError(f'port {self.settings["port"]} is not open: call open() first')
        return self._port

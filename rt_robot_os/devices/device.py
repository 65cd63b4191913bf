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
The device: ``open``, ``close``, ``read`` and ``write`` for hardware of the robot.

The SensorManager knows only this interface. It asks for the publications, passes one publisher for
each, connects the inputs, and then calls ``receive``, ``write`` and ``read`` periodically or when
bytes arrive.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from dataclasses import field
import time
from types import MappingProxyType
from typing import Any
from typing import ClassVar
from typing import Protocol
from typing import Union

from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.logger import Logger
from rt_robot_os.base.schema import Field
from rt_robot_os.devices.mounted import with_mounting
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.mounting import mounting_of
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.topics.ports import Output
from rt_robot_os.topics.ports import PortOwner

Value = Union[str, int, float]


class SamplePublisher(Protocol):
    """
    The publisher that the SensorManager passes for each publication.

    :ivar msg: view of the message to fill in. It has the attribute names of the ROS message;
        nested numbers may be set together (``msg.angular_velocity = (x, y, z)``); numeric arrays
        are NumPy views. It starts as a new ROS message with the fixed fields set, and keeps its
        values from one publication to the next: a field that never changes may be set once, in
        :meth:`Device.bind`.
    """

    msg: Any

    def fill(self, data: memoryview) -> None:
        """
        Set the tail, or the longest sequence, of ``msg``, in pieces; other tasks may run between.

        After the publication of a sample above 64 KiB ``msg`` is another object.
        """

    def publish(self, stamp_ns: int) -> None:
        """
        Publish what ``msg`` holds.

        :param stamp_ns: arrival of the sample on CLOCK_MONOTONIC.
        """


@dataclass(frozen=True)
class DeviceStatistics:
    """
    Counters of one device since it was made; opening it again does not clear them.

    :ivar bytes_read: bytes read from the port.
    :ivar frames: valid frames, used or not.
    :ivar samples: samples published.
    :ivar rejected_bytes: bytes that belong to no valid frame.
    :ivar rejected_frames: complete frames with a wrong checksum.
    :ivar ignored_frames: valid frames that the driver does not use.
    :ivar last_frame_ns: arrival of the last valid frame on CLOCK_MONOTONIC, 0 = none yet.
    :ivar lost_samples: samples not published because one of their frames is missing.
    :ivar contradicted_samples: samples whose frames contradict each other.
    :ivar dropped_write_bytes: bytes for the device that the port had no room for.
    :ivar more: counters of this kind of device, by name. A string ``warning`` that is not empty
        sets its ``/diagnostics`` to WARN, with that message.
    :ivar deferred_bytes: bytes that waited for a later job, because one job handles a limited
        number.
    """

    bytes_read: int = 0
    frames: int = 0
    samples: int = 0
    rejected_bytes: int = 0
    rejected_frames: int = 0
    ignored_frames: int = 0
    last_frame_ns: int = 0
    lost_samples: int = 0
    contradicted_samples: int = 0
    dropped_write_bytes: int = 0
    more: dict[str, Value] = field(default_factory=dict)
    deferred_bytes: int = 0


class Tap(Protocol):
    """
    Receives a copy of a device's bytes, for a recorder; called in the loop.

    :ivar command: whether the current round wrote first; the SensorManager sets it.
    """

    command: bool

    def read(self, now_ns: int, data: bytes) -> None:
        """Record the bytes that a round read, which may be none."""

    def opened(self, now_ns: int) -> None:
        """Record that the port was opened."""

    def failed(self, now_ns: int) -> None:
        """Record that the port failed in this round."""


class Device(PortOwner, ABC):
    """
    One device.

    :cvar SETTINGS: the keys of the device's section in the configuration.
    :cvar description: one line for lists of drivers.
    :cvar TAPPED: it passes every byte that it reads to :attr:`tap`.
    :cvar SHARES_PORT: several devices may use one port, each with its setting ``address``.
    :cvar ANSWERS: it sends requests and reads the answers on arrival, so it is read on interrupt
        whatever its section says.
    :cvar SERVICES: names of the services of the process that it needs, see
        :mod:`rt_robot_os.devices.service`.
    :cvar OPENING_S: how long it may send nothing after it was opened, if longer than
        ``timeout_s``.
    :cvar IF_SILENT: what to check when no bytes arrive.
    :cvar IF_GARBAGE: what to check when bytes arrive, but no valid frame.
    :cvar IF_UNUSED: what to check when valid frames arrive, but none that gives a sample.
    :ivar name: name of the device in the configuration, used in every error.
    :ivar clock_ns: returns the time; the kernel's clock once the device is managed.
    :ivar log: the device's logger: ``self.log.warn('%d bytes of garbage', count)``.
    :ivar unread_since_ns: set for the first reads after a gap in which the core was suspended:
        bytes in the port may have arrived at any time since then; 0 otherwise.
    :ivar tap: receives a copy of its bytes; None without a recorder.
    :ivar resources: the ``resources`` of its section, by name, to be entered with ``with``.
    :ivar services: the available ones of its ``SERVICES``, by name.

    It may declare :class:`Input` and :class:`Output` at class level, as modules do; they can be
    used from :meth:`open` on. A device that moves something is an
    :class:`rt_robot_os.devices.actuator.Actuator`.
    """

    NOUN = 'device'
    CONNECTED_FROM = 'open()'

    description: ClassVar[str] = ''
    TAPPED: ClassVar[bool] = False
    SHARES_PORT: ClassVar[bool] = False
    ANSWERS: ClassVar[bool] = False
    SERVICES: ClassVar[tuple[str, ...]] = ()
    OPENING_S: ClassVar[float] = 0.0
    IF_SILENT: ClassVar[str] = 'check its power, its wiring and its output settings'
    IF_GARBAGE: ClassVar[str] = ('check the baud rate, and that the connected device is the '
                                 'configured one')
    IF_UNUSED: ClassVar[str] = ('check which messages the device is set to send, and the settings '
                                'of its section')
    resources: Mapping[str, AbstractContextManager[object]] = MappingProxyType({})
    services: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :param settings: a value for each of ``SETTINGS``, already checked.
        """
        super().__init__(name, settings)
        self.log = Logger(name)
        self.clock_ns: Callable[[], int] = time.monotonic_ns
        self.tap: Tap | None = None
        self.unread_since_ns = 0
        self._publishers: tuple[SamplePublisher, ...] = ()

    @classmethod
    def fields(cls) -> tuple[Field, ...]:
        """Return all settings; with a frame, those of its mounting too."""
        return with_mounting(super().fields())

    @classmethod
    def mountings(cls, settings: Mapping[str, Any]) -> Mapping[str, Mounting]:
        """
        Return the mountings of the device's frames, by name: that of its setting ``frame_id``.

        A device with several frames overrides it.

        :param settings: already checked, each by itself.
        :raises ConfigError: they contradict each other; the message names the setting.
        """
        frame_id = settings.get('frame_id', '')
        return {frame_id: mounting_of(settings)} if frame_id else {}

    @abstractmethod
    def open(self) -> None:  # noqa: A003
        """
        Connect to the device.

        :raises DeviceError: it cannot be reached; the message contains the remedy. It may be
            opened again later.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the device; may be called at any time and twice, and does not raise."""

    @abstractmethod
    def read(self, now_ns: int) -> int:
        """
        Read the available bytes without blocking, decode and publish them.

        :param now_ns: the time now on CLOCK_MONOTONIC.
        :return: number of samples published.
        :raises DeviceError: the device is gone. Whatever the bytes are, nothing else is raised.
        """

    def receive(self, now_ns: int, polled: bool) -> int:
        """
        Process its inputs, without blocking, at the beginning of each round.

        Called only if a driver overrides it. Then a publication on an input with ``wake``, and the
        time that it returns, start an additional round, without :meth:`write`.

        :param polled: the round is a periodic one, at the rate of the device.
        :return: the latest time of the next call; 0 when none is needed.
        :raises DeviceError: the device is gone.
        """
        return 0

    def safe_state(self) -> None:
        """
        Bring what the device moves to rest, without blocking; the port is open.

        Called by the failure policy of its task or by the watchdog, in any state of the protocol.
        Only a driver that overrides it has a safe state.

        :raises DeviceError: the device is gone.
        """
        raise NotImplementedError(f'{type(self).__name__} has no safe_state()')

    def rest(self) -> None:
        """
        Go to the safe state, and stay there; earlier commands are discarded.

        :raises DeviceError: the device is gone.
        """
        self.safe_state()

    def wake_up(self, now_ns: int) -> None:
        """Handle the end of a gap in which the core was suspended; called after :meth:`rest`."""

    def input_counters(self) -> Mapping[str, Value]:
        """Return the counters of :meth:`receive`, in addition to those of :meth:`statistics`."""
        return {}

    def write(self, now_ns: int) -> None:
        """
        Send the periodic command of the device, if it has one, without blocking.

        :raises DeviceError: the device is gone.
        """

    def maintain(self, now_ns: int) -> None:
        """
        Do longer work, without waiting; called at low priority while the port is open.

        :raises DeviceError: the device must be reopened.
        """

    def fileno(self) -> int | None:
        """Return the descriptor that becomes readable when data arrive, None if there is none."""
        return None

    def diagnosis(self) -> str:
        """
        Return what the received bytes are although no frame is valid; empty if unknown.

        Called once each time the device goes to FAULT and its port is closed, by the task of low
        priority that recovers devices: it may take milliseconds.
        """
        return ''

    def unused(self) -> str:
        """
        Return why valid frames give no sample, and the remedy; empty if unknown.

        Called once each time that samples are missing.
        """
        return ''

    def silence(self) -> str:
        """Return what to check when no bytes arrive; called once for each FAULT."""
        return self.IF_SILENT

    @classmethod
    def has_safe_state(cls) -> bool:
        """Return whether it has a ``safe_state()`` of its own."""
        return cls.safe_state is not Device.safe_state

    @classmethod
    def receives(cls) -> bool:
        """Return whether it has a ``receive()`` of its own."""
        return cls.receive is not Device.receive

    @property
    def is_released(self) -> bool:
        """Return whether anything except its rate and its bytes releases it."""
        return self.receives() or any(each.wake for each in self.reads())

    def own_rounds_hz(self) -> float:
        """Return the highest rate at which :meth:`receive` requests rounds; 0 when it does not."""
        return 0.0

    @classmethod
    def run_on(cls, settings: Mapping[str, Any]) -> RunOn:
        """
        Return how far its motion continues when this computer stops sending; none for a sensor.

        :param settings: of the device, complete and checked.
        """
        return RunOn()

    def opening_s(self) -> float:
        """Return how long it may send nothing after opening, if longer than ``timeout_s``."""
        return self.OPENING_S

    def quiet_s(self) -> float:
        """Return how long it may normally send nothing, if longer than ``timeout_s``."""
        return 0.0

    def output_rate_hz(self) -> float:
        """Return the setting ``output_rate_hz``, if it has one."""
        return float(self.settings.get('output_rate_hz', 0.0))

    def bind(self, publishers: Sequence[SamplePublisher]) -> None:
        """
        Bind the publishers, in the order of :meth:`publications`, and the outputs to theirs.

        :raises TopicError: their number is not that of the publications, or these leave out one of
            the outputs.
        """
        topics = [spec.topic for spec in self.publications()]
        if len(publishers) != len(topics):
            raise TopicError(
                f'{self.name}: {len(publishers)} publishers for {len(topics)} publications: '
                'bind one for each, in order')
        self._publishers = tuple(publishers)
        for attribute in self.used(Output):
            topic = self.topic_of(attribute)
            if topic not in topics:
                raise TopicError(f'{self.name}: its publications() leave out {topic!r}, its output'
                                 f' {attribute}: add those of super().publications()')
            self.__dict__[attribute] = publishers[topics.index(topic)]

    @abstractmethod
    def statistics(self) -> DeviceStatistics:
        """Return the current counters."""

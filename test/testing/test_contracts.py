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
"""Do the contracts notice the faults that drivers have, and nothing in a driver without one."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
import inspect
import math
import struct
import time
from time import sleep
from typing import Any
from typing import NamedTuple

import pytest

from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.framing import FrameDecoder
from rt_robot_os.devices.framing import StreamDecoder
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.testing import DriverContract

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

# A5, length of the rest, three numbers, and what makes the sum of all 0.
_NUMBERS = struct.Struct('<3f')


def encode(x: float, y: float, z: float) -> bytes:
    body = b'\xa5\x0d' + _NUMBERS.pack(x, y, z)
    return body + bytes((-sum(body) & 0xFF,))


class Frame(NamedTuple):
    values: tuple[float, ...]
    size: int
    end: int


class Decoder(FrameDecoder[Frame]):
    STARTS = b'\xa5'
    SHORTEST = 15
    LONGEST = 15

    def end(self, buffer: bytes, at: int) -> int:
        return at + 15 if buffer[at + 1] == 13 else 0

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Frame | None:
        if sum(buffer[at:end]) & 0xFF:
            return None
        return Frame(_NUMBERS.unpack_from(buffer, at + 2), end - at, arrived)


class Driver(SerialDevice[Frame]):
    SETTINGS = serial_settings(baud=9600, frame_id='base_link', topic='force', rate_hz=10.0)
    description = 'force on three axes'
    decoder: type[Any] = Decoder

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        super().__init__(name, settings, self.decoder())

    def publications(self) -> tuple[TopicSpec, ...]:
        s = self.settings
        return (TopicSpec(s['topic'], 'geometry_msgs/msg/Vector3Stamped',
                          {'header.frame_id': s['frame_id']}, s['depth'], 10.0),)

    def handle(self, frame: Frame, arrival_ns: int) -> int:
        if not math.isfinite(sum(frame.values)):
            self._ignored_frames += 1
            return 0
        return self.publish(frame.values, arrival_ns)

    def publish(self, values: Iterable[float], arrival_ns: int) -> int:
        self._publishers[0].msg.vector = tuple(values)
        self._publishers[0].publish(arrival_ns)
        return 1


class Contract(DriverContract):
    """Not collected: its name does not begin with Test."""

    driver = Driver
    stream = encode(1.0, 2.0, 3.0) + encode(-1.0, 0.5, 2.0) + encode(0.25, 8.0, -4.0)
    samples = 3
    tokens = (b'\xa5', b'\xa5\x0d', encode(0.0, 0.0, 0.0)[:9], encode(5.0, 5.0, 5.0))
    vectors = ((encode(1.0, -2.0, 3.0), {'vector.x': 1.0, 'vector.y': -2.0, 'vector.z': 3.0}),)

    def decoder(self) -> Any:
        return self.driver.decoder()

    def frame_size(self, frame: Frame) -> int:
        return frame.size


def names_of_tests(kind: type[Contract]) -> list[str]:
    """Give the tests that need no pty."""
    return [name for name in dir(kind) if name.startswith('test_')
            and list(inspect.signature(getattr(kind, name)).parameters) == ['self']]


@pytest.mark.parametrize('name', names_of_tests(Contract))
def test_a_driver_without_a_fault_passes(name: str) -> None:
    getattr(Contract(), name)()


# --- the faults ---------------------------------------------------------------------------------

class NeverChecks(Decoder):
    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Frame | None:
        return Frame(_NUMBERS.unpack_from(buffer, at + 2), end - at, arrived)


class Endless(Decoder):
    LONGEST = 100_000

    def end(self, buffer: bytes, at: int) -> int:
        return at + 2 + 7800 * max(buffer[at + 1] - 13, 0) + buffer[at + 1]


class Ahead(Decoder):
    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Frame | None:
        return super().frame(buffer, at, end, end)


class Raises(Decoder):
    def end(self, buffer: bytes, at: int) -> int:
        if buffer[at + 1] == 0xA5:
            raise ValueError('two beginnings')
        return super().end(buffer, at)


class Forgets(Decoder):
    def reset(self) -> None:
        self._pending = b''


class Hoards(StreamDecoder[Frame]):
    """Waits for ever for the end of what may be a frame."""

    def feed(self, data: bytes) -> list[Frame]:
        self._pending += data
        return []


class SumsUp(Decoder):
    """Adds up as many bytes for each beginning as the frame might have."""

    LONGEST = 4000

    def end(self, buffer: bytes, at: int) -> int:
        size = buffer[at + 1] * 16
        return at + 15 if size == 208 else at + size + 15

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Frame | None:
        return None if sum(buffer[at:end]) & 0xFF or end - at > 15 else super().frame(
            buffer, at, end, arrived)


class Sleeps(Driver):
    def handle(self, frame: Frame, arrival_ns: int) -> int:
        time.sleep(0.05)
        return super().handle(frame, arrival_ns)


class SleepsByAnotherName(Driver):
    def idle(self, now_ns: int) -> int:
        sleep(0.001)
        return 0


class Remembers(Driver):
    """Smooths, and goes on with the old value after opening again."""

    mean = 0.0

    def handle(self, frame: Frame, arrival_ns: int) -> int:
        self.mean += (frame.values[0] - self.mean) / 4
        return self.publish((self.mean, *frame.values[1:]), arrival_ns)


class PassesOn(Driver):
    def handle(self, frame: Frame, arrival_ns: int) -> int:
        return self.publish(frame.values, arrival_ns)


class TurnsRound(Driver):
    def handle(self, frame: Frame, arrival_ns: int) -> int:
        x, y, z = frame.values
        return self.publish((x, -y, z), arrival_ns)


class Swaps(Driver):
    def handle(self, frame: Frame, arrival_ns: int) -> int:
        x, y, z = frame.values
        return self.publish((y, x, z), arrival_ns)


def planted(fault: type[Any]) -> type[Contract]:
    """Give a contract whose driver has the fault."""
    driver = fault if issubclass(fault, Driver) else type('Faulty', (Driver,), {'decoder': fault})
    return type('Planted', (Contract,), {'driver': driver})


FAULTS: list[tuple[type[Any], str, dict[str, Any]]] = [
    (NeverChecks, 'test_a_frame_with_a_wrong_byte_is_none', {}),
    (Endless, 'test_no_header_makes_it_wait_for_more_than_its_limit', {}),
    (Endless, 'test_no_header_makes_it_wait_for_more_than_its_limit', {'pending_limit': 100_001}),
    (Hoards, 'test_nothing_makes_it_keep_more_than_its_limit', {}),
    (Ahead, 'test_any_bytes_raise_nothing_and_every_byte_is_accounted_for', {}),
    (Raises, 'test_any_bytes_raise_nothing_and_every_byte_is_accounted_for', {}),
    (Forgets, 'test_half_a_frame_is_not_completed_by_what_comes_after_opening_again', {}),
    (SumsUp, 'test_no_bytes_cost_much_more_than_good_ones', {'pending_limit': 4100}),
    (Sleeps, 'test_nothing_in_the_loop_sleeps', {}),
    (SleepsByAnotherName, 'test_nothing_in_the_loop_sleeps', {}),
    (Remembers, 'test_what_came_before_opening_again_changes_nothing', {}),
    (PassesOn, 'test_what_is_not_finite_is_no_data', {}),
    (TurnsRound, 'test_the_sense_of_each_axis', {}),
    (TurnsRound, 'test_every_axis_has_a_vector', {'vectors': ()}),
    (Swaps, 'test_the_sense_of_each_axis', {}),
]


@pytest.mark.parametrize('fault, name, changes', FAULTS, ids=lambda v: getattr(v, '__name__', ''))
def test_a_planted_fault_is_caught(fault: type[Any], name: str, changes: dict[str, Any]) -> None:
    kind = type('Changed', (planted(fault),), changes)
    with pytest.raises((AssertionError, ValueError)):
        getattr(kind(), name)()

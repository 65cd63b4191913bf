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

"""Are packets of the Kobuki base written as its own driver does, and read whatever comes."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.kobuki import wire
from rt_robot_os.devices.kobuki.wire import CoreSensors
from rt_robot_os.devices.kobuki.wire import KobukiDecoder

CORE = CoreSensors(4711, 2, 1, 4, 65535, 1, -20, 20, 4, 22, 167, 3)


def frame(*parts: tuple[int, bytes]) -> wire.KobukiFrame:
    found, = KobukiDecoder().feed(wire.packet(parts))
    return found


@pytest.mark.parametrize('linear, angular, packet', [
    (0.2, 0.0, 'aa 55 06 01 04 c8 00 00 00 cb'),
    (0.0, 1.0, 'aa 55 06 01 04 73 00 01 00 71'),
    (0.2, 0.5, 'aa 55 06 01 04 01 01 90 01 92')])
def test_velocity_commands_are_those_of_the_vectors(
        linear: float, angular: float, packet: str) -> None:
    assert wire.velocity_command(linear, angular) == bytes.fromhex(packet)


@given(linear=st.floats(-0.7, 0.7), angular=st.floats(-3.2, 3.2))
def test_the_base_does_what_was_meant(linear: float, angular: float) -> None:
    done = wire.velocity_of(*wire.base_control(linear, angular))
    # A millimetre a second at the rim is cut off, and a millimetre of the radius.
    assert done[0] == pytest.approx(linear, abs=0.005 + 0.004 * abs(angular))
    assert done[1] == pytest.approx(angular, abs=0.02 + 0.02 * abs(angular))


@given(linear=st.floats(-1e308, 1e308), angular=st.floats(-1e308, 1e308))
def test_what_has_no_room_is_limited_and_never_wraps(linear: float, angular: float) -> None:
    speed, radius = wire.base_control(linear, angular)
    assert -32767 <= speed <= 32767
    assert -32767 <= radius <= 32767
    if abs(linear) > 1.0 and abs(angular) < abs(linear):
        assert math.copysign(1, speed) == math.copysign(1, linear)


def test_a_wide_arc_is_no_narrow_one() -> None:
    # A radius of 5 km does not fit into 16 bits.
    assert wire.base_control(0.5, 1.01e-4) == (500, 0)


def test_core_data() -> None:
    found = frame(wire.core(CORE))
    assert wire.core_of(found) == CORE
    assert wire.core_of(frame((wire.DOCK, b'abc'))) is None
    assert wire.core_of(frame((wire.CORE, b'abc'))) is None


@given(heading=st.floats(-400.0, 400.0), rate=st.floats(-5.0, 5.0))
def test_heading_and_rate(heading: float, rate: float) -> None:
    _, data = wire.inertia(heading, rate)
    found = wire.heading(data)
    assert found is not None
    assert math.cos(found[0] - heading) == pytest.approx(1.0, abs=1e-6)
    assert -math.pi <= found[0] <= math.pi
    assert found[1] == pytest.approx(rate, abs=2e-4)
    assert wire.heading(data[:3]) is None


def test_the_gyroscope_is_mounted_a_quarter_of_a_turn_off() -> None:
    # Frame 7, two measurements: raw x, y, z.
    data = bytes((7, 6)) + b'\x64\x00\xc8\x00\x2c\x01' + b'\x00\x00\x00\x00\x9c\xff'
    first, second = wire.angular_velocities(data)
    digit = math.radians(0.00875)
    assert first == pytest.approx((-200 * digit, 100 * digit, 300 * digit))
    assert second == pytest.approx((0.0, 0.0, -100 * digit))
    number, sent = wire.gyro(7, [first, second])
    assert (number, sent) == (wire.GYRO, data)


@given(data=st.binary(max_size=30))
def test_any_gyroscope_data_harms_nothing(data: bytes) -> None:
    assert len(wire.angular_velocities(data)) * 6 <= max(len(data) - 2, 0)


def test_versions() -> None:
    assert wire.version(b'\x00\x02\x01\x00') == '1.2.0'
    assert wire.version(b'\x00') == ''


def test_parts_that_do_not_fill_the_payload_are_no_packet() -> None:
    for payload in (b'\x01\x01', b'\x01\x05abc', b'\x01\x01a\x02\x00', b'\x01\x02ab\x02'):
        content = bytes((len(payload),)) + payload
        decoder = KobukiDecoder()
        assert decoder.feed(b'\xaa\x55' + content + bytes((wire.checksum(content),))) == []


def test_a_packet_inside_a_false_beginning_is_found() -> None:
    good = wire.packet([wire.core(CORE)])
    decoder = KobukiDecoder()
    assert len(decoder.feed(b'\xaa\x55\x20\x01\x0f' + good + good)) == 2
    assert decoder.rejected_bytes == 5


def test_it_is_recognised() -> None:
    packet = wire.packet([wire.core(CORE), wire.inertia(1.0, 0.0)])
    assert wire.is_kobuki(packet[5:] + packet * 2)
    assert not wire.is_kobuki(packet)
    assert not wire.is_kobuki(wire.velocity_command(0.1, 0.0) * 9)

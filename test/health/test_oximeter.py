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

"""Does the pulse oximeter publish numbers only while they are some, and say how good they are."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.features.health.oximeter import wire
from rt_robot_os.features.health.oximeter.driver import Oximeter
from rt_robot_os.features.health.oximeter.wire import Format2Decoder
from rt_robot_os.features.health.oximeter.wire import Format7Decoder
from rt_robot_os.testing import DriverContract
from rt_robot_os.testing import scripted

PLAIN = [0] * wire.FRAMES
WAVE = [30_000 + 100 * n for n in range(wire.FRAMES)]


def packet(pulse: int = 72, spo2: int = 97, status: int = 0, data_format: int = 7,
           statuses: Any = None, **more: Any) -> bytes:
    return wire.packet(data_format, statuses or [status] * wire.FRAMES, WAVE,
                       wire.float_bytes(pulse, spo2, **more))


class TestOximeter(DriverContract):
    driver = Oximeter
    stream = b''.join(packet(70 + n, 95, timer=n, statuses=[
        wire.GOOD if k < 12 else 0 for k in range(wire.FRAMES)]) for n in range(3))
    samples = 12
    tokens = (b'\x81', b'\xff', packet()[:5], packet()[:124], packet()[5:], packet(data_format=2),
              b'\x81\x00\x00\x00\x81', bytes(5), wire.ACCEPTED)

    def decoder(self) -> Any:
        return Format7Decoder()

    def frame_size(self, frame: Any) -> int:
        return wire.PACKET_SIZE

    def test_publications_name_topic_type_and_what_is_fixed(self) -> None:
        device, _ = self.make('nowhere')
        assert [(each.topic, each.message, each.rate_hz) for each in device.publications()] == [
            ('oximeter/pulse_per_min', 'std_msgs/msg/Float64', 3.0),
            ('oximeter/spo2_percent', 'std_msgs/msg/Float64', 3.0),
            ('oximeter/pleth', 'std_msgs/msg/UInt16MultiArray', 3.0),
            ('oximeter/status', 'std_msgs/msg/String', 3.0)]


class TestFormat2(TestOximeter):
    changes = {'data_format': 2}
    stream = b''.join(packet(70 + n, 95, timer=n, data_format=2) for n in range(3))
    tokens = (b'\x01', b'\x01\x81', packet(data_format=2)[:5], packet(data_format=2)[:124],
              packet(data_format=2)[5:], packet(), b'\x01\x81\x00\x00\x82', bytes(5))

    def decoder(self) -> Any:
        return Format2Decoder()


def told(*packets: bytes, **changes: Any) -> tuple[list[float], list[float], list[str], Any]:
    """Return pulses, saturations, states and statistics of what a device sends."""
    with scripted(Oximeter, list(packets), **changes) as (device, publishers):
        for _ in packets:
            device.read(10**9)
        found = [[sample.data for sample in each.samples] for each in publishers]
        return found[0], found[1], found[3], device.statistics()


# ---- the bytes --------------------------------------------------------------------------------

def test_a_frame_of_each_format_is_that_of_the_specification() -> None:
    # Status with SYNC and a good pulse, sample 0x1234, float byte 0x48; the sum modulo 256.
    assert wire.frame(7, wire.SYNC | wire.GOOD, 0x1234, 0x48) == bytes.fromhex('83 12 34 48 11')
    assert wire.frame(2, wire.SYNC | wire.GOOD, 0x1234, 0x48) == bytes.fromhex('01 83 12 48 de')
    assert wire.format_command(7) == bytes.fromhex('02 70 02 02 07 03')


def test_pulse_and_timer_are_put_together_of_seven_bits_each() -> None:
    found, = Format7Decoder().feed(packet(300, 88, timer=12_345))
    assert (found.pulse(wire.PULSE_4), found.pulse(wire.PULSE_8_DISPLAYED)) == (300, 300)
    assert found.float_byte(wire.SPO2_8) == 88
    assert found.timer() == 12_345
    # Reserved bits beside the two high ones of a rate mean nothing.
    floats = bytearray(wire.float_bytes(300, 88))
    floats[wire.PULSE_4] |= 0x7C
    found, = Format7Decoder().feed(wire.packet(7, PLAIN, WAVE, floats))
    assert found.pulse(wire.PULSE_4) == 300


@given(statuses=st.lists(st.integers(0, 255), min_size=25, max_size=25),
       pleth=st.lists(st.integers(0, 65535), min_size=25, max_size=25),
       floats=st.binary(min_size=25, max_size=25), data_format=st.sampled_from((2, 7)))
def test_every_packet_comes_out_as_it_went_in(
    statuses: list[int], pleth: list[int], floats: bytes, data_format: int,
) -> None:
    found, = wire.DECODERS[data_format]().feed(wire.packet(data_format, statuses, pleth, floats))
    assert found.pleth() == ([each >> 8 for each in pleth] if data_format == 2 else pleth)
    assert [each & 0x7E for each in found.statuses] == [each & 0x7E for each in statuses]
    assert [found.float_byte(k) for k in range(25)] == [each & 0x7F for each in floats]


@given(data=st.lists(st.binary(max_size=200) | st.sampled_from(
    [packet(), packet(data_format=2), packet()[:60], packet()[60:]]), max_size=6))
def test_nothing_is_made_of_parts_of_packets(data: list[bytes]) -> None:
    stream = b''.join(data)
    for number, decoder in wire.DECODERS.items():
        for found in decoder().feed(stream):
            at = found.end - wire.PACKET_SIZE
            assert stream[at:found.end] == found.data
            assert found.statuses[0] & wire.SYNC, number
            assert not any(each & wire.SYNC for each in found.statuses[1:])


def test_a_lost_byte_costs_its_packet_and_no_other() -> None:
    stream = b''.join(packet(70 + n, timer=n) for n in range(4))
    pulses, _, _, statistics = told(stream[:160] + stream[161:])
    assert pulses == [70, 72, 73]
    assert (statistics.lost_samples, statistics.rejected_bytes) == (1, 124)


def test_the_counter_of_packets_goes_round() -> None:
    turn = wire.TIMER_TURN
    _, _, _, statistics = told(*(packet(timer=n % turn) for n in range(turn - 2, turn + 2)))
    assert statistics.lost_samples == 0
    # A device that was switched off in between has lost nothing.
    _, _, _, statistics = told(packet(timer=9000), packet(timer=0))
    assert statistics.lost_samples == 0


# ---- what is a value --------------------------------------------------------------------------

def test_pulse_saturation_and_wave_are_published_with_the_arrival() -> None:
    with scripted(Oximeter, [packet(72, 97)]) as (device, publishers):
        assert device.read(5 * 10**9) == 4
        assert [each.stamps for each in publishers] == [[5 * 10**9]] * 4
        pulse, spo2, pleth, status = (each.samples[0] for each in publishers)
    assert (pulse.data, spo2.data) == (72.0, 97.0)
    assert list(pleth.data) == WAVE
    assert pleth.layout.dim[0].size == 25
    assert status.data == 'measuring'


@pytest.mark.parametrize('status, state, counter', [
    (wire.NO_FINGER, 'no finger', 'packets_without_finger'),
    (wire.DISCONNECTED, 'disconnected', 'packets_disconnected'),
    (wire.DISCONNECTED | wire.NO_FINGER, 'disconnected', 'packets_disconnected'),
    (wire.OUT_OF_TRACK, 'out of track', 'packets_out_of_track')])
def test_what_a_device_says_without_a_good_finger_is_no_value(
        status: int, state: str, counter: str) -> None:
    # One frame of 25 is enough: the finger is leaving.
    statuses = [0] * 24 + [status]
    pulses, spo2s, states, statistics = told(packet(), packet(40, 80, statuses=statuses), packet())
    assert (pulses, spo2s) == ([72, 72], [97, 97])
    assert states == ['measuring', state, 'measuring']
    assert statistics.more[counter] == 1
    warned = told(packet(statuses=statuses))[3]
    assert warned.more['warning']


def test_the_missing_codes_are_never_values() -> None:
    pulses, spo2s, states, statistics = told(
        packet(wire.NO_PULSE, wire.NO_SPO2), packet(72, wire.NO_SPO2), packet(wire.NO_PULSE, 97))
    assert (pulses, spo2s) == ([72], [97])
    assert states == ['searching', 'measuring', 'searching']
    assert (statistics.more['pulse_missing'], statistics.more['spo2_missing']) == (2, 2)


@given(pulse=st.integers(0, 511), spo2=st.integers(0, 127), status=st.integers(0, 127))
def test_whatever_a_device_says_only_plausible_values_are_published(
        pulse: int, spo2: int, status: int) -> None:
    pulses, spo2s, _, statistics = told(packet(pulse, spo2, status))
    assert all(10 <= each <= 350 for each in pulses)
    assert all(1 <= each <= 100 for each in spo2s)
    shown = not status & (wire.NO_FINGER | wire.DISCONNECTED | wire.OUT_OF_TRACK)
    assert len(pulses) == (shown and 10 <= pulse <= 350)
    assert len(spo2s) == (shown and 1 <= spo2 <= 100)
    absurd = (not 10 <= pulse <= 350 and pulse != 511) + (not 1 <= spo2 <= 100 and spo2 != 127)
    assert statistics.contradicted_samples == (absurd if shown else 0)


def test_the_values_for_the_display_which_stay_are_not_used() -> None:
    gone = packet(wire.NO_PULSE, wire.NO_SPO2, displayed=(72, 97))
    assert told(packet(), gone)[:2] == ([72], [97])


@pytest.mark.parametrize('changes, pulse, spo2', [
    ({}, 71, 91), ({'average_beats': 8}, 72, 92), ({'spo2': 'fast'}, 71, 93),
    ({'spo2': 'beat', 'average_beats': 8}, 72, 94)])
def test_which_average_is_a_setting(changes: dict[str, Any], pulse: int, spo2: int) -> None:
    floats = bytearray(wire.float_bytes(wire.NO_PULSE, wire.NO_SPO2))
    for place, value in ((wire.PULSE_4, 71), (wire.PULSE_8, 72)):
        floats[place:place + 2] = bytes((0, value))
    for place, value in ((wire.SPO2_4, 91), (wire.SPO2_8, 92), (wire.SPO2_FAST, 93),
                         (wire.SPO2_BEAT, 94)):
        floats[place] = value
    data = wire.packet(7, PLAIN, WAVE, floats)
    assert told(data, **changes)[:2] == ([pulse], [spo2])


def test_pulses_artefacts_and_the_battery_are_counted_and_told() -> None:
    beat = [wire.MARGINAL if k < 12 else 0 for k in range(25)]
    moved = [wire.POOR | wire.ARTEFACT if k > 20 else 0 for k in range(25)]
    end = [wire.POOR | wire.ARTEFACT if k < 5 else 0 for k in range(25)]
    _, _, states, statistics = told(
        packet(statuses=beat), packet(statuses=moved), packet(statuses=end),
        packet(status_2=wire.BATTERY_LOW))
    assert states == ['measuring, perfusion marginal', 'measuring, perfusion poor, artefact',
                      'measuring, perfusion poor', 'measuring, perfusion poor, battery low']
    more = statistics.more
    # A pulse that goes on in the next packet is one.
    assert (more['artefacts'], more['marginal_pulses'], more['poor_pulses']) == (1, 1, 1)
    assert more['warning'] == 'its batteries are low'


def test_the_format_is_ordered_until_it_comes() -> None:
    with scripted(Oximeter, [b'\x06' + packet()], configure=True) as (device, _):
        device.write(10**9)
        device.write(15 * 10**8)
        assert b''.join(device._port.written) == wire.format_command(7)
        device.write(20 * 10**8)
        assert b''.join(device._port.written) == 2 * wire.format_command(7)
        device.read(21 * 10**8)
        device.write(40 * 10**8)
        assert b''.join(device._port.written) == 2 * wire.format_command(7)


def test_another_format_is_recognised() -> None:
    seven, two = packet() + packet()[:50], packet(data_format=2) * 2
    assert (wire.is_format_7(seven), wire.is_format_2(seven)) == (True, False)
    assert (wire.is_format_7(two), wire.is_format_2(two)) == (False, True)

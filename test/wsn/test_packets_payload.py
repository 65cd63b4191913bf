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

"""Payloads that users declare, and the sensors of motes."""

from __future__ import annotations

import doctest
import math
from pathlib import Path
import re
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base import plugins
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.packets import conversions
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.payload import check_payloads
from rt_robot_os.features.wsn.packets.payload import installed_payloads
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.payload import PayloadField
from rt_robot_os.features.wsn.packets.payload_text import known_payloads
from rt_robot_os.features.wsn.packets.payload_text import parse_payload
from rt_robot_os.features.wsn.packets.payload_text import parse_payloads
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.surge import SurgeMsg
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.sensor_packets import decoder_from
import yaml

ROOT = Path(__file__).resolve().parents[2]
SOIL = Payload('soil', 0x42, (
    PayloadField('moisture', 'H', '%', quantity='soil_moisture_percent', scale=0.1),
    PayloadField('skin', 'H', quantity='temperature', conversion='sht1x_temperature')))
VALUES = {'moisture': 231, 'skin': 6450}
READINGS = {'soil_moisture_percent': 23.1, 'temperature': 24.9}


def t2(payload: bytes, am_type: int = 0x42) -> bytes:
    """Make a packet of TinyOS 2.x."""
    return SerialAm(0, 7, am_type, payload).pack()


def decoded(packet: bytes, *payloads: Payload) -> Packet:
    """Decode a packet with payloads of one's own."""
    return PacketDecoder(payloads=payloads).decode(packet)


def test_the_page_about_packets_says_what_is_so() -> None:
    page = ROOT / 'docs' / 'packets.md'
    found = doctest.testfile(str(page), module_relative=False)
    assert found.attempted > 15 and found.failed == 0
    # What stands there as a text is the same as what stands there in Python.
    text, = re.findall(r"payloads: \['(.*)'\]", page.read_text())
    assert parse_payload(text).fields[2:4] == (
        PayloadField('moisture', 'H', '0.1%', quantity='soil_moisture_percent', scale=0.1),
        PayloadField('air', 'H', quantity='temperature', conversion='sht1x_temperature'))


def test_a_payload_is_read_wherever_it_stands() -> None:
    big, little = SOIL.pack(VALUES, True), SOIL.pack(VALUES, False)
    assert (big.hex(), little.hex()) == ('00e71932', 'e7003219')
    routed = TelosMsg(0x7E, 0x42, MultihopMsg(1, 5, 1, 2, 3, little).pack()).pack()
    collected = SerialAm(0, 3, 0x74, LqiData(5, 9, 2, 1, 0x42, big).pack()).pack()
    plain = Payload('soil', 0x42, SOIL.fields, routed=False)
    for packet, payload, origin in (
            (t2(big), SOIL, -1), (routed, SOIL, 5), (collected, SOIL, 5),
            (TelosMsg(0x7E, 0x42, little).pack(), plain, -1)):
        found = decoded(packet, payload)
        assert (found.name, found.kind, found.origin, found.problem) == (
            'soil', 'data', origin, '')
        assert found.readings == pytest.approx(READINGS)
        assert {key: found.fields[key] for key in VALUES} == VALUES
    # Nobody has declared it: then it is counted.
    assert decoded(t2(big)).kind == 'unknown'


def test_the_order_of_bytes_may_be_said() -> None:
    little = parse_payload('soil 0x42 little moisture:H skin:H')
    assert decoded(t2(SOIL.pack(VALUES, False)), little).fields == VALUES


def test_lists_bytes_and_gaps() -> None:
    payload = parse_payload('many 1 a:3B _:1x name:4s ok:? last:2h=pulse_per_min,0.5,10')
    found = decoded(t2(bytes.fromhex('010203 ff 74657374 01 fffe 0028'), 1), payload)
    assert found.fields == {'a': (1, 2, 3), 'name': '74657374', 'ok': True, 'last': (-2, 40)}
    assert found.readings == {'pulse_per_min': 30.0}


def test_what_came_of_the_origin_stands_for_the_packet() -> None:
    payload = parse_payload('own 1 origin:H seqno:B parent:H hops:B')
    found = decoded(t2(bytes.fromhex('0005 07 0003 02'), 1), payload)
    assert (found.origin, found.origin_seqno, found.parent, found.hops) == (5, 7, 3, 2)


def test_humidity_takes_the_temperature_of_the_packet() -> None:
    payload = parse_payload('air 1 damp:H=humidity,sht1x_humidity warm:H=temperature,'
                            'sht1x_temperature')
    found = decoded(t2(payload.pack({'damp': 1500, 'warm': 7960}, True), 1), payload)
    linear = -4 + 0.0405 * 1500 - 2.8e-6 * 1500 ** 2
    assert found.readings == pytest.approx(
        {'temperature': 40.0, 'humidity': ((40 - 25) * (0.01 + 0.00008 * 1500) + linear) / 100})


def test_one_of_ones_own_goes_before_what_is_built_in_if_its_size_fits() -> None:
    light = parse_payload('lamp 17 type:H light:H=light,par_illuminance parent:H seq_no:I')
    body = SurgeMsg(0, 1000, 3, 42).pack()
    found = decoded(TelosMsg(0, 17, MultihopMsg(1, 5, 1, 2, 3, body).pack()).pack(), light)
    assert (found.name, round(found.readings['light'])) == ('lamp', 2289)
    other = decoded(TelosMsg(0, 17, MultihopMsg(1, 5, 1, 2, 3, body + bytes(4)).pack()).pack(),
                    light)
    assert other.name == 'data_msg'


def test_payloads_of_one_type_are_told_apart_by_size() -> None:
    small, large = parse_payload('small 1 a:H'), parse_payload('large 1 a:H b:H')
    assert decoded(t2(bytes(2), 1), small, large).name == 'small'
    assert decoded(t2(bytes(4), 1), small, large).name == 'large'
    cut = decoded(t2(bytes(1), 1), large)
    assert cut.problem == 'too short: 1 bytes, large has 4'
    long = decoded(t2(bytes(9), 1), large)
    assert (long.problem, long.readings) == ('5 bytes more than large has', {})


def test_what_is_no_number_is_no_reading() -> None:
    payload = parse_payload('f 1 a:f=temperature b:f=pulse_per_min c:f=light')
    found = decoded(t2(bytes.fromhex('7f800000 42900000 7fc00000'), 1), payload)
    assert (found.problem, found.readings) == ('', {'pulse_per_min': 72.0})


@pytest.mark.parametrize(('text', 'said'), [
    ('soil', "payload 'soil': must be NAME AM_TYPE FIELD ..., such as soil 0x42"),
    ('soil x a:H', "payload 'soil': the AM type 'x' must be a number from 0 to 255"),
    ('soil 300 a:H', "payload 'soil': the AM type 300 must be a number from 0 to 255"),
    ('soil 1 a', "payload 'soil', field 'a': must be name:code[unit]=quantity"),
    ('soil 1 a:Z', "payload 'soil', field 'a': the code 'Z' must be one of b B h H"),
    ('soil 1 a:0H', "the code '0H' must be one of"),
    ('soil 1 a:H=temperature,sht', "there is no conversion 'sht': use one of sht1x_temperature"),
    ('soil 1 a:H=temperature,0', 'scale 0.0 and offset 0.0 must be finite, and the scale not 0'),
    ('soil 1 a:H=temperature,1,x', "field 'a': the offset 'x' must be a number"),
    ('soil 1 a:H=temperature,sht1x_temperature,2', 'a conversion takes no offset'),
    ('soil 1 a:H=Wet', "'Wet' is not a name of a quantity"),
    ('soil 1 a:4s=temperature', "the code '4s' gives no number"),
    ('soil 1 a:H a:H', "field 'a': the field 'a' is there twice; rename one"),
    ('soil 1 a:H=light b:H=light', "field 'b': the quantity 'light' is there twice"),
    ('soil 1 big', "payload 'soil' has no fields"),
    ('soil 1 big little a:H', "the byte order 'biglittle' must be little or big"),
    ('1soil 1 a:H', "payload '1soil': the name must be a letter"),
    ('soil 1 a:100Q', "payload 'soil' has 800 bytes: no packet can hold more than 114")])
def test_a_mistake_names_payload_field_value_and_remedy(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as stop:
        parse_payload(text)
    assert said in str(stop.value)


def test_all_mistakes_are_told_at_once() -> None:
    with pytest.raises(ConfigError) as stop:
        parse_payloads(['a 1 x:Z y:Q=Bad', {'name': 'b', 'fields': [{'nam': 'c'}]}, 7])
    assert [each.partition(':')[0] for each in stop.value.problems] == [
        "payload 'a', field 'x'", "payload 'a', field 'y'", "payload 'b'", "payload 'b', field ''",
        "payload 'b', field ''", "payload 'b', field ''", 'payload 7']


def test_mappings_say_the_same_as_texts() -> None:
    mapping = yaml.safe_load("""
name: soil
am_type: 0x42
fields:
- {name: moisture, code: H, unit: '%', quantity: soil_moisture_percent, scale: 0.1}
- skin:H=temperature,sht1x_temperature
""")
    assert parse_payload(mapping) == SOIL == parse_payload(
        'soil 0x42 moisture:H[%]=soil_moisture_percent,0.1 skin:H=temperature,sht1x_temperature')


def test_payloads_that_cannot_be_told_apart_are_refused() -> None:
    with pytest.raises(ConfigError, match="payload 'soil' is there twice"):
        check_payloads([SOIL, SOIL])
    with pytest.raises(ConfigError, match='both have the AM type 0x42 and 4 bytes'):
        PacketDecoder(payloads=[SOIL, parse_payload('other 0x42 a:I')])


def test_packages_add_payloads_by_entry_points(monkeypatch: pytest.MonkeyPatch) -> None:
    def add(targets: dict[str, str]) -> None:
        monkeypatch.setattr(plugins, 'installed', lambda path: {'rt_robot_os.payloads': targets})

    monkeypatch.setattr('rt_robot_os.features.wsn.packets.conversions.SOIL', SOIL, raising=False)
    add({'soil': 'rt_robot_os.features.wsn.packets.conversions:SOIL'})
    assert installed_payloads() == known_payloads([]) == (SOIL,)
    # One of a configuration stands in for it.
    own, = known_payloads(['soil 0x43 a:H'])
    assert own.am_type == 0x43
    # Whatever reads packets knows it.
    from_settings = {'stack': 'auto', 'payloads': [], 'platform': 'auto', 'group': -1}
    found = decoder_from('readings', from_settings).decode(t2(SOIL.pack(VALUES, True)))
    assert found.readings == pytest.approx(READINGS)
    add({'soil': 'rt_robot_os.features.wsn.packets.conversions:CONVERSIONS'})
    with pytest.raises(ConfigError, match="payload 'soil' .* is broken: not a Payload but a dict"):
        installed_payloads()


def test_a_node_can_make_what_is_read() -> None:
    assert SOIL.pack({}, True) == bytes(4)
    with pytest.raises(ValueError, match="payload 'soil' cannot hold"):
        SOIL.pack({'moisture': 70000}, True)


# --- sensors -------------------------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'raw', 'value'), [
    ('sht1x_temperature', 6450, 24.9), ('sht1x_humidity', 1500, 0.5045),
    ('adc_volts', 4096, 1.5), ('battery_volts', 4096, 3.0), ('centikelvin', 31015, 37.0),
    ('par_illuminance', 1000, 2288.8), ('tsr_illuminance', 1000, 281.6)])
def test_the_sensors_of_tmote_sky(name: str, raw: int, value: float) -> None:
    assert conversions.CONVERSIONS[name].convert(raw) == pytest.approx(value, rel=1e-4)


@given(st.sampled_from(sorted(conversions.CONVERSIONS)), st.integers(0, 4095))
def test_a_simulated_sensor_gives_what_was_meant(name: str, raw: int) -> None:
    conversion = conversions.CONVERSIONS[name]
    assert abs(conversion.raw(conversion.convert(raw)) - raw) <= 1
    for beyond in (-1e6, 1e6, conversion.convert(raw) + 1e5):
        limited: Any = conversion.raw(beyond)
        assert 0 <= limited <= 65535 and math.isfinite(conversion.convert(limited))


def test_a_field_that_counts_the_packets_says_what_was_lost() -> None:
    own = parse_payload('surge 17 type:H light:H=light,par_illuminance parent:H seq_no:I')
    packet = TelosMsg(0x7E, 17, MultihopMsg(0, 5, 9, 9, 2, own.pack(
        {'light': 100, 'parent': 3, 'seq_no': 70_000}, False)).pack()).pack()
    found = PacketDecoder('tinyos1', [own]).decode(packet)
    assert (found.count, found.count_bits, found.parent, found.origin) == (70_000, 32, 3, 5)
    assert (found.hops, found.origin_seqno) == (2, 9) and found.readings['light'] > 0.0
    # A header that counts goes before; a signed number does not count.
    collected = SerialAm(0xFFFF, 0, CtpData.AM_TYPE, CtpData(
        0, 0, 10, 5, 250, 0x42, b'\0\7').pack()).pack()
    decoder = PacketDecoder('tinyos2', [parse_payload('soil 0x42 seq_no:H')])
    assert decoder.decode(collected).count_bits == 8 and decoder.decode(collected).count == 250
    assert parse_payload('soil 0x42 seq_no:h').count_bits == 0
    cut = TelosMsg(0x7E, 17, MultihopMsg(0, 5, 9, 9, 2, b'\0\0').pack()).pack()
    assert PacketDecoder('tinyos1', [own]).decode(cut).count_bits == 0

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

"""Each message between a gateway and a server: its bytes, whole again, and what is refused."""

from __future__ import annotations

from collections.abc import Mapping
import dataclasses
import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.messages.uplink.commands import CommandAnswer
from rt_robot_os.messages.uplink.commands import RobotCommand
from rt_robot_os.messages.uplink.driving import DriveBeat
from rt_robot_os.messages.uplink.driving import DriveBegin
from rt_robot_os.messages.uplink.driving import DriveCommand
from rt_robot_os.messages.uplink.driving import DriveEnd
from rt_robot_os.messages.uplink.greeting import ABOUT_CHARACTERS
from rt_robot_os.messages.uplink.greeting import DriveLimits
from rt_robot_os.messages.uplink.greeting import NodePosition
from rt_robot_os.messages.uplink.greeting import RobotHello
from rt_robot_os.messages.uplink.greeting import ServerWelcome
from rt_robot_os.messages.uplink.importance import Importance
from rt_robot_os.messages.uplink.kinds import FRAMES
from rt_robot_os.messages.uplink.kinds import MEDIA_DOWN
from rt_robot_os.messages.uplink.kinds import MEDIA_UP
from rt_robot_os.messages.uplink.kinds import read
from rt_robot_os.messages.uplink.kinds import read_frame
from rt_robot_os.messages.uplink.kinds import STATE_DOWN
from rt_robot_os.messages.uplink.kinds import STATE_UP
from rt_robot_os.messages.uplink.live import LiveReceived
from rt_robot_os.messages.uplink.live import LiveSignals
from rt_robot_os.messages.uplink.live import WantedSignals
from rt_robot_os.messages.uplink.maps import MapMessage
from rt_robot_os.messages.uplink.media import CameraTrouble
from rt_robot_os.messages.uplink.media import ClockReply
from rt_robot_os.messages.uplink.media import ClockRequest
from rt_robot_os.messages.uplink.media import FileOffer
from rt_robot_os.messages.uplink.media import FilePart
from rt_robot_os.messages.uplink.media import FileProgress
from rt_robot_os.messages.uplink.media import FileRefusal
from rt_robot_os.messages.uplink.media import MediaHello
from rt_robot_os.messages.uplink.media import PictureFrame
from rt_robot_os.messages.uplink.media import PictureReceived
from rt_robot_os.messages.uplink.media import WantedCameras
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.records import BatchRefused
from rt_robot_os.messages.uplink.records import BatchStored
from rt_robot_os.messages.uplink.records import RecordBatch
from rt_robot_os.messages.uplink.records import UplinkRecord
from rt_robot_os.messages.uplink.voice import VoiceMessage

TABLES = {'state up': STATE_UP, 'state down': STATE_DOWN, 'media up': MEDIA_UP,
          'media down': MEDIA_DOWN}
NODE = NodePosition(7, 'bed_of_anna', 1.0, 2.5, 0.4, 'anna')

# What each message is on the wire: programs of other releases read these bytes.
WIRE: list[tuple[str, UplinkMessage, str]] = [
    ('state up', RobotHello('b', 'r', 'flat', 5, ('anna',), ('hall',), ('stop', 'drive'), (NODE,),
                            'ab', DriveLimits(0.3, 0.8)),
     '{"kind":"hello","version":1,"robot":"r","name":"flat","boot":"b","utc_ns":5,'
     '"cameras":["hall"],"nodes":[{"id":7,"name":"bed_of_anna","x":1.0,"y":2.5,"z":0.4,'
     '"person":"anna"}],"map":"ab","limits":{"linear_m_s":0.3,"angular_rad_s":0.8},'
     '"people":["anna"],"capabilities":["stop","drive"]}'),
    ('state up', RobotHello('b', 'r', 'flat', 5, (), (), (), (), '', DriveLimits()),
     '{"kind":"hello","version":1,"robot":"r","name":"flat","boot":"b","utc_ns":5,"cameras":[],'
     '"nodes":[],"map":"","limits":{},"people":[],"capabilities":[]}'),
    ('state down', ServerWelcome(5, True),
     '{"kind":"welcome","utc_ns":5,"version":1,"want_map":true}'),
    ('state up', RecordBatch(3, ({'seq': 1},), 'b', {'0': 2}),
     '{"kind":"records","batch":3,"boot":"b","lost":{"0":2},"records":[{"seq":1}]}'),
    ('state down', BatchStored(3), '{"kind":"stored","batch":3}'),
    ('state down', BatchRefused(3, 'no room', 2.0),
     '{"kind":"refused","batch":3,"text":"no room","retry_s":2.0}'),
    ('state up', LiveSignals(4, 5, {'speed': [5, 0.25]}),
     '{"kind":"live","n":4,"utc_ns":5,"signals":{"speed":[5,0.25]}}'),
    ('state down', LiveReceived(4), '{"kind":"taken","n":4}'),
    ('state down', WantedSignals(5.0, ('*',)),
     '{"kind":"want","signals_hz":5.0,"signals":["*"]}'),
    ('state down', RobotCommand('c1', 'goal', {'x': 1.0}, 'mary'),
     '{"kind":"command","id":"c1","do":"goal","args":{"x":1.0},"by":"mary"}'),
    ('state up', CommandAnswer('c1', True, 'done', {'text': {'code': 'done'}}),
     '{"kind":"answer","id":"c1","ok":true,"text":"done","codes":{"text":{"code":"done"}}}'),
    ('state up', MapMessage.pack(1, 1, 0.05, (0.0, 1.0, 0.5), b'\0'),
     '{"kind":"map",'
     '"sha256":"1b77d60d561778115ceef3138b4cdfd1bd8cc18b1e56d35c313b433679cb7fae","width":1,'
     '"height":1,"resolution_m":0.05,"origin":[0.0,1.0,0.5],"cells":"eNpjAAAAAQAB"}'),
    ('state down', DriveBegin('k', 'mary'), '{"kind":"drive_begin","lease":"k","by":"mary"}'),
    ('state down', DriveCommand(2, 9, True, 0.2, -0.1, 3.5, 'k', 'mary'),
     '{"kind":"drive","seq":2,"beat":9,"grip":true,"linear_m_s":0.2,"angular_rad_s":-0.1,'
     '"held_ms":3.5,"lease":"k","by":"mary"}'),
    ('state down', DriveEnd('k', 'mary', 'given back'),
     '{"kind":"drive_end","lease":"k","by":"mary","why":"given back"}'),
    ('state up', DriveBeat(9, 5, 'k', 2, True, False, None, {'linear_m_s': 0.1}, 'none', 'teleop',
                           True),
     '{"kind":"beat","n":9,"utc_ns":5,"lease":"k","seq":2,"armed":true,"moves":false,'
     '"rtt_ms":null,"speed":{"linear_m_s":0.1},"stop_reason":"none","steering":"teleop",'
     '"runs":true}'),
    ('state down', VoiceMessage('n', 'ring', 'v=0', 'mary'),
     '{"kind":"voice","call":"n","do":"ring","sdp":"v=0","by":"mary"}'),
    ('state down', VoiceMessage('n', 'end'), '{"kind":"voice","call":"n","do":"end"}'),
    ('state up', VoiceMessage('n', 'end', why='over'),
     '{"kind":"voice","call":"n","do":"end","why":"over"}'),
    ('state up', VoiceMessage('n', 'state', state='connected'),
     '{"kind":"voice","call":"n","do":"state","state":"connected"}'),
    ('media up', MediaHello(('hall',)), '{"kind":"hello","version":1,"cameras":["hall"]}'),
    ('media up', CameraTrouble('hall', 'no picture', {}),
     '{"kind":"trouble","camera":"hall","text":"no picture","codes":{}}'),
    ('media up', ClockRequest(7), '{"kind":"clock","t":7}'),
    ('media down', ClockReply(7, 5), '{"kind":"clock","t":7,"utc_ns":5}'),
    ('media down', PictureReceived('hall', 2), '{"kind":"taken","camera":"hall","n":2}'),
    ('media down', WantedCameras({'hall': 10.0}), '{"kind":"want","cameras":{"hall":10.0}}'),
    ('media up', FileOffer('f', 'ab', 10),
     '{"kind":"offer","id":"f","sha256":"ab","size":10}'),
    ('media down', FileProgress('f', 4), '{"kind":"have","id":"f","offset":4}'),
    ('media down', FileRefusal('f', 'no room', 1.0),
     '{"kind":"refused","id":"f","text":"no room","retry_s":1.0}')]

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-2**70, 2**70) | st.text(max_size=80)
    | st.floats(allow_nan=False, allow_infinity=False),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=8)
FIELDS = sorted({field.name for _, message, _ in WIRE
                 for field in dataclasses.fields(message)}  # type: ignore[arg-type]
                | {'width', 'age_ns', 'server_ns'})


@pytest.mark.parametrize(('table', 'message', 'wire'), WIRE)
def test_a_message_has_its_bytes_and_comes_back_as_it_was(
        table: str, message: UplinkMessage, wire: str) -> None:
    assert message.to_json() == wire
    assert read(TABLES[table], decode(wire)) == message


@pytest.mark.parametrize(('table', 'message', 'wire'), WIRE)
def test_fields_of_a_newer_release_are_ignored(
        table: str, message: UplinkMessage, wire: str) -> None:
    assert read(TABLES[table], {**decode(wire), 'of_a_newer_release': [1]}) == message


def test_every_message_is_in_the_table_of_its_bytes() -> None:
    for name, table in TABLES.items():
        assert {type(message) for each, message, _ in WIRE if each == name} | (
            {VoiceMessage} if name.startswith('state') else set()) == set(table.values()), name


def test_a_kind_of_a_newer_release_is_nothing() -> None:
    assert all(read(table, {'kind': 'of_a_newer_release'}) is None for table in TABLES.values())


@pytest.mark.parametrize('table', TABLES.values(), ids=TABLES)
@given(content=st.dictionaries(st.sampled_from(FIELDS), JSON, max_size=10), data=st.data())
def test_junk_is_a_value_error_or_can_be_sent_on(
        table: Mapping[str, type[UplinkMessage]], content: dict[str, Any], data: Any) -> None:
    kind = data.draw(st.sampled_from(sorted(table)))
    try:
        found = read(table, {**content, 'kind': kind})
    except ValueError as error:
        assert str(error)
        return
    assert found is not None
    again = read(table, json.loads(json.dumps({**found.content(), 'kind': kind})))
    assert again is not None and again.content() == found.content()


@pytest.mark.parametrize(('frame', 'header'), [
    (PictureFrame('hall', 2, b'jpeg', 5, 6, 7),
     b'{"kind":"picture","camera":"hall","n":2,"utc_ns":5,"age_ns":6,"server_ns":7}'),
    (FilePart('f', 4, b'part'), b'{"kind":"part","id":"f","offset":4}')])
def test_a_frame_has_its_bytes_and_comes_back_as_it_was(
        frame: PictureFrame | FilePart, header: bytes) -> None:
    sent = frame.to_bytes()
    assert sent == len(header).to_bytes(4, 'little') + header + bytes(frame.payload)
    found = read_frame(sent)
    assert found == frame and type(found) is type(frame)


@given(st.sampled_from(sorted(FRAMES)), st.dictionaries(st.sampled_from(FIELDS), JSON, max_size=8))
def test_a_header_that_is_junk_is_a_value_error(kind: str, header: dict[str, Any]) -> None:
    try:
        FRAMES[kind].from_frame(header, memoryview(b'x'))
    except ValueError as error:
        assert str(error)


def test_a_hello_of_an_older_robot_leaves_open_what_it_does_not_know() -> None:
    hello = RobotHello.from_json({'kind': 'hello', 'version': 1, 'boot': 'b', 'cameras': ['hall']})
    assert hello.about() == {'cameras': ['hall'], 'version': 1}
    assert (hello.people, hello.utc_ns, hello.map) == ((), None, None)


def test_of_a_hello_what_is_malformed_or_too_long_is_left_out_and_counted() -> None:
    hello = RobotHello.from_json({
        'kind': 'hello', 'version': 1, 'boot': 'b', 'cameras': 5, 'capabilities': ['stop', 7],
        'nodes': [NODE.content(), {'id': 'x'}, 3], 'map': {}, 'limits': 'x' * ABOUT_CHARACTERS,
        'people': ['anna', '', 7, 'x' * 65]})
    assert hello.about() == {'capabilities': ['stop'], 'nodes': [NODE.content()], 'version': 1}
    assert (hello.malformed, hello.too_long, hello.people) == (5, 1, ('anna',))


@pytest.mark.parametrize('boot', [None, 5, '', 'x' * 65])
def test_a_hello_without_a_boot_is_refused(boot: object) -> None:
    with pytest.raises(ValueError, match='boot must be a string of 1 to 64 characters'):
        RobotHello.from_json({'kind': 'hello', 'version': 1, 'boot': boot})


def test_records_that_are_text_already_are_put_into_their_batch() -> None:
    record = UplinkRecord(1, Importance.ALARM, 'alarm_event', 5, {'text': 'größer'})
    text = record.to_json()
    assert text == ('{"seq":1,"importance":0,"type":"alarm_event","utc_ns":5,'
                    '"content":{"text":"größer"}}')
    batch = RecordBatch(2, (json.loads(text), json.loads(text)), 'b', {})
    assert RecordBatch(2, (), 'b').with_records([text, text]) == batch.to_json()
    assert RecordBatch(2, (), 'b').with_records([]) == RecordBatch(2, (), 'b').to_json()


@pytest.mark.parametrize(('message', 'says'), [
    ({'kind': 'taken', 'n': True}, 'n must be an integer from 0'),
    ({'kind': 'want', 'signals_hz': 'fast'}, "signals_hz must be a number, not 'fast'"),
    ({'kind': 'want', 'signals_hz': -1}, 'from 0 to 1e'),
    ({'kind': 'command', 'id': {}, 'do': 'stop'}, 'id must be a string or an integer'),
    ({'kind': 'command', 'id': 1, 'args': [1]}, 'args must be an object'),
    ({'kind': 'voice', 'call': 'n', 'do': 'ring'}, 'ring without an sdp'),
    ({'kind': 'drive', 'seq': 1, 'beat': 1, 'linear_m_s': float('inf')}, 'a finite number'),
    ({'kind': 'stored', 'batch': None}, 'batch must be')])
def test_the_error_names_the_field_and_its_value(message: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        read(STATE_DOWN, message)

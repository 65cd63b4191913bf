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

"""Diagnoses in JSON: the bytes are those that ROS reads, and nonsense is refused."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.link.conversions import find
from rt_robot_os.link.conversions import to_diagnostics
from rt_robot_os.messages.diagnostic_array import DIAGNOSTICS
from rt_robot_os.messages.diagnostic_array import LEVEL_NAMES
from rt_robot_os.messages.diagnostic_array import STATUSES_MAXIMUM
from rt_robot_os.messages.diagnostic_array import statuses_of
from rt_robot_os.messages.diagnostic_array import TEXT_BYTES_MAXIMUM
from rt_robot_os.messages.diagnostic_array import VALUES_MAXIMUM
from rt_robot_os.topics import Layout

WALL_NS = 1_700_000_000_123_456_789
TEXTS = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=12)
STATUSES = st.fixed_dictionaries(
    {'level': st.integers(0, 3), 'name': TEXTS},
    optional={'message': TEXTS, 'hardware_id': TEXTS,
              'values': st.dictionaries(TEXTS, TEXTS, max_size=4)})


def sample(text: str) -> memoryview:
    """Return a text as the topic of the core has it."""
    layout = Layout.compile('std_msgs/msg/String', {}, tail=TEXT_BYTES_MAXIMUM + 100)
    buffer = layout.new_buffer()
    layout.view(buffer).data = text
    return buffer[:layout.length(buffer)]


def message(cdr: bytes) -> Any:
    """Return what rclpy reads."""
    serialization = pytest.importorskip('rclpy.serialization', reason='rclpy is not installed')
    messages = pytest.importorskip('diagnostic_msgs.msg', reason='no ROS 2 messages')
    return serialization.deserialize_message(cdr, messages.DiagnosticArray)


def test_the_list_of_alarms_is_a_diagnostic_array_with_the_samples_stamp() -> None:
    pair = find('std_msgs/msg/String', DIAGNOSTICS)
    assert pair is not None and pair.outward is not None and pair.inward is None
    found = message(pair.outward('map')(sample(json.dumps({'status': [
        {'level': 2, 'name': 'alarm 7', 'message': 'anna: Sturz im Bad, höchste Stufe',
         'hardware_id': 'anna', 'values': {'state': 'raised', 'kinds': 'fall, help'}},
        {'level': 0, 'name': 'alarms'}]})), WALL_NS))
    assert (found.header.stamp.sec, found.header.stamp.nanosec) == divmod(WALL_NS, 10 ** 9)
    assert found.header.frame_id == 'map'
    first, second = found.status
    assert (first.level, first.name, first.hardware_id) == (b'\2', 'alarm 7', 'anna')
    assert first.message == 'anna: Sturz im Bad, höchste Stufe'
    assert [(each.key, each.value) for each in first.values] == [
        ('state', 'raised'), ('kinds', 'fall, help')]
    assert (second.level, second.name, second.message, second.values) == (b'\0', 'alarms', '', [])


@given(st.lists(STATUSES, max_size=5))
def test_whatever_is_right_is_the_bytes_that_others_write(rows: list[dict[str, Any]]) -> None:
    rosbags = pytest.importorskip('rosbags.typesys', reason='rosbags is not installed')
    store = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
    cdr = to_diagnostics()(sample(json.dumps({'status': rows})), WALL_NS)
    found = store.deserialize_cdr(cdr, DIAGNOSTICS)
    assert bytes(store.serialize_cdr(found, DIAGNOSTICS)) == cdr
    assert [(s.level, s.name, s.message, s.hardware_id, {v.key: v.value for v in s.values})
            for s in found.status] == [
        (r['level'], r['name'], r.get('message', ''), r.get('hardware_id', ''),
         r.get('values', {})) for r in rows]


def test_numbers_among_the_values_are_written_as_such() -> None:
    text = ('{"status": [{"level": 1, "name": "anna", "values": '
            '{"pulse": 71.5, "missing": 2, "complete": true, "huge": 1' + '0' * 400 + '}}]}')
    values = statuses_of(text)[0].values
    assert dict(values) == {'pulse': '71.5', 'missing': '2', 'complete': 'true',
                            'huge': '1' + '0' * 400}


@pytest.mark.parametrize('text, problem', [
    ('', 'not JSON'), ('[' * 100_000, 'not JSON'), ('[]', 'no list "status"'),
    ('{}', 'no list "status"'), ('{"status": {}}', 'no list "status"'),
    ('{"status": [7]}', "status 0 is '7': it must be an object"),
    ('{"status": [{"level": 0, "nam": ""}]}', 'status 0 has unknown keys nam; known are'),
    ('{"status": [{"name": "x"}]}', "level 'None' of status 0: it must be 0"),
    ('{"status": [{"level": 4}]}', "level '4'"), ('{"status": [{"level": true}]}', "level 'True'"),
    ('{"status": [{"level": 0}, {"level": 0.5}]}', "level '0.5' of status 1"),
    ('{"status": [{"level": []}]}', 'level'),
    ('{"status": [{"level": 0, "name": 7}]}', "name of status 0 is '7': it must be a string"),
    (r'{"status": [{"level": 0, "message": "a\u0000b"}]}', 'message of status 0 holds a NUL'),
    (r'{"status": [{"level": 0, "name": "\ud800"}]}', 'name of status 0 holds a lone surrogate'),
    ('{"status": [{"level": 0, "values": []}]}', 'values of status 0: they must be an object'),
    ('{"status": [{"level": 0, "values": {"a": null}}]}', "a of status 0 is 'None'"),
    ('{"status": [{"level": 0, "values": {"a": NaN}}]}', "a of status 0 is 'nan'"),
    (json.dumps({'status': [{'level': 0}] * (STATUSES_MAXIMUM + 1)}), 'statuses: at most'),
    (json.dumps({'status': [{'level': 0, 'values': dict.fromkeys(map(
        str, range(VALUES_MAXIMUM + 1)), '')}]}), 'values of status 0'),
    (' ' * (TEXT_BYTES_MAXIMUM + 1), 'bytes: at most'),
])
def test_nonsense_is_refused_with_what_would_be_right(text: str, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        to_diagnostics()(sample(text), WALL_NS)


@given(st.binary(max_size=80), st.recursive(
    st.none() | st.booleans() | st.floats() | st.sampled_from(('level', 'status', '', 'x')),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from(('status', 'level', 'name', 'values', 'x')), inner, max_size=4)))
def test_any_bytes_give_a_message_or_a_refusal(noise: bytes, tree: Any) -> None:
    convert = to_diagnostics()
    for cdr in (memoryview(noise), memoryview(b'\0\1\0\0' + noise), sample(json.dumps(tree)),
                sample(json.dumps({'status': [tree]}))):
        try:
            assert convert(cdr, WALL_NS)[:4] == b'\0\1\0\0'
        except ValueError as error:
            assert str(error)


def test_the_names_of_the_levels_are_those_of_ros() -> None:
    messages = pytest.importorskip('diagnostic_msgs.msg', reason='no ROS 2 messages')
    for level, name in enumerate(LEVEL_NAMES):
        assert getattr(messages.DiagnosticStatus, name.upper()) == bytes([level])

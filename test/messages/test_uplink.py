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

"""Messages and frames between a gateway and a server: whole again, and never an odd error."""

from __future__ import annotations

import json
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.messages.uplink.frames import decode_frame
from rt_robot_os.messages.uplink.frames import encode_frame
from rt_robot_os.messages.uplink.frames import FRAME_BYTES
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.messages.uplink.messages import MESSAGE_BYTES

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-2**53, 2**53) | st.text()
    | st.floats(allow_nan=False, allow_infinity=False),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=8)
CONTENT = st.dictionaries(st.text().filter(lambda key: key != 'kind'), JSON, max_size=4)


@given(st.text(), CONTENT)
def test_a_message_comes_back_as_it_was(kind: str, content: dict[str, Any]) -> None:
    assert decode(encode(kind, content).encode(errors='surrogatepass').decode(
        errors='surrogatepass')) == {'kind': kind, **content}


@given(st.text(), CONTENT, st.binary())
def test_a_frame_comes_back_as_it_was(kind: str, content: dict[str, Any], data: bytes) -> None:
    header, payload = decode_frame(encode_frame(kind, content, data))
    assert (header, bytes(payload)) == ({'kind': kind, **content}, data)


@given(st.binary(max_size=200) | JSON.map(lambda each: json.dumps(each).encode()))
def test_what_is_no_message_is_a_value_error(data: bytes) -> None:
    for read in (decode, decode_frame):
        try:
            read(data)
        except ValueError:
            pass


@pytest.mark.parametrize('text, says', [
    ('[]', 'without a kind'), ('{"kind": 1}', 'without a kind'),
    ('{"kind": "x", "v": NaN}', 'NaN'),
    ('[' * 100_000, 'nested too deeply'), (' ' * (MESSAGE_BYTES + 1), 'the most'),
    (b'{"kind": "\xff"}', 'not UTF-8')])
def test_the_error_says_what_is_wrong(text: str | bytes, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        decode(text)


def test_what_json_cannot_hold_and_what_is_too_long_is_not_sent() -> None:
    with pytest.raises(ValueError):
        encode('live', {'value': math.inf})
    with pytest.raises(ValueError, match='the most'):
        encode_frame('picture', {}, bytes(FRAME_BYTES))

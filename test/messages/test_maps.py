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

"""Check that maps arrive as they were sent, and that nothing else is taken for one."""

from __future__ import annotations

import base64
import json
import zlib

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.messages.uplink.maps import CELLS_MOST
from rt_robot_os.messages.uplink.maps import MapMessage
from rt_robot_os.messages.uplink.messages import decode

SMALL = MapMessage.pack(3, 2, 0.05, (-0.5, 1.0, 0.25), bytes([0, 100, 255, 0, 50, 100]))


@settings(max_examples=50)
@given(st.integers(1, 20), st.integers(1, 20), st.floats(0.001, 10.0),
       st.tuples(*[st.floats(-1e6, 1e6)] * 3), st.randoms())
def test_a_map_arrives_as_it_was_sent(width, height, resolution_m, origin, random) -> None:
    cells = random.randbytes(width * height)
    sent = MapMessage.pack(width, height, resolution_m, origin, cells)
    found = MapMessage.from_json(decode(sent.to_json()))
    assert found == sent
    assert zlib.decompress(base64.b64decode(found.cells)) == cells


@pytest.mark.parametrize('wrong', [
    {'width': 0}, {'width': True}, {'width': 4}, {'height': '2'}, {'height': CELLS_MOST},
    {'resolution_m': 0.0}, {'resolution_m': -1}, {'resolution_m': None}, {'origin': [0, 0]},
    {'origin': 'abc'}, {'origin': [0, 0, 10 ** 400]}, {'cells': 'no base64'}, {'cells': 7},
    {'cells': base64.b64encode(zlib.compress(bytes(1 << 24))).decode()},
    {'cells': base64.b64encode(zlib.compress(bytes(6))[:-6]).decode()}, {'sha256': ''},
    {'origin': [0.0, 1.0, 0.25]}])
def test_what_is_no_map_is_refused(wrong) -> None:
    with pytest.raises(ValueError):
        MapMessage.from_json({**SMALL.content(), **wrong})


def test_a_number_that_only_looks_finite_is_refused() -> None:
    with pytest.raises(ValueError, match='finite'):
        MapMessage.from_json(json.loads(SMALL.to_json().replace('0.05', '1e999')))


def test_a_map_that_fits_into_no_message_is_refused_by_who_sends_it() -> None:
    import random
    noise = random.Random(1).randbytes(2_000_000)
    with pytest.raises(ValueError, match='larger cells'):
        MapMessage.pack(2000, 1000, 0.05, (0.0, 0.0, 0.0), noise)


def test_nothing_but_the_map_is_kept() -> None:
    assert MapMessage.from_json({**SMALL.content(), 'kind': 'map', 'more': 'x' * 100}) == SMALL

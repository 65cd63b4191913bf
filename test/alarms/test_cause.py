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

"""Causes of alarms: what is written is read again, and nonsense is refused by name."""

import json
import math

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import CAUSE_BYTES
from rt_robot_os.messages.cause import Level

_LETTERS = st.characters(exclude_categories=['Cs'], exclude_characters='\0')
_NAME = st.text(_LETTERS, min_size=1, max_size=64).filter(str.strip)
_NUMBER = st.one_of(st.just(math.nan), st.floats(-1e6, 1e6))


@given(st.builds(
    Cause, st.from_regex(r'\A[a-z][a-z0-9_]{0,47}\Z'), _NAME, st.sampled_from(Level),
    st.booleans(), st.text(_LETTERS, max_size=240),
    st.just('rules'), st.just('wrist'), _NUMBER, _NUMBER, _NUMBER))
def test_what_is_written_is_read_again(cause):
    again = Cause.from_json(cause.to_json())
    assert repr(again) == repr(cause)  # NaN equals NaN there


def test_the_longest_cause_fits_into_its_topic():
    for letter in 'a', '\0', '\U0001f600':
        cause = Cause('k' * 48, letter * 64, Level.CRITICAL, True, letter * 500, letter * 64,
                      letter * 64, 1.123456789012345e-300, -2.123456789012345, 3.123456789012345)
        assert len(cause.to_json().encode()) <= CAUSE_BYTES


@pytest.mark.parametrize(('change', 'wanted'), [
    ({'level': 'bad'}, 'technical, warning, urgent, critical'),
    ({'level': 3}, 'technical, warning, urgent, critical'),
    ({'kind': 'A fall'}, 'kind .* a small letter'),
    ({'subject': ' '}, '1 to 64 characters'),
    ({'active': 1}, 'true or false'),
    ({'x': 10 ** 400}, 'x is too large'),
    ({'x': 'here'}, 'x .* must be a number'),
    ({'colour': 'red'}, 'unknown keys colour'),
])
def test_nonsense_is_refused_with_what_would_be_right(change, wanted):
    good = {'kind': 'fall', 'subject': 'anna', 'level': 'critical'}
    assert Cause.from_json(json.dumps(good)).level is Level.CRITICAL
    with pytest.raises(ValueError, match=wanted):
        Cause.from_json(json.dumps({**good, **change}))


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text):
    try:
        Cause.from_json(text)
    except ValueError:
        return


def test_what_no_message_can_hold_is_told_without_it():
    found = Cause.from_json('{"kind": "fall", "subject": "an\\u0000na", "level": "critical", '
                            '"text": "\\ud800 fell"}')
    assert (found.subject, found.text) == ('an na', '? fell')
    assert found.to_json().encode()

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

"""What is written is read again, and junk is refused with the field, its value and the remedy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import json
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.messages.agent import AgentTransition
from rt_robot_os.messages.alarm_commands import AlarmCommand
from rt_robot_os.messages.alarm_commands import parse_command
from rt_robot_os.messages.alarm_commands import SILENCE
from rt_robot_os.messages.alarm_commands import TEST
from rt_robot_os.messages.alarm_commands import VERBS
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.catalogue import MessageEntry
from rt_robot_os.messages.catalogue import MESSAGES
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.codec import FieldOf
from rt_robot_os.messages.fields import Choice
from rt_robot_os.messages.fields import Flag
from rt_robot_os.messages.fields import OneObject
from rt_robot_os.messages.fields import OneOf
from rt_robot_os.messages.fields import Real
from rt_robot_os.messages.fields import Text
from rt_robot_os.messages.fields import Texts
from rt_robot_os.messages.fields import Whole
from rt_robot_os.messages.journal import JournalReply
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification

# An AlarmCommand is text, and a reply of the journal has one field only: both are tested below.
JSON = [each for each in MESSAGES if each.message not in (AlarmCommand, JournalReply)]
_CHARACTERS = st.characters(exclude_categories=['Cs', 'Cc', 'Zl', 'Zp', 'Cf'])
_JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner,
                                                                max_size=4), max_leaves=8)


def texts(limit: Text) -> st.SearchStrategy[str]:
    if limit.pattern.startswith('[a-z]'):
        return st.from_regex(rf'\A{limit.pattern}\Z').filter(str.isascii)
    return st.text(_CHARACTERS, min_size=limit.least, max_size=min(limit.most, 30)).filter(
        lambda text: len(text.strip()) >= limit.least)


def values(field: FieldOf) -> st.SearchStrategy[Any]:
    """Return what a field can be; also what it is without a value."""
    limit = field.limit
    if isinstance(limit, Text):
        found: st.SearchStrategy[Any] = texts(limit)
    elif isinstance(limit, OneOf):
        found = st.sampled_from(limit.values)
    elif isinstance(limit, Real):
        found = st.floats(max(limit.low, -1e9), min(limit.high, 1e9))
    elif isinstance(limit, Whole):
        found = st.integers(limit.low, limit.high)
    elif isinstance(limit, Flag):
        found = st.booleans()
    elif isinstance(limit, Choice):
        found = st.sampled_from(list(limit.values.values()))
    elif isinstance(limit, Texts):
        found = st.lists(texts(limit.of), max_size=limit.most).map(tuple)
    elif isinstance(limit, OneObject):
        found = st.just({'id': '7'})
    else:
        found = st.just(({'event': 'raised'},))
    return found if field.needed else found | st.just(field.default)


@pytest.mark.parametrize('entry', JSON, ids=lambda entry: entry.message.__name__)
@given(data=st.data())
def test_what_is_written_is_read_again(entry: MessageEntry, data: st.DataObject) -> None:
    message: Any = entry.message(**{
        each.name: data.draw(values(each), each.name) for each in entry.codec.fields})
    text = json.dumps(message.to_dict())
    again = entry.message.from_dict(json.loads(text))  # type: ignore[attr-defined]
    assert repr(again) == repr(message)  # NaN equals NaN there
    if hasattr(message, 'to_json'):
        assert json.loads(message.to_json()) == message.to_dict()
        assert repr(entry.message.from_json(message.to_json())  # type: ignore[attr-defined]
                    ) == repr(message)


@pytest.mark.parametrize('entry', MESSAGES, ids=lambda entry: entry.message.__name__)
@given(data=st.data())
def test_junk_is_read_or_refused_with_the_field_and_the_remedy(
        entry: MessageEntry, data: st.DataObject) -> None:
    keys = st.sampled_from(entry.codec.keys) | st.text(max_size=8)
    junk = data.draw(st.dictionaries(keys, _JUNK, max_size=6))
    try:
        entry.codec.read(junk)
    except ValueError as error:
        assert any(word in str(error) for word in ('must be', 'is missing', 'unknown keys',
                                                   'too large')), error
        assert any(key in str(error) for key in entry.codec.keys)
        assert len(str(error)) < 400


@given(st.text(max_size=60) | _JUNK.map(json.dumps))
def test_text_that_is_not_a_message_is_refused_with_an_example(text: str) -> None:
    for entry in JSON:
        if not hasattr(entry.message, 'from_json'):
            continue
        try:
            entry.message.from_json(text)
        except ValueError as error:
            assert 0 < len(str(error)) < 500


_WORD = st.text('abcdefgh0123', min_size=1, max_size=8).filter(lambda word: word != 'by')


@given(st.sampled_from(VERBS), _WORD, _WORD, st.lists(_WORD, max_size=3).map(' '.join),
       st.sampled_from(Level), st.floats(0.0, 86_400.0))
def test_a_command_that_is_written_is_read_again(
        verb: str, target: str, by: str, why: str, level: Level, seconds: float) -> None:
    made = AlarmCommand(verb, target, by, why)
    if verb == TEST:
        made = AlarmCommand(verb, '', by, why, level=level)
    elif verb == SILENCE:
        made = AlarmCommand(verb, '', by, why, seconds=seconds)
    assert parse_command(made.to_text()) == made


@pytest.mark.parametrize('reply', [
    JournalReply({'seq': 1}, 5), JournalReply(restored=0), JournalReply(stored=7),
    JournalReply(resend=True), JournalReply(low=''), JournalReply(low='full'),
    JournalReply(fault='no disk')])
def test_a_reply_of_the_journal_is_read_again(reply: JournalReply) -> None:
    assert JournalReply.from_json(reply.to_json()) == reply


def test_a_reply_that_says_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match='must have one of fault, low'):
        JournalReply.from_json('{"hello": 1}')


# ---- what receivers of other releases rely on ------------------------------------------------

EVENT: Mapping[str, Any] = {
    'seq': 3, 't_ns': 5, 'alarm': '7', 'event': 'raised', 'state': 'raised', 'level': 'urgent',
    'subject': 'anna', 'kinds': ['fall'], 'text': 'fell', 'by': 'falls', 'why': ''}


def test_the_bytes_of_an_event_are_as_ever() -> None:
    event = AlarmEvent(3, 5, '7', 'raised', 'raised', 'urgent', 'anna', ('fall',), 'fell', 'falls')
    assert event.to_json() == json.dumps(EVENT, separators=(',', ':'))
    told = replace(event, node='wrist', x=1.5, restored=True)
    assert told.to_json() == json.dumps(
        {**EVENT, 'node': 'wrist', 'x': 1.5, 'restored': True}, separators=(',', ':'))


def test_the_bytes_of_a_cause_a_notification_and_a_report_are_as_ever() -> None:
    assert Cause('fall', 'anna', Level.URGENT, node='é', value=2.0).to_json() == (
        '{"kind":"fall","subject":"anna","level":"urgent","active":true,"text":"","source":"",'
        '"node":"é","value":2.0}')
    assert Notification('7.1', 'op', '7', 0, 'urgent', 'anna', 'fell', ('fall',), '', math.nan,
                        math.nan, ('a.jpg',), True).to_json() == (
        '{"key":"7.1","channel":"op","alarm":"7","step":0,"level":"urgent","subject":"anna",'
        '"text":"fell","kinds":["fall"],"pictures":["a.jpg"],"again":true}')
    assert DeliveryReport('7.1', 'op', True).to_json() == (
        '{"key": "7.1", "channel": "op", "ok": true, "text": ""}')


def test_an_event_of_a_newer_release_is_understood_as_far_as_it_is_known() -> None:
    event = AlarmEvent.from_dict({**EVENT, 'state': 'shelved', 'colour': 'red', 'x': 'here'})
    assert event.is_open and event.state == 'shelved' and math.isnan(event.x)
    assert not AlarmEvent.from_dict({**EVENT, 'state': 'resolved'}).is_open


def test_a_notification_of_a_newer_release_keeps_what_is_unknown() -> None:
    made = Notification.from_json('{"key": "7", "channel": "op", "urgency": "a\\u001b[2J"}')
    assert made.to_dict() == {'key': '7', 'channel': 'op', 'step': 0,
                              'urgency': 'a\\x1b[2J'}


def test_each_event_of_an_alarm_that_ends_it_is_a_state_too() -> None:
    for each in AlarmState:
        assert AlarmEventKind(each.value)


def test_a_wrong_state_of_the_agent_is_named() -> None:
    with pytest.raises(ValueError, match="to 'fly': it must be one of idle, confirm"):
        AgentTransition.from_dict({'from': 'idle', 'to': 'fly', 'cause': '', 'alarm': '',
                                   't_ns': 0})

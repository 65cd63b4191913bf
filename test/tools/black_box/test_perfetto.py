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


"""The document for Perfetto keeps the rules of the Chrome trace event format."""

from __future__ import annotations

from collections import Counter
import json
from pathlib import Path
from typing import Any

from black_box_stories import stories
from black_box_stories import Story
from hypothesis import given
from hypothesis import settings

from rt_robot_os.tools.black_box import History
from rt_robot_os.tools.black_box import perfetto_document
from rt_robot_os.tools.black_box import read_dump
from rt_robot_os.tools.black_box import understand

EXAMPLE = Path(__file__).with_name('example.rtbb.gz')
Event = dict[str, Any]
NEEDED = {'X': {'dur', 'args'}, 'i': {'s', 'args'}, 's': {'id'}, 't': {'id'}, 'f': {'id', 'bp'}}


def _events(history: History) -> tuple[list[Event], list[Event]]:
    """Make the document as a reader gets it; metadata and the rest."""
    document = json.loads(json.dumps(perfetto_document(history, 'arm'), allow_nan=False))
    events = document['traceEvents']
    assert document['displayTimeUnit'] in ('ms', 'ns')
    return ([e for e in events if e['ph'] == 'M'], [e for e in events if e['ph'] != 'M'])


def _follow_the_format(history: History) -> None:
    metadata, events = _events(history)
    named = {(e['pid'], e['tid']) for e in metadata if e['name'] == 'thread_name'}
    assert [e['args']['name'] for e in metadata if e['name'] == 'process_name'] == ['core of arm']
    for event in events:
        assert event['ph'] in NEEDED
        assert {'name', 'cat', 'pid', 'tid', 'ts', *NEEDED[event['ph']]} <= event.keys()
        assert (event['pid'], event['tid']) in named
        assert event['ts'] >= 0 and event.get('dur', 0) >= 0
    assert [e['ts'] for e in events] == sorted(e['ts'] for e in events)
    _arrows_are_whole(events)
    _slices_do_not_cross(events)


def _arrows_are_whole(events: list[Event]) -> None:
    """Each arrow begins once, ends once, and each point of it lies on a slice."""
    arrows: dict[int, list[Event]] = {}
    places = {(e['tid'], e['ts']) for e in events if e['ph'] == 'X'}
    for event in events:
        if event['ph'] in 'stf':
            arrows.setdefault(event['id'], []).append(event)
            assert (event['tid'], event['ts']) in places
    for points in arrows.values():
        phases = [point['ph'] for point in points]
        assert phases == ['s', *['t'] * (len(phases) - 2), 'f']


def _slices_do_not_cross(events: list[Event]) -> None:
    tracks: dict[int, list[float]] = {}  # where those that are open end
    resources = {e['tid'] for e in events if e['cat'] == 'resource'}
    for event in events:
        if event['ph'] == 'X' and event['tid'] not in resources:
            ends = tracks.setdefault(event['tid'], [])
            while ends and ends[-1] <= event['ts'] + 1e-6:
                ends.pop()
            end = event['ts'] + event['dur']
            assert not ends or end <= ends[-1] + 1e-6
            ends.append(end)


@settings(max_examples=80, deadline=None)
@given(stories())
def test_every_story_follows_the_format(story: Story) -> None:
    _follow_the_format(understand(story.dump()))


@settings(max_examples=60, deadline=None)
@given(stories())
def test_nothing_is_lost_on_the_way(story: Story) -> None:
    history = understand(story.dump())
    _, events = _events(history)
    phases = Counter(e['ph'] for e in events)
    assert phases['s'] == phases['f'] == len(history.jobs)
    assert phases['i'] == len(history.moments)
    used = sum(e['dur'] for e in events if e['cat'] == 'job' and e['ph'] == 'X')
    assert round(used * 1000) == sum(job.execution_ns for job in history.jobs)


def test_a_recorded_run() -> None:
    found = read_dump(EXAMPLE)
    history = understand(found.dump, found.kinds)
    _follow_the_format(history)
    metadata, events = _events(history)
    tracks = {e['args']['name']: e['tid'] for e in metadata if e['name'] == 'thread_name'}
    assert {'releases', 'prio 80', 'prio 20', 'resource map', 'native calls that blocked'
            } <= tracks.keys()
    assert any(e['name'].startswith('native call of planner blocked imu') for e in events)
    # A preempted job has several slices on the track of its priority, one arrow through all.
    slices = [e for e in events if e['cat'] == 'job' and e['ph'] == 'X' and e['name'] == 'planner']
    assert {e['tid'] for e in slices} == {tracks['prio 20']}
    assert any(e['args'].get('slice', '').startswith('2 of') for e in slices)
    assert {e['args']['outcome'] for e in events if e['name'] in ('vision', 'logger')
            and e['cat'] == 'job' and e['ph'] == 'X'} == {'aborted', 'failed'}

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


"""Plots: what is on them, and that they can be drawn."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from black_box_stories import stories
from black_box_stories import Story
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.tools.black_box import Chart
from rt_robot_os.tools.black_box import chart_of
from rt_robot_os.tools.black_box import History
from rt_robot_os.tools.black_box import read_dump
from rt_robot_os.tools.black_box import save_chart
from rt_robot_os.tools.black_box import understand
from rt_robot_os.tools.black_box import window

EXAMPLE = Path(__file__).with_name('example.rtbb.gz')
NS_PER_MS = 1_000_000


def _history() -> History:
    found = read_dump(EXAMPLE)
    return understand(found.dump, found.kinds)


def _chart() -> Chart:
    history = _history()
    return chart_of(history, *window(history))


def test_rows_are_tasks_by_priority_then_resources() -> None:
    labels = [row.label.split('\n') for row in _chart().rows]
    assert [name for name, _ in labels] == [
        'uart', 'imu', 'control', 'mapping', 'planner', 'vision', 'logger', 'map']
    priorities = [int(priority) for _, priority in labels[:-1]]
    assert priorities == sorted(priorities, reverse=True)
    assert labels[-1][1] == 'resource'


def test_what_went_wrong_is_marked() -> None:
    rows = {row.label.split('\n')[0]: row for row in _chart().rows}
    assert [text for _, text in rows['vision'].faults] == ['aborted']
    assert [text for _, text in rows['logger'].faults] == ['failed']
    assert rows['logger'].late and not rows['logger'].running
    assert rows['planner'].blocking and rows['planner'].preempted
    assert any('native call blocks imu' in text for _, text in rows['planner'].notes)
    assert rows['uart'].interrupts and rows['map'].held


@settings(max_examples=80, deadline=None)
@given(stories(), st.data())
def test_boxes_of_all_tasks_are_the_time_that_they_had(story: Story, data: st.DataObject) -> None:
    history = understand(story.dump())
    from_ns = data.draw(st.integers(0, story.now_ns))
    to_ns = data.draw(st.integers(from_ns, story.now_ns))
    try:
        chart = chart_of(history, from_ns, to_ns)
    except BlackBoxError:
        assert not story.used(from_ns, to_ns)
        return
    drawn_ms = sum(length for row in chart.rows for _, length in [*row.running, *row.late])
    assert round(drawn_ms * NS_PER_MS) == sum(story.used(from_ns, to_ns).values())
    for row in chart.rows:
        for boxes in (row.running, row.late, row.preempted, row.waiting, row.held, row.blocking):
            for left, length in boxes:
                assert chart.from_ms <= left and left + length <= chart.to_ms + 1e-9


def test_an_empty_window_is_refused_with_what_there_is() -> None:
    history = _history()
    with pytest.raises(BlackBoxError, match='nothing ran .* the dump covers -3'):
        chart_of(history, history.to_ns + 1, history.to_ns + 2)


@pytest.mark.parametrize('ending', ['svg', 'png'])
def test_it_is_drawn(tmp_path: Path, ending: str) -> None:
    pytest.importorskip('matplotlib', reason='matplotlib is not installed')
    path = tmp_path / f'plot.{ending}'
    save_chart(_chart(), path)
    if ending == 'png':
        assert path.read_bytes().startswith(b'\x89PNG')
        return
    texts = [''.join(e.itertext()) for e in ElementTree.parse(path).iter()
             if e.tag.endswith('text')]
    for expected in ('planner', 'resource', 'aborted', 'failed', 'preempted', 'interrupt'):
        assert expected in ' '.join(texts)


def test_marks_and_titles_with_dollars_are_drawn_as_they_are(tmp_path: Path) -> None:
    pytest.importorskip('matplotlib', reason='matplotlib is not installed')
    story = Story()
    story.job(1, [3, 8, [7, 5], 1, 2, 3, 4, 6])
    chart = chart_of(understand(story.dump()), 0, story.now_ns)
    path = tmp_path / 'plot.svg'
    save_chart(Chart(r'cost $\frac$ of $5', chart.from_ms, chart.to_ms, chart.rows, ('a',),
                     ((chart.from_ms, '$x_'),)), path)
    assert r'$\frac$ of $5' in path.read_text()

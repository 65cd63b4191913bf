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

"""The parts of the report: plots, requirements, Markdown, progress bar, the command to repeat."""

from __future__ import annotations

import io
import itertools
import re

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.tools.bench.advice import requirements
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import Paragraph
from rt_robot_os.tools.bench.blocks import TableBlock
from rt_robot_os.tools.bench.html_report import page
from rt_robot_os.tools.bench.machine import describe
from rt_robot_os.tools.bench.machine import warnings
from rt_robot_os.tools.bench.machine_state import NOTHING
from rt_robot_os.tools.bench.markdown_report import markdown
from rt_robot_os.tools.bench.plot import histogram
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.plot_drawing import styles
from rt_robot_os.tools.bench.plot_drawing import svg
from rt_robot_os.tools.bench.progress import duration
from rt_robot_os.tools.bench.progress import ProgressLine
from rt_robot_os.tools.bench.report import _case
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.session import command
from rt_robot_os.tools.bench.text_report import requirement_lines
from rt_robot_os.tools.bench.verdicts import verdicts


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@given(st.lists(st.integers(1_000, 10**9), min_size=1, max_size=500))
def test_a_tail_falls_from_one_to_the_largest_sample(values: list[int]) -> None:
    found = tail('x', np.array(values, np.int64), 1e3)
    assert found.x[0] == pytest.approx(min(values) / 1e3)
    assert found.x[-1] == pytest.approx(max(values) / 1e3)
    assert list(found.x) == sorted(found.x)
    assert found.y[0] == 1.0
    assert found.y[-1] == pytest.approx(1 / len(values))
    for x, y in zip(found.x, found.y):
        assert sum(value >= x * 1e3 - 0.01 for value in values) >= y * len(values) - 0.01


@given(st.lists(st.integers(1, 10**9), min_size=1, max_size=500))
def test_a_histogram_leaves_no_sample_out(values: list[int]) -> None:
    found = histogram('x', np.array(values, np.int64), 1e3, 1.0, 1e4)
    assert sum(found.y) == pytest.approx(100.0)


def test_nothing_measured_is_no_curve() -> None:
    assert tail('x', np.zeros(0, np.int64), 1e3).x == ()


def test_a_picture_of_what_does_not_change_is_a_sentence() -> None:
    def plot(*values: float) -> Plot:
        return Plot('memory', 'Memory over time', 'time, s', 'resident size, MB',
                    [Series('rt_robot_os', range(len(values)), values, 'marks')])

    assert plot(33.4, 33.4, 33.5).flat() == (33.4, 33.5)
    assert plot(33.4, 40.0).flat() is None
    assert plot().flat() is None
    blocks = list(_case(CaseResult('x', 'x', (), (), (plot(33.4, 33.4), plot(1.0, 2.0)))))
    said = [block.text for block in blocks if isinstance(block, Paragraph)]
    assert 'Memory over time: 33.4 to 33.4 (resident size, MB), so there is no picture.' in said


def test_a_floor_is_named_and_an_empty_curve_is_left_out() -> None:
    pytest.importorskip('matplotlib', reason='matplotlib is not installed')
    plot = Plot('error', 'Error', 'Hz', 'error, %', [
        Series('rclpy', (200, 500), (1e-4, 1.0), 'marks'), Series('HORUS', (), (), 'marks')],
        y_log=True, y_floor=(1e-4, 'none at all'))
    drawn = svg(plot, 'x')
    assert 'none at all' in drawn and '0.0001' not in drawn
    assert 'HORUS' not in drawn
    tails = svg(Plot('tail', 'Tail', 'us', 'part', [
        tail('rclpy', np.arange(1, 5000), 1.0), tail('HORUS', np.zeros(0, np.int64), 1.0)],
        x_log=True, y_log=True), 'y')
    assert '1 % (p99)' in tails


def test_a_need_tells_who_gives_it() -> None:
    requirement = Requirement('late by 1 ms', 1000.0, 'us', {
        'rt_robot_os': Metric((40.0,)), 'best rclpy': Metric((20_000.0,)), 'HORUS': None},
        case='preemption')
    assert [requirement.meets(name) for name in ('rt_robot_os', 'best rclpy', 'HORUS')] == [
        True, False, None]
    lines = list(requirement_lines([requirement]))
    assert lines[-2] == '    rt_robot_os yes, 40.0 us  best rclpy no, 20000 us'
    assert list(requirement_lines([Requirement('nobody', 1.0, '', {'HORUS': None})])) == []


def test_where_the_repeats_differ_a_need_says_so() -> None:
    requirement = Requirement('late by 1 ms', 1000.0, 'us', {
        'rt_robot_os': Metric((40.0, 50.0, 9000.0)), 'threads': Metric((5000.0,) * 3)}, case='x')
    assert (requirement.agrees('rt_robot_os'), requirement.agrees('threads')) == (False, True)
    result = CaseResult('x', 'x', (), (), requirements=(requirement,))
    grid = next(b for b in requirements([result])
                if isinstance(b, TableBlock))
    assert grid.rows == [('late by 1 ms', 'x', 'yes (?), 50.0 us', 'no, 5000 us',
                          'rt_robot_os (?)')]
    lines = '\n'.join(requirement_lines([requirement]))
    assert 'rt_robot_os yes (?), 50.0 us  threads no, 5000 us' in lines


def test_missed_aims_stand_under_their_reason_what_is_not_explained_last() -> None:
    def missed(text: str, why: str) -> Target:
        return Target(text, 1.0, Metric((2.5,)), 'us', why=why)

    result = CaseResult('x', 'x', (), (
        missed('a', NOTHING), missed('b', f'cold caches; {NOTHING}'), missed('c', 'cold caches'),
        Target('d', 1.0, Metric((0.5,)), why='cold caches')))
    lists = [block.items for block in verdicts([result]) if isinstance(block, Bullets)]
    assert lists == [
        ['b (case x): 2.50 us, the target is ≤ 1 us', 'c (case x): 2.50 us, the target is ≤ 1 us'],
        ['a (case x): 2.50 us, the target is ≤ 1 us']]


def test_a_system_has_its_colour_in_every_picture_and_no_curves_look_alike() -> None:
    first = styles(['paper', 'rt_robot_os topic', 'rclpy EventsExecutor', 'HORUS'])
    second = styles(['rclpy EventsExecutor, mean', 'rclpy EventsExecutor, max', 'rt_robot_os'])
    assert first[2] == second[0] and first[1] == second[2]
    assert second[0][0] == second[1][0] and second[0][1] != second[1][1]
    # Ours and an ordinary program never look the same.
    for other in ('threads, computing', 'loop'):
        ours, theirs = styles(['rt_robot_os', other])
        assert ours[0] != theirs[0]
    many = styles([f'variant {i}' for i in range(20)] + [f'rt_robot_os {i}' for i in range(9)])
    assert len(set(many[:20])) == 20 and len(set(many[20:])) == 9


#: What red, green and blue become for people without red or green cones: Machado, Oliveira,
#: Fernandes, "A physiologically-based model for simulation of color vision deficiency", 2009.
_EYES = {
    'all cones': np.eye(3),
    'no red cones': np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                              [-0.003882, -0.048116, 1.051998]]),
    'no green cones': np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                                [-0.011820, 0.042940, 0.968881]])}


def _lab(colour: str, eye: np.ndarray) -> np.ndarray:
    """Return a colour as CIE L*a*b*, in which 2.3 is a difference that is just seen."""
    srgb = np.array([int(colour[i:i + 2], 16) / 255 for i in (1, 3, 5)])
    rgb = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    rgb = np.clip(eye @ rgb, 0, 1)
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
                   ) @ rgb / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize('eye', _EYES)
def test_the_colours_of_one_picture_are_apart_for_everybody(eye: str) -> None:
    labels = [f'rt_robot_os, {each}' for each in ('pure', 'compiled', 'link', 'node', 'old')]
    for others in (['rclpy Single', 'paper'], ['HORUS', 'clock_nanosleep'], ['threads', 'loop']):
        colours = [_lab(colour, _EYES[eye]) for colour, _ in styles(labels + others)]
        near = min(float(np.linalg.norm(one - other))
                   for one, other in itertools.combinations(colours, 2))
        assert near > 10, (others, near)


def test_curves_are_told_apart_by_shape_too() -> None:
    pytest.importorskip('matplotlib')
    lines = [Series(f'rt_robot_os {i}', list(range(100)), [float(i)] * 100) for i in range(7)]
    text = svg(Plot('many', 'many', 'x', 'y', lines), 'u')
    # Each curve refers to the outline of its own mark.
    marks = set(re.findall(r'<use xlink:href="#(u-m[0-9a-f]+)"[^>]*stroke: #', text)) or set(
        re.findall(r'<path id="(u-m[0-9a-f]+)"', text))
    assert len(marks) >= 7


def test_groups_stand_over_their_columns_or_before_each() -> None:
    grid = TableBlock(('', 'p50', 'p99', 'of due'), [('a', '1', '2', '100')], ['ours'],
                      groups=(('', ''), ('latency', 'us'), ('latency', 'us'), ('calls', '%')))
    assert ('<th colspan="2"><span>latency, us</span></th><th colspan="1"><span>calls, %</span>'
            in page([grid]))
    assert markdown([grid], '').splitlines()[0] == (
        '|  | latency p50, us | latency p99, us | calls of due, % |')


def test_a_table_in_markdown_keeps_bars_and_indents() -> None:
    said = markdown([TableBlock(('', 'p50, us'), [('a|b', '1.0'), ('  of which', '0.5'),
                                                  ('rclpy', 'not available: no')],
                                ['', '', 'absent'])], 'images/')
    assert said.splitlines() == [
        '|  | p50, us |', '|---|---:|', r'| a\|b | 1.0 |', '| &nbsp;&nbsp;of which | 0.5 |',
        '| rclpy | not available: no |']


def test_the_bar_fills_and_goes_away() -> None:
    terminal = Terminal()
    progress = ProgressLine(terminal, 10.0)
    progress.show('first')
    progress.done(5.0)
    progress.show('second')
    progress.clear()
    shown = terminal.getvalue().split('\r\x1b[K')
    assert shown[1].startswith('[........................]   0 %')
    assert shown[2].startswith('[############............]  50 %')
    assert shown[2].endswith('second')
    assert shown[-1] == ''


def test_without_a_terminal_there_is_no_bar() -> None:
    stream = io.StringIO()
    ProgressLine(stream, 10.0).show('first')
    assert stream.getvalue() == ''


@pytest.mark.parametrize('seconds, text', [(5, '5 s'), (89, '89 s'), (600, '10 min'),
                                           (86_400, '24.0 h')])
def test_durations_are_written_as_people_do(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_what_makes_figures_doubtful_is_said() -> None:
    fine = {**describe(), 'cores_allowed': [0, 1], 'load_average': [0.1], 'ros_distro': 'jazzy'}
    assert warnings(fine) == []
    said = warnings({**fine, 'cores_allowed': [0], 'load_average': [3.0], 'ros_distro': 'humble'})
    assert [words in line for words, line in zip(
        ('One core only', 'busy with other work', "'humble'"), said)] == [True] * 3
    assert len(said) == 3


def test_the_command_names_no_folder_of_the_machine() -> None:
    assert command(['delay', '--out', '/data/me/r', '--json=/var/x.json', '--full']) == (
        'ros2 run rt_robot_os bench delay --out r --json=x.json --full')

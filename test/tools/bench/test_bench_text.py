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

"""What the tables of the benchmark look like."""

from __future__ import annotations

import pytest

from rt_robot_os.tools.bench.machine_state import NOTHING
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.text_report import case_lines
from rt_robot_os.tools.bench.text_report import number
from rt_robot_os.tools.bench.text_report import target_cells
from rt_robot_os.tools.bench.text_report import verdict_line
from rt_robot_os.tools.bench.text_report import WIDTH

COLUMNS = (Column('p50', 'p50', 'us', 'latency'), Column('p99', 'p99', 'us', 'latency'),
           Column('p99', 'range', 'us', 'latency', spread=True),
           Column('part', 'of due', '%', 'calls'))


def _result(*rows: Row, targets: tuple[Target, ...] = ()) -> CaseResult:
    return CaseResult('tested', 'how it looks', (Table('', COLUMNS, rows, ('A note.',)),), targets)


def _row(label: str, *repeats: float) -> Row:
    metric = Metric(repeats)
    return Row(label, {'p50': metric, 'p99': metric, 'part': Metric((100.0,) * len(repeats))})


@pytest.mark.parametrize('value, text', [
    (0.0, '0'), (-0.0001, '0.000'), (0.1234, '0.123'), (1.234, '1.23'), (12.34, '12.3'),
    (9.996, '10.0'), (123.4, '123'), (20123.4, '20123'), (-5.678, '-5.68')])
def test_numbers_have_three_significant_digits(value: float, text: str) -> None:
    assert number(value) == text


def test_a_table_shows_medians_ranges_and_what_is_missing() -> None:
    lines = list(case_lines(_result(
        _row('ours', 21.0, 22.5, 30.0),
        Row('few samples', {'p50': Metric((1.5, 1.5)), 'p99': None, 'part': None}),
        Row('theirs', status=RunStatus.MISSING, reason='rclpy is not installed'),
        Row('again', status=RunStatus.MISSING, reason='rclpy is not installed'))))
    assert lines == [
        '== tested: how it looks '.ljust(WIDTH, '='),
        '',
        '             ---- latency, us -----  calls, %',
        '              p50   p99       range    of due',
        'ours         22.5  22.5  21.0..30.0       100',
        'few samples  1.50     -           -         -',
        'theirs       not available: rclpy is not installed',
        'again        not available, as above',
        '',
        'A note.']


def test_the_range_is_left_out_when_there_was_one_repeat() -> None:
    lines = list(case_lines(_result(_row('ours', 21.0))))
    assert 'range' not in '\n'.join(lines)
    assert lines[4].split() == ['ours', '21.0', '21.0', '100']


def test_a_long_reason_stays_within_the_terminal() -> None:
    reason = 'RuntimeError: ' + 'a long story ' * 60
    lines = list(case_lines(_result(Row('theirs', status=RunStatus.FAILED, reason=reason))))
    assert lines[4].startswith('theirs  failed: RuntimeError')
    assert max(len(line) for line in lines) <= WIDTH


def test_a_missed_target_is_as_visible_as_one_that_is_reached() -> None:
    result = _result(_row('ours', 1.0), targets=(
        Target('quick', 2.0, Metric((1.0, 1.2, 1.1)), 'us'),
        Target('slow', 2.0, Metric((3.0,)), 'us'),
        Target('many', 100.0, None, at_most=False)))
    assert list(case_lines(result))[-4:] == [
        'target    limit  measured  verdict       range',
        'quick   <= 2 us   1.10 us  reached       1.00..1.20',
        'slow    <= 2 us   3.00 us  MISSED',
        'many     >= 100         -  not measured']
    assert 'range' not in '\n'.join(list(case_lines(result, 40))[-4:])  # there is no room
    assert verdict_line([result]) == 'targets: 1 of 3 reached, 1 missed, 1 not measured'


def test_a_narrow_terminal_gets_a_wide_table_in_parts() -> None:
    result = _result(_row('ours', 21.0, 22.5, 30.0))
    lines = list(case_lines(result, 30))
    assert max(len(line) for line in lines) <= 30
    assert [line.split() for line in lines if line.startswith('ours')] == [
        ['ours', '22.5', '22.5', '21.0..30.0'], ['ours', '100']]


def test_a_measured_value_can_be_compared_with_its_limit() -> None:
    # Three digits of 199.97 would be "200", and 199.94 as well.
    assert target_cells(Target('rate', 199.95, Metric((199.94,)), 'Hz', at_most=False)) == (
        '≥ 199.95 Hz', '199.94 Hz')
    assert target_cells(Target('missed', 0.0, Metric((4.0,)))) == ('≤ 0', '4')
    assert target_cells(Target('delay', 3.0, Metric((2.0,)), 'us')) == ('≤ 3 us', '2.00 us')


def test_a_known_reason_is_not_followed_by_none() -> None:
    assert Target('x', 1.0, Metric((2.0,)), why=f'cold caches; {NOTHING}').reason == 'cold caches'
    assert Target('x', 1.0, Metric((2.0,)), why=NOTHING).reason == NOTHING
    assert Target('x', 1.0, Metric((0.5,)), why=NOTHING).reason == ''

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

"""The arithmetic of the benchmark."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.result import TargetVerdict
from rt_robot_os.tools.bench.stats import frequencies
from rt_robot_os.tools.bench.stats import inside_any
from rt_robot_os.tools.bench.stats import percentile
from rt_robot_os.tools.bench.stats import timing

MS = 1_000_000


@pytest.mark.parametrize('part, expected', [
    (0.5, 50.0), (0.99, 99.0), (1.0, 100.0), (0.01, 1.0), (0.001, 1.0), (0.505, 51.0)])
def test_a_percentile_is_the_sample_of_the_nearest_rank(part: float, expected: float) -> None:
    assert percentile(list(range(100, 0, -1)), part) == expected


def test_a_percentile_that_would_be_the_maximum_by_another_name_is_none() -> None:
    assert percentile(list(range(999)), 0.999) is None
    assert percentile(list(range(1000)), 0.999) == 998.0
    assert percentile(list(range(99)), 0.99) is None
    assert percentile([], 0.5) is None
    assert percentile([], 1.0) is None
    assert percentile([7], 1.0) == 7.0


@given(st.lists(st.integers(-2**60, 2**60), min_size=1, max_size=300),
       st.sampled_from([0.1, 0.25, 0.5, 0.9, 0.99]))
def test_a_percentile_is_a_sample_that_bounds_its_part(values: list[int], part: float) -> None:
    found = percentile(values, part)
    if found is None:
        assert len(values) * (1 - part) < 1
        return
    assert found in [float(value) for value in values]
    not_above = sum(float(value) <= found for value in values)
    assert not_above >= part * len(values) - 1e-6
    below = sum(float(value) < found for value in values)
    assert below < part * len(values) + 1e-6


def test_calls_on_time_have_the_latency_from_their_own_release() -> None:
    starts = np.array([n * MS + 30_000 for n in range(-1, 10)], np.int64)
    found = timing(starts, 0, MS, 0, 10 * MS)
    assert found.latencies.tolist() == [30_000] * 10
    assert found.intervals.tolist() == [MS] * 10
    assert (found.calls, found.expected, found.extra) == (10, 10, 0)


def test_a_late_call_serves_the_release_that_waited_longest_and_misses_the_rest() -> None:
    # Due at 1..7 ms; nothing runs between 1 ms and 5.2 ms.
    starts = np.array([10, MS + 10, int(5.2 * MS), 6 * MS + 10, 7 * MS + 10], np.int64)
    found = timing(starts, 0, MS, MS, 8 * MS)
    assert found.latencies.tolist() == [10, int(3.2 * MS), 10, 10]
    assert found.releases.tolist() == [MS, 2 * MS, 6 * MS, 7 * MS]
    assert (found.calls, found.expected, found.extra) == (4, 7, 0)


def test_a_burst_after_a_stall_is_no_punctual_call() -> None:
    starts = np.array([10, int(2.5 * MS), int(2.5 * MS) + 100, int(2.5 * MS) + 200], np.int64)
    found = timing(starts, 0, MS, 0, 4 * MS)
    assert found.latencies.tolist() == [int(1.5 * MS)]
    assert found.extra == 2


@given(st.integers(-10**12, 10**12), st.integers(1, 10**9), st.integers(0, 50),
       st.integers(0, 10**6))
def test_as_many_releases_are_expected_as_grid_points_lie_in_the_window(
        phase_ns: int, period_ns: int, periods: int, offset_ns: int) -> None:
    begin_ns = phase_ns + offset_ns % period_ns
    end_ns = begin_ns + periods * period_ns
    found = timing(np.zeros(0, np.int64), phase_ns, period_ns, begin_ns, end_ns)
    assert found.expected == periods
    assert found.calls == 0


def test_moments_are_inside_from_a_begin_to_before_its_end() -> None:
    moments = np.array([0, 10, 15, 20, 29, 30, 39, 40], np.int64)
    inside = inside_any(moments, np.array([10, 30], np.int64), np.array([20, 40], np.int64))
    assert inside.tolist() == [False, True, True, False, False, True, True, False]
    none = np.zeros(0, np.int64)
    assert inside_any(moments, none, none).tolist() == [False] * 8


def test_a_metric_is_the_median_of_the_repeats_with_their_range() -> None:
    metric = Metric((3.0, 1.0, 100.0))
    assert (metric.median, metric.lowest, metric.highest) == (3.0, 1.0, 100.0)
    assert metric.as_json()['repeats'] == [3.0, 1.0, 100.0]


@pytest.mark.parametrize('measured, at_most, verdict', [
    (Metric((4.9,)), True, TargetVerdict.REACHED), (Metric((5.0,)), True, TargetVerdict.REACHED),
    (Metric((5.1,)), True, TargetVerdict.MISSED),
    (Metric((1.0, 9.0, 9.0)), True, TargetVerdict.MISSED),
    (Metric((4.9,)), False, TargetVerdict.MISSED), (Metric((5.1,)), False, TargetVerdict.REACHED),
    (None, True, TargetVerdict.UNKNOWN)])
def test_a_verdict_compares_the_median_with_the_limit(
        measured: Metric | None, at_most: bool, verdict: TargetVerdict) -> None:
    assert Target('x', 5.0, measured, 'us', at_most).verdict is verdict


def test_the_frequency_of_a_punctual_module_is_exact_whatever_the_window() -> None:
    starts = np.arange(0, 4000) * MS + 20_000
    for every in (1, 20):
        found = frequencies(starts[::every], every, 500 * MS, 3700 * MS, 1000 * MS)
        assert found.tolist() == [1000.0] * 3


def test_a_missed_call_and_a_stall_between_two_windows_make_it_lower() -> None:
    starts = np.array([n * MS for n in range(3000) if n != 500 and not 980 <= n < 1020])
    found = frequencies(starts, 1, 0, 3000 * MS, 1000 * MS)
    assert found[0] == pytest.approx(1000.0 * (979 - 1) / 979)
    assert found[1] == pytest.approx(1000.0 * 980 / 1020)
    assert found[2] == 1000.0


def test_a_module_that_stopped_has_no_frequency() -> None:
    starts = np.arange(0, 1000) * MS
    assert frequencies(starts, 1, 0, 3000 * MS, 1000 * MS).tolist()[1:] == [0.0, 0.0]
    assert frequencies(np.zeros(0, np.int64), 1, 0, 10 * MS, 3000 * MS).tolist() == [0.0]

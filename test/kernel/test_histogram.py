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


"""Histograms: which bucket, back again, and percentiles against numpy."""

from __future__ import annotations

from hypothesis import example
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.kernel import bucket
from rt_robot_os.kernel import bucket_limits
from rt_robot_os.kernel import BUCKETS
from rt_robot_os.kernel import Histogram
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import summarise
from rt_robot_os.kernel import Summary
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.histogram import LAST_LIMIT_NS

DURATIONS = st.one_of(st.integers(0, 100), st.integers(0, 10**7),
                      st.integers(0, LAST_LIMIT_NS - 1))


@given(DURATIONS)
@example(LAST_LIMIT_NS - 1)
def test_a_duration_lies_within_the_limits_of_its_bucket(duration_ns: int) -> None:
    low, high = bucket_limits(bucket(duration_ns))
    assert low <= duration_ns < high
    assert high - low <= max(1, low / 8)


def test_buckets_follow_each_other_without_gap() -> None:
    limits = [bucket_limits(index) for index in range(BUCKETS)]
    assert limits[0] == (0, 1)
    assert all(before[1] == after[0] for before, after in zip(limits, limits[1:]))
    assert limits[-1][1] == LAST_LIMIT_NS
    for index, (low, high) in enumerate(limits):
        assert bucket(low) == bucket(high - 1) == index


@pytest.mark.parametrize('duration_ns', [1 << 42, 1 << 50, LAST_LIMIT_NS - 1])
def test_durations_of_years_have_buckets_too_and_the_maximum_is_exact(duration_ns: int) -> None:
    histogram = Histogram()
    histogram.add(duration_ns)
    assert histogram.counts[bucket(duration_ns)] == 1
    assert histogram.summary().maximum_ns == duration_ns


@given(st.lists(DURATIONS, min_size=1, max_size=400))
def test_percentiles_are_those_of_numpy_to_a_bucket(durations: list[int]) -> None:
    histogram = Histogram()
    for duration_ns in durations:
        histogram.add(duration_ns)
    summary = histogram.summary()
    exact = np.percentile(np.array(durations), [50, 99, 99.9], method='inverted_cdf')
    for found, wanted in zip((summary.p50_ns, summary.p99_ns, summary.p999_ns), exact):
        assert bucket(found) == bucket(int(wanted))
    assert summary.count == len(durations)
    assert summary.maximum_ns == max(durations)
    assert summary.p50_ns <= summary.p99_ns <= summary.p999_ns <= summary.maximum_ns


def test_an_empty_histogram_says_nothing_and_a_cleared_one_is_empty() -> None:
    histogram = Histogram()
    assert histogram.summary() == Summary() == summarise([0] * BUCKETS, 0)
    counts = histogram.counts
    histogram.add(5)
    histogram.clear()
    assert histogram.summary() == Summary()
    assert histogram.counts is counts


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=30))
def test_the_dispatcher_counts_into_the_same_buckets(durations: list[int]) -> None:
    kernel = Kernel(VirtualClock())

    def job() -> None:
        kernel.clock.spend(durations[task.runs])
        if task.runs == len(durations) - 1:
            kernel.stop()

    task = kernel.add_task('task', job, priority=50, rate_hz=997.0)
    waiting = kernel.add_task('waiting', lambda: None, priority=10, rate_hz=997.0)
    kernel.run()
    expected, late, gaps = Histogram(), Histogram(), Histogram()
    for duration_ns in durations:
        expected.add(duration_ns)
    for duration_ns in durations[:-1]:
        late.add(duration_ns)
    for before, after in zip(durations[:-1], durations[1:-1]):
        gaps.add(abs(after - before))
    for found, wanted in ((task.execution, expected), (waiting.latency, late),
                          (waiting.jitter, gaps)):
        assert found.counts == wanted.counts
        assert found.maximum_ns == wanted.maximum_ns

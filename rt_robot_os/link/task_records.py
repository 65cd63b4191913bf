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

"""
Task statistics on the link: raw counts, packed in one native call, summarised by the reader.

Percentiles cost about 100 us a task: the reader computes them, not the core.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass
import struct

from rt_robot_os.kernel import BUCKETS
from rt_robot_os.kernel import DeadlineMiss
from rt_robot_os.kernel import Histogram
from rt_robot_os.kernel import summarise
from rt_robot_os.kernel import Summary
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import TaskStatistics

# Lengths of the strings and the histograms, the state, 15 counters, 3 maxima, the latest miss.
_COUNTERS = struct.Struct('<5HB15q3q3q')
_COUNT_BYTES = array('Q').itemsize
_STATES = tuple(TaskState)
_SEPARATOR = '\0'


@dataclass(frozen=True)
class TaskCounts:
    """
    The buckets of a task's histograms, up to the last that is not empty.

    The difference of two of them is the histogram of the time between them.
    """

    latency: array[int]
    execution: array[int]


def _packed(histogram: Histogram) -> bytes:
    return array('Q', histogram.counts).tobytes().rstrip(b'\0')


def encode_task(task: Task) -> bytes:
    """Pack the statistics of a task; about 20 us, each native call below 10 us."""
    task.account()
    miss = task.last_miss
    others = _SEPARATOR.join(miss.ran_instead) if miss is not None else ''
    parts = [task.name.encode(), others.encode(),
             *(_packed(h) for h in (task.latency, task.execution, task.jitter))]
    counters = _COUNTERS.pack(
        *(len(part) for part in parts), _STATES.index(task.state),
        task.priority, task.period_ns, task.releases, task.runs, task.missed,
        task.coalesced, task.failures, task.gap_maximum_ns, task.blocked_maximum_ns,
        task.execution_total_ns, task.overruns, task.aborted, task.budget_exceeded,
        task.deadline_missed, task.response_maximum_ns,
        task.latency_maximum_ns, task.execution_maximum_ns, task.jitter_maximum_ns,
        *((miss.job, miss.release_ns, miss.late_ns) if miss is not None else (0, 0, 0)))
    return b''.join([counters, *parts])


def decode_task(record: bytes | memoryview) -> TaskStatistics:
    """Unpack and summarise the statistics of a task."""
    values = _COUNTERS.unpack_from(record)
    lengths, state = values[:5], _STATES[values[5]]
    (priority, period_ns, releases, runs, missed, coalesced, failures, gap_ns, blocked_ns,
     execution_ns, overruns, aborted, exceeded, late, response_ns) = values[6:21]
    maxima, (job, release_ns, late_ns) = values[21:24], values[24:]
    pieces = _pieces(record, lengths)
    name, others = pieces[0].decode(), pieces[1].decode()
    latency, execution, jitter = (
        _summary(piece, maximum_ns) for piece, maximum_ns in zip(pieces[2:], maxima))
    instead = tuple(others.split(_SEPARATOR)) if others else ()
    return TaskStatistics(
        name=name, priority=priority, period_ns=period_ns, releases=releases, runs=runs,
        missed=missed, coalesced=coalesced, failures=failures, latency=latency,
        execution=execution, jitter=jitter, gap_maximum_ns=gap_ns,
        blocked_maximum_ns=blocked_ns, execution_total_ns=execution_ns, state=state,
        overruns=overruns, aborted=aborted, budget_exceeded=exceeded, deadline_missed=late,
        last_miss=DeadlineMiss(job, release_ns, late_ns, instead) if job else None,
        response_maximum_ns=response_ns)


def decode_counts(record: bytes | memoryview) -> TaskCounts:
    """Unpack the histograms of a task."""
    pieces = _pieces(record, _COUNTERS.unpack_from(record)[:5])
    return TaskCounts(_counts(pieces[2]), _counts(pieces[3]))


def _pieces(record: bytes | memoryview, lengths: tuple[int, ...]) -> list[bytes]:
    at = _COUNTERS.size
    pieces: list[bytes] = []
    for length in lengths:
        pieces.append(bytes(record[at:at + length]))
        at += length
    return pieces


def _counts(packed: bytes) -> array[int]:
    counts = array('Q')
    counts.frombytes(packed + bytes(-len(packed) % _COUNT_BYTES))
    return counts[:BUCKETS]


def _summary(packed: bytes, maximum_ns: int) -> Summary:
    return summarise(_counts(packed), maximum_ns)

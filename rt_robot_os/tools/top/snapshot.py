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
Two statistics of a core make one snapshot: rates and percentages are those between the two.

A counter that is lower than before was reset: there is nothing to subtract then.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel import summarise
from rt_robot_os.kernel import Summary
from rt_robot_os.kernel import TaskStatistics
from rt_robot_os.link.core_statistics import CoreStatistics
from rt_robot_os.link.task_records import TaskCounts
from rt_robot_os.tools.top.rows import ClientRow
from rt_robot_os.tools.top.rows import DeviceRow
from rt_robot_os.tools.top.rows import KernelRow
from rt_robot_os.tools.top.rows import Snapshot
from rt_robot_os.tools.top.rows import TaskRow
from rt_robot_os.tools.top.rows import TopicRow

_TASK_COUNTERS = ('missed', 'deadline_missed', 'overruns', 'aborted', 'failures',
                  'budget_exceeded')
_MIRROR_COUNTERS = ('sent', 'full', 'lost', 'limited', 'skipped')
_BYTES_PER_MB = 1e6


@dataclass(frozen=True)
class Sample:
    """
    One sample of a core.

    :ivar at: time of day.
    :ivar cpu_s: computing time of its process so far, None when Linux does not report it.
    :ivar memory_bytes: resident memory of its process.
    """

    statistics: CoreStatistics
    at: str
    cpu_s: float | None = None
    memory_bytes: int | None = None


def compare(robot: str, now: Sample, before: Sample | None) -> Snapshot:
    """
    Make a snapshot.

    :param before: None, or of another process: rates are None then.
    """
    new, old = now.statistics, before.statistics if before is not None else None
    if old is not None and (old.core['pid'] != new.core['pid']
                            or old.core['now_ns'] >= new.core['now_ns']):
        before = old = None
    seconds = (new.core['now_ns'] - old.core['now_ns']) / NS_PER_S if old is not None else None
    interval = _Interval(new, old, seconds)
    tasks = tuple(interval.task(each) for each in new.tasks)
    return Snapshot(
        robot, now.at, seconds, interval.kernel(now, before, tasks), tasks,
        tuple(interval.topic(each) for each in new.topics),
        tuple(interval.device(each) for each in new.devices),
        tuple(interval.client(each) for each in new.clients))


def _grown(now: Mapping[str, int], before: Mapping[str, int] | None) -> dict[str, int]:
    if before is None:
        return {}
    return {key: more for key, value in now.items() if (more := value - before[key]) > 0}


def _us(duration_ns: int) -> float:
    return duration_ns / NS_PER_US


class _Interval:
    """What came between two statistics of the same process."""

    def __init__(self, now: CoreStatistics, before: CoreStatistics | None,
                 seconds: float | None) -> None:
        self._now = now
        self._seconds = seconds
        self._tasks = {t.name: t for t in before.tasks} if before else {}
        self._counts = before.counts if before else {}
        self._topics = {t['name']: t for t in before.topics} if before else {}
        self._devices = {d['name']: d for d in before.devices} if before else {}
        self._clients = {(c['name'], c['pid']): c for c in before.clients} if before else {}
        self._core = before.core if before else None

    def _rate(self, now: int, before: int | None) -> float | None:
        if before is None or self._seconds is None or now < before:
            return None
        return (now - before) / self._seconds

    def _percent(self, now_s: float, before_s: float) -> float | None:
        if self._seconds is None or now_s < before_s:
            return None
        return 100.0 * (now_s - before_s) / self._seconds

    def task(self, now: TaskStatistics) -> TaskRow:
        old = self._tasks.get(now.name)
        if old is not None and now.runs < old.runs:
            old = None
        counters = {key: getattr(now, key) for key in _TASK_COUNTERS}
        latency = execution = Summary()
        if old is not None:
            latency, execution = self._summaries(
                self._now.counts[now.name], self._counts[now.name], now)
        miss = now.last_miss
        return TaskRow(
            now.name,
            _grown(counters, {key: getattr(old, key) for key in counters} if old else None),
            now.priority, now.state.value, self._rate(now.runs, old.runs if old else None),
            NS_PER_S / now.period_ns if now.period_ns else 0.0,
            *_percentiles(latency), _us(now.latency.maximum_ns),
            *_percentiles(execution), _us(now.execution.maximum_ns),
            self._percent(now.execution_total_ns / NS_PER_S, old.execution_total_ns / NS_PER_S)
            if old else None,
            now.runs, now.missed, now.deadline_missed, now.overruns, now.aborted, now.failures,
            now.budget_exceeded, _us(now.blocked_maximum_ns),
            _us(miss.late_ns) if miss is not None else None,
            miss.ran_instead if miss is not None else ())

    @staticmethod
    def _summaries(now: TaskCounts, old: TaskCounts, task: TaskStatistics
                   ) -> tuple[Summary, Summary]:
        return (summarise(_difference(now.latency, old.latency), task.latency.maximum_ns),
                summarise(_difference(now.execution, old.execution), task.execution.maximum_ns))

    def topic(self, now: dict[str, Any]) -> TopicRow:
        old = self._topics.get(now['name'])
        readers = tuple(s for s in now['subscribers'] if not s['name'].startswith('link:'))
        lost = {s['name']: s['lost'] for s in readers}
        before = {s['name']: s['lost'] for s in old['subscribers']} if old else {}
        new = {f'lost by {name}': more for name, count in lost.items()
               if old and (more := count - before.get(name, 0)) > 0}
        return TopicRow(
            now['name'], new, now['type_name'],
            self._rate(now['published'], old['published'] if old else None), now['rate_hz'],
            (self._now.core['now_ns'] - now['stamp_ns']) / NS_PER_S if now['stamp_ns'] else None,
            now['depth'], now['slot_bytes'], now['published'], sum(lost.values()), readers)

    def device(self, now: dict[str, Any]) -> DeviceRow:
        old = self._devices.get(now['name'])
        counters = _device_counters(now)
        return DeviceRow(
            now['name'], _grown(counters, _device_counters(old) if old else None), now['state'],
            self._rate(now['device']['samples'], old['device']['samples'] if old else None),
            now['age_ns'] / NS_PER_S if now['age_ns'] >= 0 else None,
            now['faults'], now['opened'], now['device']['lost_samples'],
            now['device']['rejected_bytes'], now['device']['rejected_frames'], now['reason'])

    def client(self, now: dict[str, Any]) -> ClientRow:
        old = self._clients.get((now['name'], now['pid']))
        counters = _client_counters(now)
        before = _client_counters(old) if old else None
        return ClientRow(
            now['name'], {key: more for key, more in _grown(counters, before).items()
                          if key not in ('sent', 'received')},
            now['pid'], self._rate(counters['sent'], before['sent'] if before else None),
            counters['sent'], counters['full'], counters['lost'], counters['limited'],
            counters['skipped'], counters['dropped'],
            counters['received'], counters['refused'], now['quiet_ns'] / NS_PER_S,
            tuple(now['mirrors']))

    def kernel(self, now: Sample, before: Sample | None, tasks: tuple[TaskRow, ...]) -> KernelRow:
        core, old = now.statistics.core, self._core
        shares = [row.cpu_percent for row in tasks if row.cpu_percent is not None]
        used = None
        if before is not None and now.cpu_s is not None and before.cpu_s is not None:
            used = self._percent(now.cpu_s, before.cpu_s)
        return KernelRow(
            'core', _grown(_core_counters(core), _core_counters(old) if old else None),
            core['pid'], core['elapsed_ns'] / NS_PER_S, sum(shares) if shares else None, used,
            now.memory_bytes / _BYTES_PER_MB if now.memory_bytes is not None else None,
            self._rate(core['wakeups'], old['wakeups'] if old else None), core['failures_total'],
            core['refused'], core['watchdog'], core['black_box'], tuple(core['realtime']),
            tuple(core.get('simulated', ())), bool(core.get('simulation_asked', True)),
            core.get('stolen', 0), _us(core.get('stolen_maximum_ns', 0)),
            self._percent(core.get('overhead_ns', 0) / NS_PER_S,
                          old.get('overhead_ns', 0) / NS_PER_S) if old else None)


def _core_counters(core: dict[str, Any]) -> dict[str, int]:
    return {'failures': core['failures_total'], 'clients_refused': core['refused'],
            'stolen': core.get('stolen', 0), **core['black_box']}


def _percentiles(summary: Summary) -> tuple[float | None, float | None]:
    return (_us(summary.p50_ns), _us(summary.p99_ns)) if summary.count else (None, None)


def _difference(now: array[int], before: array[int]) -> list[int]:
    padded = list(before) + [0] * (len(now) - len(before))
    return [max(0, a - b) for a, b in zip(now, padded)]


def _device_counters(device: dict[str, Any]) -> dict[str, int]:
    own = device['device']
    return {'faults': device['faults'],
            **{key: own[key] for key in ('lost_samples', 'rejected_bytes', 'rejected_frames')}}


def _client_counters(client: dict[str, Any]) -> dict[str, int]:
    return {**{key: sum(m[key] for m in client['mirrors']) for key in _MIRROR_COUNTERS},
            'dropped': client['outbox_dropped'], 'received': client['received'],
            'refused': client['refused']}

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

"""Turn the core's statistics into `diagnostic_msgs`."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from types import MappingProxyType
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.safe_text import safe_text
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import TaskStatistics
from rt_robot_os.link.core_statistics import CoreStatistics
from rt_robot_os.link.core_statistics import SHIPPED_IN_USE
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.link.stamp_mapper import STEP_NS

HOLD_S = 10.0


@dataclass
class _Counter:
    total: int
    gains: deque[tuple[float, int]] = field(default_factory=deque)
    gained: int = 0


class Recent:
    """
    Remember when each counter of a core increased.

    :param hold_s: how long an increase counts as recent.
    """

    def __init__(self, hold_s: float = HOLD_S) -> None:
        self.hold_s = hold_s
        self._now_s = 0.0
        self._young = False
        self._counters: dict[str, _Counter] = {}
        self._seen: set[str] = set()

    def begin(self, now_s: float, age_s: float) -> None:
        """
        Start a round; counters that were not queried in the last round are removed.

        :param now_s: the core's time.
        :param age_s: how long the core has run: all counts of a young core are recent.
        """
        self._counters = {k: c for k, c in self._counters.items() if k in self._seen}
        self._seen = set()
        self._now_s = now_s
        self._young = age_s < self.hold_s

    def clear(self) -> None:
        """Remove all counters, for another core."""
        self._counters.clear()

    def gained(self, key: str, total: int) -> int:
        """
        Return the recent increase of a counter.

        :param key: a name of the counter, the same in each round.
        """
        self._seen.add(key)
        counter = self._counters.get(key)
        if counter is None or total < counter.total:
            base = 0 if self._young or counter is not None else total
            counter = self._counters[key] = _Counter(base)
        if total > counter.total:
            counter.gains.append((self._now_s, total - counter.total))
            counter.gained += total - counter.total
            counter.total = total
        while counter.gains and self._now_s - counter.gains[0][0] >= self.hold_s:
            counter.gained -= counter.gains.popleft()[1]
        return counter.gained


OK, WARN, ERROR, STALE = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR,
                          DiagnosticStatus.STALE)


def _status(name: str, level: bytes, message: str, values: dict[str, Any]) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=level, name=safe_line(name), message=safe_text(message), hardware_id='rt_robot_os',
        values=[KeyValue(key=safe_line(key), value=_text(value)) for key, value in values.items()])


def _text(value: Any) -> str:
    return f'{value:.6g}' if isinstance(value, float) else safe_text(str(value))


_TROUBLES = (
    (ERROR, 'failures', '{} jobs failed'),
    (ERROR, 'aborted', '{} jobs used up their budget and were aborted'),
    (WARN, 'deadline_missed', '{} deadlines missed'),
    (WARN, 'missed', '{} releases missed'),
    (WARN, 'budget_exceeded', '{} jobs used more than their budget'))


class Diagnostics:
    """
    Make diagnostics from the statistics, compared with the previous ones.

    :param name: of the robot; each status has the name ``name: what``.
    :param rearm: the service that re-arms held tasks.
    """

    def __init__(self, name: str, rearm: str = '/robot/rearm') -> None:
        self._name = name
        self._rearm = rearm
        self._recent = Recent()
        self._before: CoreStatistics | None = None
        self._last: list[DiagnosticStatus] = []

    def judge(self, now: CoreStatistics, mapper: StampMapper,
              mirrors: Iterable[tuple[str, dict[str, Any]]],
              log: Mapping[str, Any] = MappingProxyType({}),
              starved: str = '', services: Iterable[tuple[str, dict[str, Any]]] = ()
              ) -> list[DiagnosticStatus]:
        """
        Return a status for the core, each device, task, module, topic, client, service and so on.

        Losses and misses cause a warning for ten seconds; the totals remain among the values.

        :param starved: why the statistics are old; empty if they are not.
        """
        if now is not self._before:
            self._last = [*self._parts(now, mapper, mirrors, log), *(
                _status(f'{self._name}: service {what}', OK, 'served', values)
                for what, values in services)]
        return [self._core(now, starved), *self._last]

    def _parts(self, now: CoreStatistics, mapper: StampMapper,
               mirrors: Iterable[tuple[str, dict[str, Any]]], log: Mapping[str, Any]
               ) -> list[DiagnosticStatus]:
        before, self._before = self._before, now
        if before is not None and before.core['pid'] != now.core['pid']:
            before = None
        if before is None:
            self._recent.clear()
        self._recent.begin(now.core['now_ns'] / NS_PER_S, now.core['elapsed_ns'] / NS_PER_S)
        return [
            *self._simulation(now), *(self._device(d) for d in now.devices),
            *(self._task(t) for t in now.tasks),
            *(self._resource(r) for r in now.resources),
            *(self._module(m) for m in now.modules if m['values']),
            *(self._topic(t, now, before) for t in now.topics),
            *(self._client(c) for c in now.clients),
            *(self._mirror(what, values) for what, values in mirrors),
            *([self._log(log)] if log else []), self._clock(mapper),
        ]

    def _mirror(self, what: str, values: dict[str, Any]) -> DiagnosticStatus:
        warning = values.pop('warning', '')
        return _status(f'{self._name}: mirror {what}', WARN if warning else OK,
                       warning or 'carried', values)

    def silent(self, reason: str) -> list[DiagnosticStatus]:
        """Return the status of a core that is not available."""
        self._before = None
        return [_status(f'{self._name}: core', ERROR, reason, {})]

    def _core(self, now: CoreStatistics, starved: str) -> DiagnosticStatus:
        lacking = [r for r in now.core['realtime'] if not r['ok']]
        level = WARN if lacking else OK
        message = ('not active: ' + ', '.join(r['step'] for r in lacking)) if lacking else (
            'running')
        if starved:
            level, message = WARN, starved
        threads = ', '.join(now.core.get('threads', ()))
        if threads:
            level, message = WARN, f'threads in the core, which delay every task: {threads}'
        watchdog = now.core['watchdog']
        if watchdog not in ('off', 'healthy'):
            level, message = ERROR, f'watchdog: {watchdog}'
        values = {r['step']: 'in force' if r['ok'] else r['reason'] for r in now.core['realtime']}
        values |= {'uptime_s': now.core['elapsed_ns'] / NS_PER_S,
                   'wakeups': now.core['wakeups'], 'failures': now.core['failures_total'],
                   'threads': threads or 'none',
                   'kernel_percent': 100 * now.core.get('overhead_ns', 0) / max(
                       1, now.core['elapsed_ns']),
                   'looking_percent': 100 * now.core.get('looked_ns', 0) / max(
                       1, now.core['elapsed_ns']),
                   'alarm_costs_us': now.core.get('alarm_ns', 0) / 1000,
                   'stolen_by_linux': now.core.get('stolen', 0),
                   'stolen_by_linux_max_us': now.core.get('stolen_maximum_ns', 0) / 1000,
                   'clients_accepted': now.core['accepted'],
                   'simulators_restarted': now.core.get('simulators_restarted', 0),
                   'clients_refused': now.core['refused'], 'pid': now.core['pid'],
                   'watchdog': watchdog,
                   'tap_dropped': now.core.get('tap_dropped', 0),
                   **{f'black_box_{key}': n for key, n in now.core['black_box'].items()}}
        return _status(f'{self._name}: core', level, message, values)

    def _simulation(self, now: CoreStatistics) -> Iterator[DiagnosticStatus]:
        """Yield a status with the simulated devices, so that their samples are not mistaken."""
        names = ', '.join(now.core.get('simulated', ()))
        if names:
            asked = now.core['simulation_asked']
            yield _status(f'{self._name}: simulated', OK if asked else WARN,
                          f'simulated: {names}', {'asked for': 'yes' if asked else
                                                  f'no: {SHIPPED_IN_USE}'})

    def _device(self, device: dict[str, Any]) -> DiagnosticStatus:
        state = device['state']
        # An active device has a reason when its frames are valid but contain no sample.
        level = {'active': WARN if device['reason'] else OK, 'opening': WARN,
                 'closed': STALE}.get(state, ERROR)
        message = f'{state}: {device["reason"]}' if device['reason'] else state
        counters = dict(device['device'])
        values = {'faults': device['faults'], 'opened': device['opened'],
                  'age_s': device['age_ns'] / NS_PER_S, **counters.pop('more', {}), **counters}
        return _status(f'{self._name}: device {device["name"]}', level, message, values)

    def _task(self, task: TaskStatistics) -> DiagnosticStatus:
        level, message = self._trouble(task)
        miss = task.last_miss
        return _status(f'{self._name}: task {task.name}', level, message, {
            'priority': task.priority, 'rate_hz': NS_PER_S / task.period_ns if task.period_ns
            else 0.0, 'releases': task.releases, 'runs': task.runs, 'missed': task.missed,
            'coalesced': task.coalesced, 'failures': task.failures,
            'state': task.state.value, 'overruns': task.overruns, 'aborted': task.aborted,
            'budget_exceeded': task.budget_exceeded, 'deadline_missed': task.deadline_missed,
            'last_miss_us': miss.late_ns / 1000 if miss is not None else 0.0,
            'last_miss_ran_instead': ', '.join(miss.ran_instead) if miss is not None else '',
            'response_max_us': task.response_maximum_ns / 1000,
            'latency_p50_us': task.latency.p50_ns / 1000,
            'latency_p99_us': task.latency.p99_ns / 1000,
            'latency_max_us': task.latency.maximum_ns / 1000,
            'execution_p50_us': task.execution.p50_ns / 1000,
            'execution_max_us': task.execution.maximum_ns / 1000,
            'jitter_p99_us': task.jitter.p99_ns / 1000,
            'gap_max_us': task.gap_maximum_ns / 1000,
            'blocked_others_max_us': task.blocked_maximum_ns / 1000})

    def _trouble(self, task: TaskStatistics) -> tuple[bytes, str]:
        """Return the worst current or recent problem of a task."""
        gained = {key: self._recent.gained(f'task {task.name} {key}', getattr(task, key))
                  for _, key, _ in _TROUBLES}
        if task.state in (TaskState.SAFE, TaskState.STOPPED):
            what = 'in its safe state' if task.state is TaskState.SAFE else 'stopped'
            return ERROR, (f'{what}; see the log. To re-arm it: ros2 service call '
                           f'{self._rearm} std_srvs/srv/Trigger')
        if task.state is TaskState.BACKOFF:
            return ERROR, 'failed; it restarts automatically after a pause'
        for level, key, text in _TROUBLES:
            if gained[key]:
                return level, text.format(gained[key]) + self._lately + self._instead(task, key)
        return OK, 'on time'

    @staticmethod
    def _instead(task: TaskStatistics, key: str) -> str:
        miss = task.last_miss
        if key != 'deadline_missed' or miss is None:
            return ''
        others = f'; ran instead: {", ".join(miss.ran_instead)}' if miss.ran_instead else ''
        return f', the last by {miss.late_ns / 1000:.0f} us{others}'

    def _resource(self, resource: dict[str, Any]) -> DiagnosticStatus:
        return _status(f'{self._name}: resource {resource["name"]}', OK, 'shared', {
            'users': ', '.join(resource['users']), 'ceiling': resource['ceiling'],
            'entries': resource['entries'], 'held_max_us': resource['held_maximum_ns'] / 1000})

    def _module(self, module: dict[str, Any]) -> DiagnosticStatus:
        values = dict(module['values'])
        warning = values.pop('warning', '')
        return _status(f'{self._name}: module {module["name"]}', WARN if warning else OK,
                       warning or 'at work', values)

    def _topic(self, topic: dict[str, Any], now: CoreStatistics,
               before: CoreStatistics | None) -> DiagnosticStatus:
        rate_hz = 0.0
        if before:
            old = next((t for t in before.topics if t['name'] == topic['name']), topic)
            elapsed_s = (now.core['now_ns'] - before.core['now_ns']) / NS_PER_S
            rate_hz = (topic['published'] - old['published']) / elapsed_s
        readers = [s for s in topic['subscribers'] if not s['name'].startswith('link:')]
        lost = {s['name']: n for s in readers if (n := self._recent.gained(
            f'topic {topic["name"]} {s["name"]}', s['lost']))}
        values = {'type': topic['type_name'], 'published': topic['published'],
                  'rate_hz': rate_hz, 'expected_rate_hz': topic['rate_hz'],
                  'depth': topic['depth'], 'subscribers': len(readers)}
        values |= {f'lost by {s["name"]}': s['lost'] for s in readers}
        message = f'{rate_hz:.1f} Hz' if topic['published'] else 'nothing published yet'
        if lost:
            losses = ', '.join(f'{count} by {name}' for name, count in lost.items())
            message = f'samples lost{self._lately}: {losses}'
        return _status(f'{self._name}: topic {topic["name"]}', WARN if lost else OK, message,
                       values)

    def _client(self, client: dict[str, Any]) -> DiagnosticStatus:
        drops = self._drops(client)
        new = self._recent.gained(f'client {client["pid"]} {client["name"]}', drops)
        values = {'pid': client['pid'], 'received': client['received'], 'large': client['large'],
                  'refused': client['refused'], 'dropped': drops}
        for mirror in client['mirrors']:
            for key in ('sent', 'full', 'lost', 'skipped', 'limited'):
                values[f'{mirror["topic"]} {key}'] = mirror[key]
        text = f'{new} samples or answers dropped{self._lately}' if new else 'keeps up'
        if new and client['refused'] and client.get('last_refusal'):
            text += f'; last refusal: {client["last_refusal"]}'
        return _status(f'{self._name}: client {client["name"]}', WARN if new else OK, text, values)

    @property
    def _lately(self) -> str:
        return f' within the last {self._recent.hold_s:g} s'

    @staticmethod
    def _drops(client: dict[str, Any]) -> int:
        return int(client['refused'] + client['outbox_dropped']
                   + sum(m['full'] + m['lost'] for m in client['mirrors']))

    def _log(self, log: Mapping[str, Any]) -> DiagnosticStatus:
        lost = self._recent.gained('log lost', int(log.get('lost', 0)))
        untold = self._recent.gained('log untold', int(log.get('untold', 0)))
        unread = self._recent.gained('log unread', int(log.get('unread', 0)))
        problems = [f'{count} lines {what}{self._lately}' for count, what in (
            (lost, 'are not in the file'),
            (unread, 'were not read on the console'),
            (untold, 'were not shown: they came too fast')) if count]
        return _status(f'{self._name}: log', WARN if problems else OK,
                       '; '.join(problems) or 'complete', dict(log))

    def _clock(self, mapper: StampMapper) -> DiagnosticStatus:
        ahead_ns = -mapper.error_ns
        values = {'error_s': mapper.error_ns / NS_PER_S, 'forward_steps': mapper.forward_steps}
        if ahead_ns > STEP_NS:
            return _status(f'{self._name}: clock', WARN,
                           f'the system clock was set back; stamps are {ahead_ns / 1e9:.3f} s '
                           'ahead of it and slow down until it catches up', values)
        return _status(f'{self._name}: clock', OK, 'stamps follow the system clock', values)

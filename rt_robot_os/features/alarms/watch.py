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
Technical causes of a sensor network: an unresponsive sink, unresponsive nodes, low batteries.

One module watches all nodes, from the rows of the network model. An unresponsive sink is one cause
and not one for each node behind it, because nothing is known of these meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.network_rows import names_of
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.network_rows import rows_of
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.modules.debounce import Debounce
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.topics.ports import Input

SINK_SILENT: Final = 'sink_silent'
NODE_SILENT: Final = 'node_silent'
NODE_BATTERY: Final = 'node_battery'
_SINK: Final = 'sink'
_MOST_NODES: Final = 1024
_LONGEST_S: Final = 31 * 86_400.0
# A node is back after this time with packets.
_BACK_NS: Final = 30 * NS_PER_S


class Watch(Module):
    """Report causes of a sensor network: unresponsive sink and nodes, low batteries."""

    RATE_HZ = 1.0

    nodes = Input('wsn/nodes', message='std_msgs/msg/Float64MultiArray', wake=True)
    causes = CAUSES_OUTPUT

    SETTINGS = (
        Field('sink_silent_s', float, 60.0, 'Without a packet of any node for this time the '
              'sink counts as unresponsive', 's', 1.0, _LONGEST_S),
        Field('node_silent_s', float, 120.0, 'A node is reported after this time in the state '
              'silent of the network model', 's', 1.0, _LONGEST_S),
        Field('unheard_s', float, 900.0, 'A surveyed node without any packet is reported after '
              'this time', 's', 1.0, _LONGEST_S),
        Field('battery_v', float, 2.2, 'A battery below this voltage is low', 'V', 0.1, 60.0),
        Field('battery_clear_v', float, 2.5, 'The cause clears above this voltage', 'V', 0.1,
              60.0),
        Field('battery_s', float, 600.0, 'A battery must be low for this time', 's', 0.0,
              _LONGEST_S),
        Field('ignored', list, [], 'Names of nodes that are not reported'),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Check the settings.

        :raises ConfigError: the limits of the battery contradict each other.
        """
        super().__init__(name, settings)
        if settings['battery_clear_v'] < settings['battery_v']:
            raise ConfigError([f'{name}.battery_clear_v = {settings["battery_clear_v"]:g} must be '
                               f'at least battery_v, {settings["battery_v"]:g} (V)'])
        self._reports: CauseReports | None = None
        self._wake_up = WakeUp(None, None)
        self._conditions: dict[tuple[str, str], Debounce] = {}
        self._texts: dict[tuple[str, str], tuple[str, float]] = {}
        self._names: dict[int, str] = {}
        self._since_ns = -1
        self._refused = 0

    def configure(self) -> None:
        """Prepare."""
        self._reports = CauseReports(self.causes, self.name, 256)
        self._wake_up = WakeUp(self.kernel, self.task)
        self._names = names_of(str(self.nodes.msg.layout.dim[0].label)) if len(
            self.nodes.msg.layout.dim) else {}

    def step(self) -> None:
        """Evaluate the rows that came, and what has become due."""
        reports = self._reports
        if reports is None:
            return
        now_ns = self.causes.topic.kernel.now_ns()
        while self.nodes.take():
            stamp_ns = min(self.nodes.stamp_ns, now_ns)
            self._pass_time(stamp_ns, reports)
            self._evaluate(list(rows_of(list(self.nodes.msg.data))), stamp_ns)
            self._pass_time(stamp_ns, reports)
        reports.refresh(now_ns)
        # Active conditions are evaluated with the rows, which come periodically.
        self._wake_up.no_later_than(reports.due_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return what is wrong."""
        if self._reports is None:
            return {}
        wrong = [f'{kind} {subject}' for (kind, subject), each in list(self._conditions.items())
                 if each.on]
        return {'wrong': ', '.join(wrong[:16]), 'watched': len(self._conditions),
                'not_watched': self._refused, **self._reports.statistics()}

    # ---- work --------------------------------------------------------------------------------

    def _evaluate(self, rows: list[NodeRow], stamp_ns: int) -> None:
        if self._since_ns < 0:
            self._since_ns = stamp_ns
        s = self.settings
        sink = next((row for row in rows if row.state == NodeState.SINK), None)
        quiet_s = math.inf if sink is None else sink.age_s
        if not quiet_s >= 0.0:  # NaN: never heard
            quiet_s = (stamp_ns - self._since_ns) / NS_PER_S
        silent = quiet_s >= s['sink_silent_s']
        self._update(SINK_SILENT, _SINK, silent, stamp_ns, 0.0,
                     'No packet of the sensor network comes any more: look at the sink', quiet_s)
        for row in rows:
            name = self._names.get(int(row.id), f'node_{row.id:.0f}')
            if row is not sink and name not in s['ignored']:
                self._node(name, row, silent, stamp_ns)

    def _node(self, name: str, row: NodeRow, sink_silent: bool, stamp_ns: int) -> None:
        s = self.settings
        unheard = row.state == NodeState.UNHEARD
        # While the sink is unresponsive nothing is known of a single node.
        wait_s = s['unheard_s'] if unheard else s['node_silent_s']
        self._update(NODE_SILENT, name, None if sink_silent else (
            unheard or row.state == NodeState.SILENT), stamp_ns, wait_s,
            f'Node {name} {"was never heard" if unheard else "is silent"}: look at its battery '
            'and its place', row.age_s)
        low = self._conditions.get((NODE_BATTERY, name))
        limit_v = s['battery_clear_v'] if low is not None and low.on else s['battery_v']
        self._update(NODE_BATTERY, name, row.battery_v < limit_v if row.battery_v > 0.0 else None,
                     stamp_ns, s['battery_s'], f'The battery of node {name} is nearly empty: '
                     f'{row.battery_v:.2f} V', row.battery_v)

    def _update(self, kind: str, subject: str, is_so: bool | None, stamp_ns: int, wait_s: float,
                text: str, value: float) -> None:
        """Update a condition; None, for not known, leaves it unmodified."""
        key = kind, subject
        found = self._conditions.get(key)
        if found is None:
            if not is_so:
                return
            if len(self._conditions) >= _MOST_NODES:
                self._refused += 1
                return
            found = self._conditions[key] = Debounce(0, _BACK_NS)
        if is_so is None:
            found.reset()
            return
        found.on_ns = round(wait_s * NS_PER_S)
        found.put(is_so, stamp_ns)
        self._texts[key] = text, value

    def _pass_time(self, now_ns: int, reports: CauseReports) -> None:
        for kind, subject, stamp_ns, active in self._changed(now_ns):
            text, value = self._texts[kind, subject]
            node = '' if kind == SINK_SILENT else subject
            if not active:
                text = f'{subject} is well again'
            reports.report(Cause(kind, subject, Level.TECHNICAL, active, text, node=node,
                                 value=value), stamp_ns)

    def _changed(self, now_ns: int) -> Iterator[tuple[str, str, int, bool]]:
        for (kind, subject), each in list(self._conditions.items()):
            stamp_ns = each.advance(now_ns)
            if stamp_ns >= 0:
                yield kind, subject, stamp_ns, each.on
            if not each.on and each.due_ns == math.inf:
                # It is made again with the next fault.
                del self._conditions[kind, subject]
                self._texts.pop((kind, subject), None)

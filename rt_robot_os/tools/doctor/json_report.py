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

"""The report as JSON, for scripts; docs/doctor.md describes each key."""

from __future__ import annotations

from collections.abc import Mapping
import json
from typing import Any

from rt_robot_os.kernel.histogram import bucket_limits
from rt_robot_os.tools.doctor.finding import Line
from rt_robot_os.tools.doctor.finding import State
from rt_robot_os.tools.doctor.lateness import Measured
from rt_robot_os.tools.doctor.report import Report

SCHEMA = 1


def _finding(line: Line) -> dict[str, Any]:
    finding, remedy = line.finding, line.finding.remedy
    return {
        'check': line.check.key, 'group': line.group, 'title': line.check.title,
        'subject': finding.subject, 'state': finding.state.value, 'found': finding.found,
        'why': line.why, 'weight': finding.weight,
        'remedy': list(remedy.commands) if remedy else [],
        'note': remedy.note if remedy else '',
    }


def _measured(measured: Measured) -> dict[str, Any]:
    summary = measured.summary
    return {
        'count': summary.count, 'missed': measured.missed, 'p50_ns': summary.p50_ns,
        'p99_ns': summary.p99_ns, 'p999_ns': summary.p999_ns, 'maximum_ns': summary.maximum_ns,
        'histogram': [[*bucket_limits(index), count]
                      for index, count in sorted(measured.counts.items())],
    }


def document(report: Report) -> Mapping[str, Any]:
    """Turn a report into plain values."""
    wanted, wakeup = report.wanted, report.wakeup
    return {
        'schema': SCHEMA, 'verdict': report.verdict.text, 'exit_code': report.verdict.value,
        'machine': dict(report.machine),
        'wanted': {'cpu': wanted.cpu, 'priority': wanted.priority,
                   'lock_memory': wanted.lock_memory, 'ports': list(wanted.ports),
                   'cpu_latency_us': wanted.cpu_latency_us, 'spin_us': wanted.spin_us,
                   'watchdog': wanted.watchdog, 'black_box_folder': wanted.black_box_folder,
                   'source': wanted.source},
        'counts': {state.value: report.count(state) for state in State},
        'to_mend': [line.check.key for line in report.to_mend],
        'findings': [_finding(line) for line in report.lines],
        'wakeup': None if wakeup is None else {
            'seconds': wakeup.seconds, 'refused': list(wakeup.refused),
            'machine': _measured(wakeup.machine), 'kernel': _measured(wakeup.kernel)},
    }


def as_json(report: Report) -> str:
    """Write a report as JSON."""
    return json.dumps(document(report), indent=2)

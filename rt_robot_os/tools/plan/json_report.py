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

"""A report for programs: plain values, as JSON writes them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any
from typing import Final

from rt_robot_os.tools.plan.report import Report
from rt_robot_os.tools.plan.result import TaskResult
from rt_robot_os.tools.plan.text_report import verdict_lines

FORMAT: Final = 1


def document(report: Report) -> dict[str, Any]:
    """Return everything of a report; times are whole nanoseconds, parts are of 1."""
    analysis = report.analysis
    return {
        'format': FORMAT,
        'schedulable': {0: True, 1: False}.get(report.exit_code),
        'failed': [result.task.name for result in analysis.failed],
        'not_judged': [result.task.name for result in analysis.unjudged],
        'summary': '\n'.join(verdict_lines(report)),
        'remedy': report.remedy,
        'utilisation': analysis.utilisation,
        'utilisation_of_service': analysis.service,
        'utilisation_of_kernel': analysis.overhead,
        'overhead': asdict(report.robot.overhead),
        'hyper_period_ns': report.hyper_period_ns,
        'tasks': [_task(result, report) for result in analysis.tasks],
        'growth': None if report.sensitivity is None else asdict(report.sensitivity),
        'phases': {
            'before': asdict(report.phases.before), 'after': asdict(report.phases.after),
            'phases_ns': dict(report.phases.phases_ns)},
        'chains': [{
            'stages': [each._asdict() for each in chain.stages], 'bound_ns': chain.bound_ns,
            'limit_ns': chain.limit_ns, 'late': chain.late, 'reason': chain.reason}
            for chain in report.chains],
        'notes': list(report.robot.notes),
    }


def _task(result: TaskResult, report: Report) -> dict[str, Any]:
    task = result.task
    return {
        'name': task.name, 'owner': report.robot.owners[task.name], 'priority': task.priority,
        'period_ns': task.period_ns, 'phase_ns': task.phase_ns,
        'deadline_ns': task.limit_ns, 'execution_ns': task.execution_ns,
        'execution_from': report.robot.origins[task.name],
        'released_by': [asdict(event) for event in task.events],
        'utilisation': result.utilisation, 'level': result.level,
        'blocking': asdict(result.blocking), 'jitter_ns': result.jitter_ns,
        'response_ns': result.response_ns,
        'response_measured_ns': report.robot.responses_ns.get(task.name),
        'chain_ns': result.chain_ns,
        'late_ns': result.late_ns if task.limit_ns and result.response_ns is not None else None,
        'verdict': result.verdict.value, 'reason': result.reason,
    }

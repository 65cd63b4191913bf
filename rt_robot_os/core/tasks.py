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


"""Tasks of the kernel from the settings of devices and modules."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskState
from rt_robot_os.modules import Module
from rt_robot_os.settings import ModuleSettings
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import TaskSettings
from rt_robot_os.settings.tasks import kernel_keywords


def declaration(task: TaskSettings, kernel: Kernel) -> dict[str, Any]:
    """Return the keywords of :meth:`rt_robot_os.kernel.Kernel.add_task`."""
    return {**kernel_keywords(task),
            'resources': tuple(kernel.resource(name) for name in task.resources)}


def add_module_task(kernel: Kernel, module: Module, entry: ModuleSettings,
                    restart: Callable[[], object]) -> Task:
    """
    Declare the task of a module, which calls ``step()`` or resumes ``async def run()``.

    A coroutine that failed cannot be resumed, so the policy ``continue`` means ``restart``.
    """
    declared = {**declaration(entry.task, kernel), 'on_restart': restart,
                'on_safe_state': _safe_state_of(module), 'priority': entry.priority}
    if not module.is_coroutine():
        return kernel.add_task(entry.name, module.job, rate_hz=entry.rate_hz or None, **declared)
    if declared['failure'] is FailurePolicy.CONTINUE:
        declared['failure'] = FailurePolicy.RESTART
    task = kernel.add_async_task(entry.name, module.run, **declared)
    segment = task.body

    def job() -> None:
        module.apply_changes()
        segment()

    task.body = job
    return task


def _safe_state_of(module: Module) -> Callable[[], object] | None:
    return (lambda: at_once(module.task, module.safe_state)) if module.has_safe_state() else None


def at_once(task: Task | None, function: Callable[[], object]) -> None:
    """
    Call a function whose publications take effect immediately, also with logical execution time.

    Pending publications of a failed job are discarded.
    """
    outputs = task.logical.outputs if task is not None and task.logical is not None else ()
    for output in outputs:
        output(False)
    function()
    for output in outputs:
        output(True)


def held(kernel: Kernel) -> list[Task]:
    """Return the tasks that are held: they have no jobs until they are re-armed."""
    return [t for t in kernel.tasks if t.state in (TaskState.SAFE, TaskState.STOPPED)]


def resource_names(settings: RobotSettings) -> tuple[str, ...]:
    """Return the names of the shared resources, in the order of the file."""
    tasks = [*(each.task for each in settings.devices), *(each.task for each in settings.modules)]
    return tuple(dict.fromkeys(name for task in tasks for name in task.resources))

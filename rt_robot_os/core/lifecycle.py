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

"""The life cycle of the modules: created, prepared, restarted, deactivated."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import functools

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.core.tasks import add_module_task
from rt_robot_os.core.tasks import at_once
from rt_robot_os.core.time_limit import call_within
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TaskAborted
from rt_robot_os.modules import Module
from rt_robot_os.modules.registry import module_class
from rt_robot_os.settings import ModuleSettings
from rt_robot_os.topics import Bus

END_NS = 250 * NS_PER_MS


class ModuleLifecycle:
    """
    The modules, in the order of the configuration.

    :param note: logs a report: severity, module, text.
    :ivar modules: all modules.
    :ivar forced: the names of modules and devices whose last steps exceeded their time limit.
    """

    def __init__(self, note: Callable[[Severity, str, str], None]) -> None:
        self.modules: list[Module] = []
        self.forced: list[str] = []
        self._active: list[Module] = []
        self._note = note

    def add(self, entries: Sequence[ModuleSettings], kernel: Kernel, bus: Bus,
            connect_log: Callable[[object, str], None]) -> None:
        """
        Create the modules with their topics and tasks.

        :param connect_log: connects a logger, with a level.
        :raises RtRobotError: a module does not fit.
        """
        for entry in entries:
            module = module_class(entry.type)(entry.name, entry.settings)
            connect_log(module.log, entry.log_level)
            module.declare(bus, entry.rate_hz, entry.max_subscribers)
            self.modules.append(module)
        # All topics are declared now, so that each module finds those of the others.
        for entry, module in zip(entries, self.modules):
            module.bind(bus, add_module_task(
                kernel, module, entry, functools.partial(self._restart, module)))

    def prepare(self) -> None:
        """
        Configure and activate all modules.

        :raises RtRobotError: a module could not be prepared.
        """
        for module in self.modules:
            self._prepare(module)

    def _prepare(self, module: Module) -> None:
        try:
            module.configure()
            self._active.append(module)
            module.activate()
        except RtRobotError:
            raise
        except Exception as error:
            raise ConfigError([f'module {module.name!r} could not be prepared: '
                               f'{type(error).__name__}: {error}']) from error

    def _restart(self, module: Module) -> None:
        """Restart a module after a failure, without configure()."""
        try:
            at_once(module.task, module.deactivate)
        except Exception as error:
            self._note(Severity.ERROR, module.name, f'deactivate failed: {error}')
        module.activate()
        self._note(Severity.INFO, module.name, 'restarted')

    def end(self) -> None:
        """
        Deactivate the active modules in reverse order; may be called twice.

        A module that fails, or takes too long, goes to its safe state, if it has one.
        """
        while self._active:
            module = self._active.pop()
            if not self.call(module.name, module.deactivate, 'deactivate') and (
                    module.has_safe_state()):
                self.call(module.name, functools.partial(at_once, module.task, module.safe_state),
                          'safe_state')

    def call(self, name: str, function: Callable[[], object], step: str = 'close') -> bool:
        """
        Call a last step of a module or a device, with a time limit.

        :return: whether it succeeded; otherwise it is reported.
        """
        error = call_within(name, function, END_NS)
        if error is None:
            return True
        if isinstance(error, TaskAborted):
            self.forced.append(name)
        self._note(Severity.ERROR, name, f'{step} failed: {type(error).__name__}: {error}')
        return False

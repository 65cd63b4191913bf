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

"""The settings of a device or a module; some can be changed while the robot runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import ClassVar

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field


class LiveSettings:
    """
    The base of devices and modules: a name, settings, and their change between two jobs.

    :cvar SETTINGS: the settings; those with ``live=True`` can be changed while the robot runs.
    :ivar changes: changed values that take effect with the next job.
    :ivar settings: the current values, by name; they never change during a job.
    """

    SETTINGS: ClassVar[tuple[Field, ...]] = ()

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings.

        :param settings: a validated value for each of :meth:`fields`.
        """
        self.name = name
        self.settings = dict(settings)
        self.changes: dict[str, Any] = {}

    @classmethod
    def fields(cls) -> tuple[Field, ...]:
        """Return all settings."""
        return cls.SETTINGS

    def value(self, name: str) -> Any:
        """Return the value of a setting in the next job, changes included."""
        return self.changes.get(name, self.settings[name])

    def change(self, name: str, value: Any) -> Any:
        """
        Change a live setting as of the next job; can be called from any task.

        Of several changes before that job the last one counts.

        :return: the value in its declared type.
        :raises ConfigError: the setting does not exist or is not live, or the value is invalid.
        """
        fields = {field.name: field for field in self.fields() if field.live}
        if name not in fields:
            live = ', '.join(fields) or 'none'
            raise ConfigError([f'{self.name}.{name} cannot be changed while the robot runs; '
                               f'live settings: {live}'])
        problem = fields[name].problem(value)
        if problem:
            raise ConfigError([f'{self.name}.{name} = {value!r}: must be {problem}'])
        self.changes[name] = coerced = fields[name].coerce(value)
        return coerced

    def apply_changes(self) -> None:
        """Apply the changes since the last job; called between two jobs."""
        while self.changes:
            name = next(iter(self.changes))
            self.settings[name] = self.changes.pop(name)
            self.changed(name)

    def changed(self, name: str) -> None:
        """React to a changed live setting, already stored in :attr:`settings`; in the loop."""

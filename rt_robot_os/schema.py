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
Fields of a configuration: type, default, range, unit, description.

A driver, a module and the robot itself each declare their settings as a tuple of :class:`Field`.
The same declaration checks the YAML file, describes the ROS 2 parameter and documents the key.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Any

REQUIRED: Any = object()

_ARTICLES: Mapping[type, str] = {
    bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text', list: 'a list',
}


@dataclass(frozen=True)
class Field:
    """
    One setting.

    :ivar name: the key in YAML and in the ROS 2 parameter.
    :ivar kind: ``bool``, ``int``, ``float``, ``str`` or ``list`` (of ``item``).
    :ivar default: used when the key is absent; ``REQUIRED`` makes absence an error.
    :ivar minimum: smallest allowed value, in ``unit``.
    :ivar maximum: largest allowed value, in ``unit``.
    :ivar choices: the allowed values; empty allows all.
    :ivar live: may be changed while the robot runs.
    """

    name: str
    kind: type
    default: Any
    description: str
    unit: str = ''
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Any, ...] = ()
    item: type = str
    live: bool = False

    def problem(self, value: Any) -> str | None:
        """
        Say what is wrong with a value.

        :return: None when the value may be used, else what would be right.
        """
        wanted = self._wanted()
        if self.kind is list:
            if not isinstance(value, list | tuple):
                return wanted
            return None if all(self._is(v, self.item) for v in value) else wanted
        if not self._is(value, self.kind):
            return wanted
        if self.choices and value not in self.choices:
            return wanted
        if self.kind in (int, float):
            if not math.isfinite(value):
                return wanted
            if self.minimum is not None and value < self.minimum:
                return wanted
            if self.maximum is not None and value > self.maximum:
                return wanted
        return None

    def coerce(self, value: Any) -> Any:
        """Give the value its declared type; call only when :meth:`problem` found nothing."""
        if self.kind is list:
            return [self.item(v) for v in value]
        return self.kind(value)

    @staticmethod
    def _is(value: Any, kind: type) -> bool:
        if isinstance(value, bool):
            return kind is bool
        if kind is float:
            return isinstance(value, int | float)
        return isinstance(value, kind)

    def _wanted(self) -> str:
        if self.choices:
            return 'one of ' + ', '.join(str(c) for c in self.choices)
        text = _ARTICLES[self.kind]
        if self.kind is list:
            text += f' of {self.item.__name__}'
        if self.minimum is not None and self.maximum is not None:
            text += f' from {self.minimum:g} to {self.maximum:g}'
        elif self.minimum is not None:
            text += f' of at least {self.minimum:g}'
        elif self.maximum is not None:
            text += f' of at most {self.maximum:g}'
        return f'{text} {self.unit}'.rstrip()

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

"""The parameters of a running core: as they are now, as they were loaded, and their change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any
from typing import TYPE_CHECKING
import zlib

from rt_robot_os.devices.device import Device
from rt_robot_os.errors import ConfigError
from rt_robot_os.modules import Module
from rt_robot_os.reports import Severity
from rt_robot_os.schema import Field
from rt_robot_os.settings import DeviceSettings
from rt_robot_os.settings import ModuleSettings
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings.fields import DEVICE
from rt_robot_os.settings.fields import MODULE
from rt_robot_os.settings.fields import SLOWEST_HZ
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.tasks import contradictions
from rt_robot_os.units import NS_PER_S
from rt_robot_os.units import period_from_rate

if TYPE_CHECKING:
    from rt_robot_os.core.app import Core

RATE, LOG_LEVEL = 'rate_hz', 'log_level'
Part = DeviceSettings | ModuleSettings


class LiveParameters:
    """
    What may change while a core runs; not for the real-time loop.

    :param core: whose devices and modules they are.
    :param loaded: what its configuration said in the beginning.
    """

    def __init__(self, core: Core, loaded: RobotSettings) -> None:
        self._core = core
        parts: tuple[Part, ...] = (*loaded.devices, *loaded.modules)
        self._loaded = {part.name: part for part in parts}

    def facts(self) -> Iterator[dict[str, Any]]:
        """Give each parameter: name, value, loaded value, and what it means."""
        for part, owner, field in self._all():
            yield {'name': f'{part.name}.{field.name}',
                   'value': self._now(part, owner, field),
                   'loaded': self._at_first(part.name, field),
                   'unit': field.unit, 'description': field.description,
                   'wanted': field.wanted()}

    def digest(self) -> int:
        """Give a number that is another one when a value is."""
        values = [self._now(part, owner, field) for part, owner, field in self._all()]
        return zlib.crc32(repr(values).encode())

    def change(self, name: str, value: Any) -> Any:
        """
        Change a parameter, from the next release or job on.

        :param name: dotted, such as ``imu.rate_hz``.
        :return: the value in its declared type.
        :raises ConfigError: there is none of that name, or the value may not be used.
        """
        known = {f'{part.name}.{field.name}': (part, owner, field)
                 for part, owner, field in self._all()}
        if name not in known:
            raise ConfigError([f'{name}: no parameter that can be changed while the robot runs, '
                               f'{did_you_mean(name, known)}'])
        part, owner, field = known[name]
        problem = field.problem(value)
        if problem:
            raise ConfigError([f'{name} = {value!r}: must be {problem}'])
        value = field.coerce(value)
        if field.name == LOG_LEVEL:
            self._core.loggers[part.name].level = int(Severity[value.upper()])
            return value
        if field.name != RATE:
            return owner.change(field.name, value)
        for key, remedy in contradictions(value, part.task):
            raise ConfigError([f'{name} = {value!r}: {part.name}.{key} = '
                               f'{getattr(part.task, key)!r} would not fit: it {remedy}'])
        self._core.kernel.task(part.name).set_rate_hz(value)
        return value

    def _all(self) -> Iterator[tuple[Part, Device | Module, Field]]:
        settings, core = self._core.settings, self._core
        for device, managed in zip(settings.devices, core.sensors.devices):
            yield device, managed.device, _field(DEVICE, RATE)
            if device.name in core.loggers:
                yield device, managed.device, _field(DEVICE, LOG_LEVEL)
            for field in managed.device.SETTINGS:
                if field.live:
                    yield device, managed.device, field
        for entry, module in zip(settings.modules, core.modules):
            if module.task is not None and module.task.period_ns:
                yield entry, module, replace(_field(MODULE, RATE), minimum=SLOWEST_HZ)
            if entry.name in core.loggers:
                yield entry, module, _field(MODULE, LOG_LEVEL)
            for field in module.fields():
                if field.live:
                    yield entry, module, field

    def _now(self, part: Part, owner: Device | Module, field: Field) -> Any:
        if field.name == RATE:
            return _rate_of(self._core.kernel.task(part.name).period_ns)
        if field.name == LOG_LEVEL:
            return Severity(self._core.loggers[part.name].level).name.lower()
        return owner.value(field.name)

    def _at_first(self, name: str, field: Field) -> Any:
        part = self._loaded[name]
        if field.name == RATE:
            return _rate_of(period_from_rate(part.rate_hz)) if part.rate_hz else 0.0
        if field.name == LOG_LEVEL:
            return part.log_level
        return part.settings[field.name]


def _field(fields: tuple[Field, ...], name: str) -> Field:
    return next(field for field in fields if field.name == name)


def _rate_of(period_ns: int) -> float:
    """Give the shortest number of all rates that have this period: 30, not 30.0000003."""
    for digits in range(1, 18):
        rate_hz = float(f'{NS_PER_S / period_ns:.{digits}g}')
        if period_from_rate(rate_hz) == period_ns:
            return rate_hz
    return NS_PER_S / period_ns

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

"""The parameters of a running core: current values, loaded values, and changes."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
import zlib

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.live_settings import LiveSettings
from rt_robot_os.base.logger import Logger
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.core.part import Host
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.link.requests import Arguments
from rt_robot_os.link.requests import string_argument
from rt_robot_os.link.requests import value_argument
from rt_robot_os.link.session import ClientSession
from rt_robot_os.settings import PartKind
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
from rt_robot_os.settings.parameters import live_parameters
from rt_robot_os.settings.problems import did_you_mean

RATE, LOG_LEVEL = 'rate_hz', 'log_level'
_TEXT_A_PACKET = 16_384


@dataclass(frozen=True)
class _Place:
    """The access to the value of a parameter: in a task, a log, a device or a module."""

    get: Callable[[], Any]
    put: Callable[[Any], object]


class LiveParameters:
    """
    The parameters that may change while a core runs; not for the real-time loop.

    :param loaded: the settings as the configuration had them at the start.
    :param kernel: has a task with the name of each device and module.
    :param owners: the devices and modules by name.
    :param loggers: the loggers by the name of their owner.
    """

    def __init__(self, settings: RobotSettings, loaded: RobotSettings, kernel: Kernel,
                 owners: Mapping[str, LiveSettings], loggers: Mapping[str, Logger]) -> None:
        self._settings = settings
        tasks = {name: kernel.task(name) for name in owners}
        kinds = {name: PartKind(owner.fields()) for name, owner in owners.items()}
        self._places = {
            each.name: (each, place) for each in live_parameters(settings, kinds)
            if (place := _place(each.name, tasks, owners, loggers)) is not None}
        self._loaded = {each.name: each.value for each in live_parameters(loaded, kinds)}

    def attach(self, host: Host) -> None:
        """Register the requests about parameters and settings."""
        host.requests.add('change', self._change)
        host.requests.add_long('parameters', self._parameters)
        host.requests.add_long('settings', self._text)
        host.statistics.add_facts(lambda: {'parameters': self.digest()})

    def facts(self) -> Iterator[Arguments]:
        """Yield each parameter: name, value, loaded value, unit and description."""
        for name, (entry, place) in self._places.items():
            loaded = self._loaded[name]
            yield {'name': name, 'value': place.get(),
                   # A rate is rounded to its period in ns.
                   'loaded': _rate_of(period_from_rate(loaded)) if entry.task else loaded,
                   'unit': entry.field.unit, 'description': entry.field.description,
                   'wanted': entry.field.wanted()}

    def digest(self) -> int:
        """Return a checksum of all values."""
        return zlib.crc32(repr([place.get() for _, place in self._places.values()]).encode())

    def change(self, name: str, value: Any) -> Any:
        """
        Change a parameter, with effect from the next release or job.

        :param name: dotted, such as ``imu.rate_hz``.
        :return: the value in its declared type.
        :raises ConfigError: there is no such parameter, or the value is not valid.
        """
        if name not in self._places:
            raise ConfigError([f'{name}: not a parameter that can be changed while the robot '
                               f'runs, {did_you_mean(name, self._places)}'])
        entry, place = self._places[name]
        reason = entry.refusal(value)
        if reason:
            raise ConfigError([reason])
        value = entry.field.coerce(value)
        place.put(value)
        return value

    def _change(self, session: ClientSession, arguments: Arguments) -> Arguments:
        return {'value': self.change(string_argument(arguments, 'name'),
                                     value_argument(arguments))}

    def _parameters(self, session: ClientSession, arguments: Arguments) -> Iterator[Arguments]:
        yield {'file': self._settings.parameters_file, 'files': self._settings.files}
        yield from self.facts()

    def _text(self, session: ClientSession, arguments: Arguments) -> Iterator[Arguments]:
        text = to_json(self._settings)
        for start in range(0, len(text), _TEXT_A_PACKET):
            yield {'text': text[start:start + _TEXT_A_PACKET]}


def _place(name: str, tasks: Mapping[str, Task], owners: Mapping[str, LiveSettings],
           loggers: Mapping[str, Logger]) -> _Place | None:
    section, _, key = name.partition('.')
    if key == RATE:
        task = tasks[section]
        return _Place(lambda: _rate_of(task.period_ns), task.set_rate_hz)
    owner = owners[section]
    if key != LOG_LEVEL:
        return _Place(lambda: owner.value(key), lambda value: owner.change(key, value))
    logger = loggers.get(section)
    return None if logger is None else _Place(lambda: logger.level_name, logger.set_level)


def _rate_of(period_ns: int) -> float:
    """Return the shortest of all numbers with this period: 30, not 30.0000003."""
    for digits in range(1, 18):
        rate_hz = float(f'{NS_PER_S / period_ns:.{digits}g}')
        if period_from_rate(rate_hz) == period_ns:
            return rate_hz
    return NS_PER_S / period_ns

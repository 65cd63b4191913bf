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
The settings as ROS 2 parameters: declarations, permitted changes, and their effect.

Names are those of the YAML file: ``imu.rate_hz``, ``core.heartbeat_s``, ``devices``.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import attribute_of
from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import Field
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.catalogue import PartKind
from rt_robot_os.settings.installed import installed
from rt_robot_os.settings.model import DeviceSettings
from rt_robot_os.settings.model import frozen
from rt_robot_os.settings.model import LISTS
from rt_robot_os.settings.model import ModuleSettings
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import SECTIONS
from rt_robot_os.settings.model import SLOWEST_HZ
from rt_robot_os.settings.model import TaskSettings
from rt_robot_os.settings.model import TopicSettings
from rt_robot_os.settings.parts import common
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.problems import problem_of
from rt_robot_os.settings.tasks import contradictions
from rt_robot_os.settings.tree import show


Part = DeviceSettings | ModuleSettings


@dataclass(frozen=True, slots=True)
class ParameterDescription:
    """
    One ROS 2 parameter.

    :ivar name: dotted.
    :ivar value: of the declared type; lists are lists.
    :ivar field: its type, range and description.
    :ivar live: may be changed while the robot runs.
    :ivar in_core: it is changed in the core, for a device or module; a parameter of a mirror is
        changed in the node.
    :ivar task: for a rate, the other settings of the task; None for any other parameter.
    """

    name: str
    value: Any
    field: Field
    live: bool
    in_core: bool = False
    task: TaskSettings | None = None

    @property
    def read_only(self) -> bool:
        """Whether a change needs a restart."""
        return not self.live

    def refusal(self, value: Any) -> str | None:
        """Return why a new value is refused; None if it is valid."""
        remedy = problem_of(self.field, value)
        if not remedy and self.task is not None:
            section = self.name.partition('.')[0]
            for key, wrong in contradictions(self.field.coerce(value), self.task):
                remedy = (f'{section}.{key} = {show(getattr(self.task, key))} does not fit: it '
                          f'{wrong}')
                break
        return f'{self.name} = {show(value)}: {remedy}' if remedy else None


class RobotParameters:
    """
    Every parameter of a robot, and its settings with the changes since they were loaded.

    :param catalogue: with which the settings were loaded; that of the installation when None.
    :ivar settings: the current settings.
    """

    def __init__(self, settings: RobotSettings, catalogue: Catalogue | None = None) -> None:
        self.settings = settings
        self.known = {each.name: each for each in parameters(settings, catalogue)}
        self._live = {each.name: each.value for each in self.known.values() if each.live}

    def refusal(self, name: str, value: Any) -> str | None:
        """
        Check a change while the robot runs.

        :return: None if it is permitted, otherwise the reason, for ``ros2 param set``.
        """
        found = self.known.get(name)
        if found is None:
            return f'{name}: unknown parameter, {did_you_mean(name, self.known)}'
        if not found.live:
            live = f"; live: {', '.join(sorted(self._live))}" if self._live else ''
            return f'{name} is read at the start only: change the file and restart{live}'
        return found.refusal(value)

    def live_values(self) -> dict[str, Any]:
        """Return the parameters that may change while the robot runs, by dotted name."""
        return dict(self._live)

    def set(self, name: str, value: Any) -> None:  # noqa: A003
        """Store a change that :meth:`refusal` permits."""
        section, _, key = name.partition('.')
        self._live[name] = value = self.known[name].field.coerce(value)
        updates: dict[str, Any] = {
            kind: tuple(_with(part, key, value) if part.name == section else part
                        for part in getattr(self.settings, kind)) for kind in LISTS}
        self.settings = replace(self.settings, **updates)


def parameters(
    settings: RobotSettings, catalogue: Catalogue | None = None,
) -> tuple[ParameterDescription, ...]:
    """
    List every parameter of a robot, in the order of the file.

    :param catalogue: with which the settings were loaded; that of the installation when None.
    """
    return tuple(_all(settings, catalogue or installed()))


def live_parameters(settings: RobotSettings, kinds: Mapping[str, PartKind]
                    ) -> tuple[ParameterDescription, ...]:
    """
    List the live parameters of devices and modules, as :func:`parameters` does.

    :param kinds: of the devices and modules, by section name; nothing is imported.
    """
    found = (*(each for device in settings.devices
               for each in _of_device(device, kinds[device.name])),
             *(each for module in settings.modules
               for each in _of_module(module, kinds[module.name])))
    return tuple(each for each in found if each.live)


def check_change(
    settings: RobotSettings, name: str, value: Any, catalogue: Catalogue | None = None,
) -> str | None:
    """
    Check a change of a robot, see :meth:`RobotParameters.refusal`.

    :return: None if it is permitted, otherwise the reason.
    """
    return RobotParameters(settings, catalogue).refusal(name, value)


def changed(
    settings: RobotSettings, name: str, value: Any, catalogue: Catalogue | None = None,
) -> RobotSettings:
    """
    Return the settings with one change; for several use :class:`RobotParameters`.

    :raises ConfigError: :func:`check_change` refuses it.
    """
    found = RobotParameters(settings, catalogue)
    reason = found.refusal(name, value)
    if reason:
        raise ConfigError([reason])
    found.set(name, value)
    return found.settings


def _with(part: Any, key: str, value: Any) -> Any:
    own = getattr(part, 'settings', {})
    updates: dict[str, Any] = {}
    if key in own:
        updates['settings'] = frozen({**own, key: value})
    if key in part.__dataclass_fields__:
        updates[key] = value
    return replace(part, **updates)


def _all(settings: RobotSettings, catalogue: Catalogue) -> Iterator[ParameterDescription]:
    for field in declared(RobotSettings):
        value = getattr(settings, field.name)
        if field.name in LISTS:
            value = [*dict.fromkeys(part.name for part in value)]
        yield _entry(field.name, value, field)
    for name in SECTIONS:
        yield from _attributes(name, getattr(settings, name))
    for device in settings.devices:
        yield from _of_device(device, catalogue.drivers.find(device.type))
        if device.sim is not None:
            for field in catalogue.simulators.find(device.type).fields:
                yield _entry(f'{device.name}.sim.{field.name}', device.sim[field.name],
                             replace(field, live=False))
    for module in settings.modules:
        yield from _of_module(module, catalogue.modules.find(module.type))
    for topic in settings.topics:
        yield from _of_topic(topic)
    for name, mirror in {each.name: each for each in settings.mirrors}.items():
        yield from _attributes(name, mirror.as_written())
    for service in settings.services:
        yield from _attributes(service.name, service)


def _entry(name: str, value: Any, field: Field) -> ParameterDescription:
    return ParameterDescription(name, _thawed(value), field, field.live)


def _attributes(section: str, holder: Any) -> Iterator[ParameterDescription]:
    cls: type = type(holder)
    for field in declared(cls):
        value = getattr(holder, attribute_of(field.name))
        yield _entry(f'{section}.{field.name}', field.default if value is None else value, field)


def _of_device(device: DeviceSettings, kind: PartKind) -> Iterator[ParameterDescription]:
    return _of_part(device, common(DeviceSettings, kind))


def _of_module(module: ModuleSettings, kind: PartKind) -> Iterator[ParameterDescription]:
    for each in _of_part(module, common(ModuleSettings, kind)):
        if each.task is not None:
            # Whether it has a rate or is released by inputs cannot change.
            live = each.live and bool(module.rate_hz)
            lowest = (each.field.minimum or SLOWEST_HZ) if live else each.field.minimum
            each = replace(each, live=live, field=replace(each.field, live=live, minimum=lowest))
        yield each


def _of_part(part: Part, fields: Sequence[Field]) -> Iterator[ParameterDescription]:
    for field in fields:
        holder = part if hasattr(part, field.name) else part.task
        value = part.settings.get(field.name, getattr(holder, field.name, field.default))
        yield ParameterDescription(
            f'{part.name}.{field.name}', _thawed(value), field, field.live, in_core=True,
            task=part.task if field.name == 'rate_hz' else None)


def _of_topic(topic: TopicSettings) -> Iterator[ParameterDescription]:
    yield from _attributes(topic.name, topic)
    for key, value in topic.fixed.items():
        yield _entry(f'{topic.name}.fixed.{key}', value, _fixed_field(key, value))


def _fixed_field(key: str, value: Any) -> Field:
    description = 'string or length that is fixed at declaration'
    if isinstance(value, tuple):
        return Field(key, list, (), description, item=type(value[0]) if value else str)
    return Field(key, type(value), value, description)


def _thawed(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _thawed(item) for key, item in value.items()}
    return [_thawed(item) for item in value] if isinstance(value, list | tuple) else value

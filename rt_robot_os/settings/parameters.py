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
The settings as ROS 2 parameters: what to declare, what may change, and what comes of a change.

Names are those of the YAML file: ``imu.rate_hz``, ``core.heartbeat_s``, ``devices``.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
from typing import Any

from rt_robot_os.errors import ConfigError
from rt_robot_os.schema import Field
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.fields import CORE
from rt_robot_os.settings.fields import DEVICE
from rt_robot_os.settings.fields import LISTS
from rt_robot_os.settings.fields import LOG
from rt_robot_os.settings.fields import MIRROR
from rt_robot_os.settings.fields import MODULE
from rt_robot_os.settings.fields import ROBOT
from rt_robot_os.settings.fields import SLOWEST_HZ
from rt_robot_os.settings.fields import TOPIC
from rt_robot_os.settings.fields import WATCHDOG
from rt_robot_os.settings.installed import installed
from rt_robot_os.settings.model import DeviceSettings
from rt_robot_os.settings.model import frozen
from rt_robot_os.settings.model import ModuleSettings
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import TopicSettings
from rt_robot_os.settings.parts import common
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.problems import problem_of
from rt_robot_os.settings.tasks import contradictions
from rt_robot_os.settings.tree import show


@dataclass(frozen=True, slots=True)
class ParameterDescription:
    """
    One ROS 2 parameter.

    :ivar name: dotted.
    :ivar value: of the declared type; lists are lists.
    :ivar field: its type, range and description.
    :ivar live: may be changed while the robot runs.
    """

    name: str
    value: Any
    field: Field
    live: bool

    @property
    def read_only(self) -> bool:
        """Whether a change takes a new start."""
        return not self.live


def parameters(
    settings: RobotSettings, catalogue: Catalogue | None = None,
) -> tuple[ParameterDescription, ...]:
    """
    List every parameter of a robot, in the order of the file.

    :param catalogue: the one the settings were loaded with; what is installed when None.
    """
    known = catalogue or installed()
    return tuple(ParameterDescription(name, _thawed(value), field, field.live)
                 for name, value, field in _leaves(settings, known))


def check_change(
    settings: RobotSettings, name: str, value: Any, catalogue: Catalogue | None = None,
) -> str | None:
    """
    Judge a change while the robot runs.

    :return: None when it may be made, else the reason against it, for ``ros2 param set``.
    """
    known = {each.name: each for each in parameters(settings, catalogue)}
    found = known.get(name)
    if found is None:
        return f'{name}: unknown parameter, {did_you_mean(name, known)}'
    if not found.live:
        live = sorted(each.name for each in known.values() if each.live)
        changeable = f"; while it runs: {', '.join(live)}" if live else ''
        return f'{name} is read at the start only: change the file and start again{changeable}'
    remedy = problem_of(found.field, value)
    if not remedy and name.endswith('.rate_hz'):
        remedy = _rate_remedy(settings, name.partition('.')[0], found.field.coerce(value))
    return f'{name} = {show(value)}: {remedy}' if remedy else None


def _rate_remedy(settings: RobotSettings, section: str, rate_hz: float) -> str | None:
    """Say what a new rate of a device or a module would contradict."""
    parts: tuple[DeviceSettings | ModuleSettings, ...] = (*settings.devices, *settings.modules)
    for part in parts:
        if part.name == section:
            for key, remedy in contradictions(rate_hz, part.task):
                value = show(getattr(part.task, key))
                return f'{section}.{key} = {value} would not fit: it {remedy}'
    return None


def changed(
    settings: RobotSettings, name: str, value: Any, catalogue: Catalogue | None = None,
) -> RobotSettings:
    """
    Make a change, so that a core that is started again begins with it.

    :raises ConfigError: :func:`check_change` has something against it.
    """
    reason = check_change(settings, name, value, catalogue)
    if reason:
        raise ConfigError([reason])
    field = next(each.field for each in parameters(settings, catalogue) if each.name == name)
    section, _, key = name.partition('.')
    for list_name in LISTS:
        parts = tuple(_with(part, key, field.coerce(value)) if part.name == section else part
                      for part in getattr(settings, list_name))
        updates: dict[str, Any] = {list_name: parts}
        settings = replace(settings, **updates)
    return settings


def _with(part: Any, key: str, value: Any) -> Any:
    own = getattr(part, 'settings', {})
    updates: dict[str, Any] = {}
    if key in own:
        updates['settings'] = frozen({**own, key: value})
    if key in part.__dataclass_fields__:
        updates[key] = value
    return replace(part, **updates)


def _leaves(
    settings: RobotSettings, catalogue: Catalogue,
) -> Iterator[tuple[str, Any, Field]]:
    for field in ROBOT:
        value = getattr(settings, field.name)
        if field.name in LISTS:
            value = [part.name for part in value]
        yield field.name, value, field
    yield from _attributes('core', settings.core, CORE)
    yield from _attributes('watchdog', settings.watchdog, WATCHDOG)
    yield from _attributes('log', settings.log, LOG)
    for device in settings.devices:
        yield from _device(device, catalogue)
    for module in settings.modules:
        fields = common(MODULE, catalogue.modules.find(module.type))
        yield from _part(module, [_rate_of(module, field) for field in fields])
    for topic in settings.topics:
        yield from _topic(topic)
    for mirror in settings.mirrors:
        yield from _attributes(mirror.name, mirror, MIRROR)


def _rate_of(module: ModuleSettings, field: Field) -> Field:
    """Narrow the rate: a module has one or its inputs release it, which does not change."""
    if field.name != 'rate_hz' or field.minimum:
        return field
    return replace(field, minimum=SLOWEST_HZ) if module.rate_hz else replace(field, live=False)


def _attributes(section: str, holder: Any, fields: Iterable[Field]) -> Iterator[
        tuple[str, Any, Field]]:
    for field in fields:
        yield f'{section}.{field.name}', getattr(holder, field.name), field


def _part(
    part: DeviceSettings | ModuleSettings, fields: Sequence[Field],
) -> Iterator[tuple[str, Any, Field]]:
    for field in fields:
        holder = part if hasattr(part, field.name) else part.task
        value = part.settings.get(field.name, getattr(holder, field.name, field.default))
        yield f'{part.name}.{field.name}', value, field


def _device(device: DeviceSettings, catalogue: Catalogue) -> Iterator[tuple[str, Any, Field]]:
    yield from _part(device, common(DEVICE, catalogue.drivers.find(device.type)))
    if device.sim is not None:
        for field in catalogue.simulators.find(device.type).fields:
            yield f'{device.name}.sim.{field.name}', device.sim[field.name], replace(
                field, live=False)


def _topic(topic: TopicSettings) -> Iterator[tuple[str, Any, Field]]:
    for field in TOPIC:
        value = topic.tail or 0 if field.name == 'tail' else getattr(topic, field.name)
        yield f'{topic.name}.{field.name}', value, field
    for key, value in topic.fixed.items():
        yield f'{topic.name}.fixed.{key}', value, _fixed_field(key, value)


def _fixed_field(key: str, value: Any) -> Field:
    description = 'text or length fixed at declaration'
    if isinstance(value, tuple):
        return Field(key, list, (), description, item=type(value[0]) if value else str)
    return Field(key, type(value), value, description)


def _thawed(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _thawed(item) for key, item in value.items()}
    return [_thawed(item) for item in value] if isinstance(value, list | tuple) else value

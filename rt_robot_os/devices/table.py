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
The table of all devices, by the ``type`` in the configuration.

Each line names a folder of this package; features add theirs in their manifests
(:mod:`rt_robot_os.base.features`), other packages in the same form::

    entry_points={'rt_robot_os.devices': ['my_sonar = my_package.my_sonar']}

The ``PARTS`` of a folder declare its content (:mod:`rt_robot_os.devices.parts`). The drivers
(:mod:`rt_robot_os.devices.registry`), the simulated devices
(:mod:`rt_robot_os.devices.simulators`) and the signatures (:mod:`rt_robot_os.devices.signatures`)
are views of this table, which imports none of them: it is read in processes that need only one of
the three.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from typing import Final
from typing import TypeVar
import warnings

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.features import devices as of_features
from rt_robot_os.base.plugins import entry_point_targets
from rt_robot_os.base.plugins import load_object
from rt_robot_os.base.plugins import PluginRegistry
from rt_robot_os.devices.parts import DeviceParts

T = TypeVar('T')

GROUP: Final = 'rt_robot_os.devices'
_PARTS: Final = 'PARTS'

# Signatures are checked in this order: u-blox before NMEA, whose sentences it sends as well; those
# that random bytes could match last.
_OWN: Final = {
    **{name: f'rt_robot_os.devices.{name}' for name in (
        'bmp280',
        'bmp388',
        'bno055',
        'camera',
        'microphone',
        'mpu6050',
        'ms5611',
        'ublox',
        'nmea',
        'xsens',
        'kobuki',
        'hokuyo',
        'roboclaw',
        'witmotion',
        'maxbotix',
        'sharp',
        'stargazer',
        'arduino_bridge',
        'odrive',
    )},
    **of_features(),
}

# Entry-point groups of the previous release: drivers and simulated devices apart, each
# `module:Class`.
OLD_DRIVERS: Final = 'rt_robot_os.drivers'
OLD_SIMULATORS: Final = 'rt_robot_os.simulators'


def parts_of(name: str, what: str = '') -> DeviceParts | None:
    """
    Return the parts of a device; None if the name is unknown.

    :param what: the requested part, for errors.
    :raises ConfigError: its folder cannot be imported, or declares no parts.
    """
    place = _OWN.get(name) or entry_point_targets(GROUP).get(name)
    if place is None:
        return _old_parts(name)
    folder, _, attribute = place.partition(':')
    found = load_object(what or f'device {name!r}', f'{folder}:{attribute or _PARTS}')
    if not isinstance(found, DeviceParts):
        raise ConfigError([
            f'{what or f"device {name!r}"} ({place}) is broken: the module in the group {GROUP} '
            f'must declare {_PARTS} = DeviceParts(...); report it to its author'])
    return found.inside(folder)


def all_parts() -> Iterator[tuple[str, DeviceParts]]:
    """Yield all devices and their parts, those of other packages first; without broken ones."""
    others = entry_point_targets(OLD_DRIVERS, GROUP).keys() - _OWN.keys()
    for name in (*sorted(others), *_OWN):
        try:
            parts = parts_of(name)
        except ConfigError:
            continue  # reported when the device is used
        if parts is not None:
            yield name, parts


class DeviceRegistry(PluginRegistry[T]):
    """A registry of one part of all devices, by name."""

    def __init__(self, base: type[T], noun: str, part: Callable[[DeviceParts], str],
                 old_group: str, optional: bool = False) -> None:
        """
        Select the part; nothing is imported.

        :param part: returns its ``module:Class``; empty for a device without it.
        :param old_group: entry-point group for it in the previous release.
        :param optional: some devices do not have it.
        """
        super().__init__(GROUP, base, noun, _OWN)
        self._part = part
        self._old_group = old_group
        self._optional = optional

    def __contains__(self, name: str) -> bool:
        """Return whether a device has this part; a broken one counts as having it."""
        return super().__contains__(name) and (not self._optional or self._has(name))

    def names(self) -> tuple[str, ...]:
        """Return the sorted names of all devices with this part, including broken ones."""
        found = super().names()
        return tuple(filter(self._has, found)) if self._optional else found

    def load(self, name: str) -> type[T]:
        """
        Import a class.

        :raises ConfigError: the name is unknown, or its plug-in is broken.
        """
        found = super().load(name)
        if told := self.deprecation(name):
            # stacklevel 1: with that of the caller, a program run as __main__ would print its own
            # line of code.
            warnings.warn(told, DeprecationWarning, stacklevel=1)
        return found

    def deprecation(self, name: str) -> str:
        """Return a warning if a name is from a deprecated entry-point group; otherwise empty."""
        if name in _OWN or name in entry_point_targets(GROUP):
            return ''
        if name not in entry_point_targets(self._old_group):
            return ''
        return (f'type {name}: the entry-point group {self._old_group} will be removed in the '
                f'next release: its package must name it in {GROUP} (docs/writing_a_driver.md)')

    def _has(self, name: str) -> bool:
        try:
            return bool(self._target(name))
        except ConfigError:
            return True  # the error is reported when the device is used

    def _target(self, name: str) -> str:
        parts = parts_of(name, f'{self._noun} {name!r}')
        return self._part(parts) if parts is not None else ''

    def _others(self) -> dict[str, str]:
        return entry_point_targets(self._old_group, GROUP)


def _old_parts(name: str) -> DeviceParts | None:
    driver = entry_point_targets(OLD_DRIVERS).get(name, '')
    simulated = entry_point_targets(OLD_SIMULATORS).get(name, '')
    return DeviceParts(driver, simulated) if driver or simulated else None

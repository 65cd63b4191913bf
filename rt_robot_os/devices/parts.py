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
The parts of a device, which its folder declares; each is imported when it is needed.

The folder of a device, here or in another package, declares in its ``__init__.py``::

    PARTS = DeviceParts(
        driver='.driver:MySonar',
        simulated='.simulated:SimulatedSonar',
        signatures=(Signature('sonar frames', '.wire:is_sonar'),))

They are names, not objects: the core never imports a simulated device, and the simulator never a
driver. A name that begins with a dot is relative to the folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import replace


@dataclass(frozen=True)
class Signature:
    """
    Identifies the bytes of a device for other drivers, such as when two ports are swapped.

    :ivar frames: a name for the bytes, such as ``sonar frames``.
    :ivar function: ``module:function``; receives some hundred bytes that begin and end anywhere in
        a frame, and returns True only when it is certain. Not called in the task of a device.
    :ivar remedy: what to do; empty for ``set type: NAME, or swap the ports``. A signature with a
        remedy is for bytes that no driver reads, and is checked last.
    """

    frames: str
    function: str
    remedy: str = ''

    def __post_init__(self) -> None:
        """
        Check what a package declares.

        :raises TypeError: the function is not given by its name.
        """
        _check_name('function', self.function)


@dataclass(frozen=True)
class DeviceParts:
    """
    The parts of a device.

    :ivar driver: ``module:Class``, a :class:`rt_robot_os.devices.device.Device`.
    :ivar simulated: ``module:Class``, a :class:`rt_robot_os.sim.base.Simulated`; empty without
        one.
    :ivar signatures: of its bytes, the most certain first.
    :ivar chips: ``module:NAME`` of a table of chip ids on I2C: register -> value -> name of the
        chip; empty without one.
    """

    driver: str
    simulated: str = ''
    signatures: tuple[Signature, ...] = ()
    chips: str = ''

    def __post_init__(self) -> None:
        """
        Check what a package declares.

        :raises TypeError: a part is not given by its name.
        """
        for part, target in (
                ('driver', self.driver), ('simulated', self.simulated), ('chips', self.chips)):
            if target != '':
                _check_name(part, target)
        if not (isinstance(self.signatures, tuple)
                and all(isinstance(each, Signature) for each in self.signatures)):
            raise TypeError(f'signatures = {self.signatures!r}: must be a tuple of Signature, '
                            'also of one: (Signature(...),)')

    def inside(self, folder: str) -> DeviceParts:
        """Return them with absolute module names."""
        return DeviceParts(
            _whole(self.driver, folder), _whole(self.simulated, folder),
            tuple(replace(each, function=_whole(each.function, folder))
                  for each in self.signatures),
            _whole(self.chips, folder))


def _check_name(part: str, target: object) -> None:
    if not (isinstance(target, str) and ':' in target):
        raise TypeError(f'{part} = {target!r}: must be a name in quotes, module:name, such as '
                        f"'.driver:MySonar'")


def _whole(target: str, folder: str) -> str:
    return folder + target if target.startswith('.') else target

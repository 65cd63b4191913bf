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
What a device consists of: the parts that its folder declares, each imported when it is needed.

The folder of a device, here or in another package, says in its ``__init__.py``::

    PARTS = DeviceParts(
        driver='.driver:MySonar',
        simulated='.simulated:SimulatedSonar',
        signatures=(Signature('sonar frames', '.wire:is_sonar'),))

They are names, not objects: the core never imports a simulated device, and the simulator never a
driver. A name that begins with a dot is one of the folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import replace


@dataclass(frozen=True)
class Signature:
    """
    What tells the bytes of a device when another driver cannot read them: two ports are swapped.

    :ivar frames: what people call the bytes, such as ``sonar frames``.
    :ivar function: ``module:function``; it takes some hundred bytes that begin and end anywhere,
        and gives True only when it is sure. Not called in the task of a device.
    :ivar remedy: what to do about them; empty for ``set type: NAME, or swap the ports``. With it
        the bytes are such as no driver reads, and are asked about last.
    """

    frames: str
    function: str
    remedy: str = ''

    def __post_init__(self) -> None:
        """
        Check what a package declares.

        :raises TypeError: it is no name.
        """
        _check_name('function', self.function)


@dataclass(frozen=True)
class DeviceParts:
    """
    The parts of a device.

    :ivar driver: ``module:Class``, a :class:`rt_robot_os.devices.device.Device`.
    :ivar simulated: ``module:Class``, a :class:`rt_robot_os.sim.base.Simulated`; empty without
        one.
    :ivar signatures: of its bytes, the surest first.
    :ivar chips: ``module:NAME`` of what tells it on an I2C bus from other chips: register -> value
        -> name of the chip; empty without one.
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
        """Return them with the whole names of their modules."""
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

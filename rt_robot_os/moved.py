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
Where what users import has gone: old imports work for one release, and name the new place.

An old module is made when somebody imports it; each of its names is the very object of the new
place.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_loader
import sys
from types import ModuleType
from typing import Any
from typing import cast
from typing import Final
from typing import TYPE_CHECKING
import warnings

if TYPE_CHECKING:  # it takes a dozen modules of the standard library with it
    from importlib.abc import Loader

_PACKAGE: Final = __name__.partition('.')[0]

# Old module -> the modules that have its names now.
MOVED: Final[dict[str, tuple[str, ...]]] = {
    'blackbox': ('tools.black_box',),
    'drivers': ('devices',),
    'drivers.barometer': ('devices.barometer',),
    'drivers.bmp280': ('devices.bmp280.driver',),
    'drivers.bmp388': ('devices.bmp388.driver',),
    'drivers.bno055': ('devices.bno055.driver',),
    'drivers.calibration': ('devices.calibration',),
    'drivers.camera': ('devices.camera.driver',),
    'drivers.capture': ('devices.capture',),
    'drivers.capture.device': ('devices.capture.device',),
    'drivers.corrections': ('devices.ublox.corrections',),
    'drivers.device': ('devices.device',),
    'drivers.framing': ('devices.framing',),
    'drivers.handshake': ('devices.serial.handshake',),
    'drivers.hokuyo': ('devices.hokuyo.driver',),
    'drivers.i2c': ('devices.i2c.bus',),
    'drivers.i2c_device': ('devices.i2c.device',),
    'drivers.imu': ('devices.imu',),
    'drivers.maxbotix': ('devices.maxbotix.driver',),
    'drivers.microphone': ('devices.microphone.driver',),
    'drivers.mpu6050': ('devices.mpu6050.driver',),
    'drivers.ms5611': ('devices.ms5611.driver',),
    'drivers.network': ('devices.serial.network',),
    'drivers.nmea': ('devices.nmea.driver',),
    'drivers.plugins': ('plugins',),
    'drivers.ports': ('devices.serial.port',),
    'drivers.ranging': ('devices.ranging',),
    'drivers.registry': ('devices.registry',),
    'drivers.serial_device': ('devices.serial.device',),
    'drivers.sharp': ('devices.sharp.driver',),
    'drivers.transport': ('devices.serial.transport',),
    'drivers.ublox': ('devices.ublox.driver',),
    'drivers.witmotion': ('devices.witmotion.driver',),
    'drivers.xsens': ('devices.xsens.driver',),
    'modules.attitude.quaternion': ('motion.quaternion',),
    'modules.ports': ('topics.ports',),
    'recording': ('clients.recording',),
    'recording.compare': ('clients.recording.compare',),
    'recording.reading': ('clients.recording.reading',),
    'recording.replay': ('clients.recording.replay',),
    'sensors': ('devices.manager', 'devices.state'),
    'sensors.manager': ('devices.manager',),
    'sim.air': ('sim.world',),
    'sim.bmp280': ('devices.bmp280.twin',),
    'sim.bmp388': ('devices.bmp388.twin',),
    'sim.bno055': ('devices.bno055.twin',),
    'sim.capture': ('devices.capture.twin', 'devices.camera.twin', 'devices.microphone.twin'),
    'sim.hokuyo': ('devices.hokuyo.twin',),
    'sim.mpu6050': ('devices.mpu6050.twin',),
    'sim.ms5611': ('devices.ms5611.twin',),
    'sim.nmea': ('devices.nmea.twin',),
    'sim.ranging': ('devices.maxbotix.twin', 'devices.sharp.twin', 'sim.world'),
    'sim.options': ('sim.base',),
    'sim.registry': ('sim.base',),
    'sim.ublox': ('devices.ublox.twin',),
    'sim.witmotion': ('devices.witmotion.twin', 'sim.world'),
    'sim.xsens': ('devices.xsens.twin',),
}

# Name in an old module -> the new place, where it has a new name as well.
RENAMED: Final[dict[str, tuple[str, str]]] = {
    'drivers.device.Publication': ('schema', 'TopicSpec'),
    'drivers.i2c_device.KNOWN_CHIPS': ('devices.recognise', 'WITHOUT_DRIVER'),
}


class _Old(ModuleType):
    """A module whose names are elsewhere."""

    def __getattr__(self, name: str) -> Any:
        """
        Return what has the name in the new place.

        :raises AttributeError: it is not there either.
        """
        if not name.startswith('__'):
            old = self.__name__.partition('.')[2]
            renamed = RENAMED.get(f'{old}.{name}')
            for place, new in [renamed] if renamed else [(each, name) for each in MOVED[old]]:
                found = getattr(import_module(f'{_PACKAGE}.{place}'), new, None)
                if found is not None:
                    warnings.warn(
                        f'{self.__name__}.{name} is now {_PACKAGE}.{place}.{new}; the old name '
                        'goes with the next release', DeprecationWarning, stacklevel=2)
                    return found
        raise AttributeError(f'module {self.__name__!r} has no attribute {name!r}')


class _OldModules:
    """Find the old modules; asked first, for their empty folders may still lie there."""

    def find_spec(self, fullname: str, path: Sequence[str] | None,
                  target: ModuleType | None = None) -> ModuleSpec | None:
        """Find an old module."""
        package, _, old = fullname.partition('.')
        if package != _PACKAGE or old not in MOVED:
            return None
        has_more = any(name.startswith(old + '.') for name in MOVED)
        return spec_from_loader(fullname, cast('Loader', self), is_package=has_more)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Make an old module."""
        return _Old(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing: each name is looked up when it is asked for."""


def install() -> None:
    """Have the old modules found; may be called twice."""
    if not any(isinstance(finder, _OldModules) for finder in sys.meta_path):
        sys.meta_path.insert(0, _OldModules())

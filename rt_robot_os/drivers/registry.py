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


"""The drivers by the name that ``type`` has in the configuration."""

from __future__ import annotations

from typing import Final

from rt_robot_os.drivers.device import Device
from rt_robot_os.drivers.plugins import PluginRegistry

DRIVERS: Final[PluginRegistry[Device]] = PluginRegistry(
    'rt_robot_os.drivers',
    Device,  # type: ignore[type-abstract]
    'driver',
    {
        'bmp280': 'rt_robot_os.drivers.bmp280:Bmp280',
        'bmp388': 'rt_robot_os.drivers.bmp388:Bmp388',
        'bno055': 'rt_robot_os.drivers.bno055:Bno055',
        'camera': 'rt_robot_os.drivers.camera:Camera',
        'hokuyo': 'rt_robot_os.drivers.hokuyo:Hokuyo',
        'maxbotix': 'rt_robot_os.drivers.maxbotix:MaxBotix',
        'microphone': 'rt_robot_os.drivers.microphone:Microphone',
        'mpu6050': 'rt_robot_os.drivers.mpu6050:Mpu6050',
        'ms5611': 'rt_robot_os.drivers.ms5611:Ms5611',
        'nmea': 'rt_robot_os.drivers.nmea:NmeaGps',
        'sharp': 'rt_robot_os.drivers.sharp:Sharp',
        'ublox': 'rt_robot_os.drivers.ublox:Ublox',
        'witmotion': 'rt_robot_os.drivers.witmotion:WitMotion',
        'xsens': 'rt_robot_os.drivers.xsens:Xsens',
    },
)

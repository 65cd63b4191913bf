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

from rt_robot_os.devices.device import Device
from rt_robot_os.plugins import PluginRegistry

DRIVERS: Final[PluginRegistry[Device]] = PluginRegistry(
    'rt_robot_os.drivers',
    Device,  # type: ignore[type-abstract]
    'driver',
    {
        'bmp280': 'rt_robot_os.devices.bmp280.driver:Bmp280',
        'bmp388': 'rt_robot_os.devices.bmp388.driver:Bmp388',
        'bno055': 'rt_robot_os.devices.bno055.driver:Bno055',
        'camera': 'rt_robot_os.devices.camera.driver:Camera',
        'hokuyo': 'rt_robot_os.devices.hokuyo.driver:Hokuyo',
        'maxbotix': 'rt_robot_os.devices.maxbotix.driver:MaxBotix',
        'microphone': 'rt_robot_os.devices.microphone.driver:Microphone',
        'mpu6050': 'rt_robot_os.devices.mpu6050.driver:Mpu6050',
        'ms5611': 'rt_robot_os.devices.ms5611.driver:Ms5611',
        'nmea': 'rt_robot_os.devices.nmea.driver:NmeaGps',
        'sharp': 'rt_robot_os.devices.sharp.driver:Sharp',
        'ublox': 'rt_robot_os.devices.ublox.driver:Ublox',
        'witmotion': 'rt_robot_os.devices.witmotion.driver:WitMotion',
        'xsens': 'rt_robot_os.devices.xsens.driver:Xsens',
    },
)

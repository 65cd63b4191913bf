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


"""The simulated devices by the name of the driver that they are for."""

from __future__ import annotations

from typing import Final

from rt_robot_os.plugins import PluginRegistry
from rt_robot_os.sim.base import Simulated

SIMULATORS: Final[PluginRegistry[Simulated]] = PluginRegistry(
    'rt_robot_os.simulators',
    Simulated,  # type: ignore[type-abstract]
    'simulated device for the driver',
    {
        'bmp280': 'rt_robot_os.devices.bmp280.twin:SimulatedBmp280',
        'bmp388': 'rt_robot_os.devices.bmp388.twin:SimulatedBmp388',
        'bno055': 'rt_robot_os.devices.bno055.twin:SimulatedBno055',
        'camera': 'rt_robot_os.devices.camera.twin:SimulatedCamera',
        'hokuyo': 'rt_robot_os.devices.hokuyo.twin:SimulatedHokuyo',
        'maxbotix': 'rt_robot_os.devices.maxbotix.twin:SimulatedMaxBotix',
        'microphone': 'rt_robot_os.devices.microphone.twin:SimulatedMicrophone',
        'mpu6050': 'rt_robot_os.devices.mpu6050.twin:SimulatedMpu6050',
        'ms5611': 'rt_robot_os.devices.ms5611.twin:SimulatedMs5611',
        'nmea': 'rt_robot_os.devices.nmea.twin:SimulatedNmea',
        'sharp': 'rt_robot_os.devices.sharp.twin:SimulatedSharp',
        'ublox': 'rt_robot_os.devices.ublox.twin:SimulatedUblox',
        'witmotion': 'rt_robot_os.devices.witmotion.twin:SimulatedWitMotion',
        'xsens': 'rt_robot_os.devices.xsens.twin:SimulatedXsens',
    },
)

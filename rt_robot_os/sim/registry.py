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

from rt_robot_os.drivers.plugins import PluginRegistry
from rt_robot_os.sim.base import Simulated

SIMULATORS: Final[PluginRegistry[Simulated]] = PluginRegistry(
    'rt_robot_os.simulators',
    Simulated,  # type: ignore[type-abstract]
    'simulated device for the driver',
    {
        'bmp280': 'rt_robot_os.sim.bmp280:SimulatedBmp280',
        'bmp388': 'rt_robot_os.sim.bmp388:SimulatedBmp388',
        'bno055': 'rt_robot_os.sim.bno055:SimulatedBno055',
        'camera': 'rt_robot_os.sim.capture:SimulatedCamera',
        'hokuyo': 'rt_robot_os.sim.hokuyo:SimulatedHokuyo',
        'maxbotix': 'rt_robot_os.sim.ranging:SimulatedMaxBotix',
        'microphone': 'rt_robot_os.sim.capture:SimulatedMicrophone',
        'mpu6050': 'rt_robot_os.sim.mpu6050:SimulatedMpu6050',
        'ms5611': 'rt_robot_os.sim.ms5611:SimulatedMs5611',
        'nmea': 'rt_robot_os.sim.nmea:SimulatedNmea',
        'sharp': 'rt_robot_os.sim.ranging:SimulatedSharp',
        'ublox': 'rt_robot_os.sim.ublox:SimulatedUblox',
        'witmotion': 'rt_robot_os.sim.witmotion:SimulatedWitMotion',
        'xsens': 'rt_robot_os.sim.xsens:SimulatedXsens',
    },
)

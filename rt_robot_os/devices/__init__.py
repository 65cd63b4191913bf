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
Devices: the contract, the manager that keeps them alive, and one folder for each of them.

A folder holds the driver, the wire format in both directions, the simulated device, and the page.

The names that authors of drivers need are here. Each is imported on first use, because the
simulator, whose devices are in the same folders, needs none of them.
"""

from __future__ import annotations

from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from rt_robot_os.devices.actuator import Actuator
    from rt_robot_os.devices.capture.device import CaptureDevice
    from rt_robot_os.devices.device import Device
    from rt_robot_os.devices.device import DeviceStatistics
    from rt_robot_os.devices.device import SamplePublisher
    from rt_robot_os.devices.framing import FrameDecoder
    from rt_robot_os.devices.framing import LineDecoder
    from rt_robot_os.devices.framing import StreamDecoder
    from rt_robot_os.devices.i2c.device import i2c_settings
    from rt_robot_os.devices.i2c.device import I2cDevice
    from rt_robot_os.devices.imu import ImuFiller
    from rt_robot_os.devices.motor_board import MotorBoard
    from rt_robot_os.devices.motor_faults import MotorFault
    from rt_robot_os.devices.partial_sums import PartialSums
    from rt_robot_os.devices.parts import DeviceParts
    from rt_robot_os.devices.parts import Signature
    from rt_robot_os.devices.ranging import RangeFiller
    from rt_robot_os.devices.serial.device import serial_settings
    from rt_robot_os.devices.serial.device import SerialDevice
    from rt_robot_os.devices.serial.handshake import Handshake
    from rt_robot_os.topics.ports import Input
    from rt_robot_os.topics.ports import Output

# The module of each name, below this package.
_PLACES: Final = {
    'Actuator': 'actuator',
    'CaptureDevice': 'capture.device',
    'Device': 'device',
    'DeviceParts': 'parts',
    'DeviceStatistics': 'device',
    'FrameDecoder': 'framing',
    'Handshake': 'serial.handshake',
    'I2cDevice': 'i2c.device',
    'ImuFiller': 'imu',
    'Input': '.topics.ports',
    'LineDecoder': 'framing',
    'MotorBoard': 'motor_board',
    'MotorFault': 'motor_faults',
    'Output': '.topics.ports',
    'PartialSums': 'partial_sums',
    'RangeFiller': 'ranging',
    'Signature': 'parts',
    'SamplePublisher': 'device',
    'SerialDevice': 'serial.device',
    'StreamDecoder': 'framing',
    'i2c_settings': 'i2c.device',
    'serial_settings': 'serial.device',
}
__all__ = [
    'Actuator',
    'CaptureDevice',
    'Device',
    'DeviceParts',
    'DeviceStatistics',
    'FrameDecoder',
    'Handshake',
    'I2cDevice',
    'ImuFiller',
    'Input',
    'LineDecoder',
    'MotorBoard',
    'MotorFault',
    'Output',
    'PartialSums',
    'RangeFiller',
    'Signature',
    'SamplePublisher',
    'SerialDevice',
    'StreamDecoder',
    'i2c_settings',
    'serial_settings',
]

lazy_names(__name__, _PLACES)

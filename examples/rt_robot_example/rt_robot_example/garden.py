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

"""The custom payload of the nodes in the garden."""

from __future__ import annotations

from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.payload import PayloadField

SOIL = Payload('soil', 0x42, (
    PayloadField('origin', 'H'),
    PayloadField('seqno', 'H'),
    PayloadField('moisture', 'H', '0.1 %', quantity='soil_moisture_percent', scale=0.1),
    PayloadField('air', 'H', quantity='temperature', conversion='sht1x_temperature'),
    PayloadField('supply', 'H', quantity='battery', conversion='battery_volts')))

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
The quantities of sensor nodes: message, unit and plausible range of a reading.

A reading is always a number in the unit of this table: in decoded packets, in custom payloads, in
simulated nodes and in the messages of ROS.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
import re
from types import MappingProxyType
from typing import Final
from typing import NamedTuple

FLOAT: Final = 'std_msgs/msg/Float64'
TEMPERATURE: Final = 'sensor_msgs/msg/Temperature'
HUMIDITY: Final = 'sensor_msgs/msg/RelativeHumidity'
ILLUMINANCE: Final = 'sensor_msgs/msg/Illuminance'
BATTERY: Final = 'sensor_msgs/msg/BatteryState'

#: Valid names of quantities; the last part of a topic's name.
NAME: Final = re.compile(r'[a-z][a-z0-9_]{0,63}', re.ASCII)


class Quantity(NamedTuple):
    """
    A quantity that a node measures.

    :ivar name: the last part of the topic's name; has the unit where the message has none.
    :ivar message: type of the message.
    :ivar field: of the message, for the number.
    :ivar unit: of a reading, as in the message.
    :ivar low: smallest plausible reading.
    :ivar high: largest plausible reading.
    """

    name: str
    message: str
    field: str
    unit: str
    low: float
    high: float

    def plausible(self, value: float) -> bool:
        """Return whether a reading is plausible; NaN never is. Safe in the real-time loop."""
        return self.low <= value <= self.high


# Ranges of wireless nodes: SHT1x, TSR light sensors, two AA cells or more. An oximeter that is
# not worn reports 0, and so does a monitor without its cable: that is not plausible.
QUANTITIES: Final[Mapping[str, Quantity]] = MappingProxyType({each.name: each for each in (
    Quantity('temperature', TEMPERATURE, 'temperature', 'degC', -60.0, 125.0),
    Quantity('humidity', HUMIDITY, 'relative_humidity', '1', 0.0, 1.1),
    Quantity('light', ILLUMINANCE, 'illuminance', 'lx', 0.0, 200_000.0),
    Quantity('battery', BATTERY, 'voltage', 'V', 0.5, 60.0),
    Quantity('pulse_per_min', FLOAT, 'data', '1/min', 10.0, 350.0),
    Quantity('respiration_per_min', FLOAT, 'data', '1/min', 1.0, 120.0),
    Quantity('spo2_percent', FLOAT, 'data', '%', 1.0, 100.0),
    Quantity('body_temperature', TEMPERATURE, 'temperature', 'degC', 15.0, 46.0),
    Quantity('systolic_mmhg', FLOAT, 'data', 'mmHg', 20.0, 300.0),
    Quantity('diastolic_mmhg', FLOAT, 'data', 'mmHg', 10.0, 250.0),
    # Supplemental oxygen: 0 is air.
    Quantity('oxygen_l_per_min', FLOAT, 'data', 'l/min', 0.0, 100.0),
    # 0 alert, 1 newly confused, 2 answers to a voice, 3 to pain, 4 to nothing.
    Quantity('consciousness', FLOAT, 'data', 'code', 0.0, 4.0),
    Quantity('acceleration_g', FLOAT, 'data', 'g', -400.0, 400.0),
    Quantity('alarm', FLOAT, 'data', 'code', 0.0, 65535.0),
    Quantity('smoke', FLOAT, 'data', '1', 0.0, 65535.0),
    Quantity('water', FLOAT, 'data', '1', 0.0, 65535.0),
    # Of a room: 1 while a person is there, else 0.
    Quantity('presence', FLOAT, 'data', '1', 0.0, 65535.0),
    # Of a worn node: the id of the nearest fixed node.
    Quantity('nearest_node', FLOAT, 'data', 'number', 0.0, 65534.0),
)})

#: Quantities that are 1 while the button is pressed (2: "I am fine"), in smoke, in water.
ALARMS: Final = frozenset({'alarm', 'smoke', 'water'})

#: Quantities of a surveyed node whose entry lists none.
DEFAULT_QUANTITIES: Final = ('temperature', 'humidity', 'light', 'battery')


def quantity(name: str) -> Quantity:
    """
    Return the quantity of a name; one that is not in the table is a number without limits.

    :raises ValueError: the name is not valid in a topic's name.
    """
    found = QUANTITIES.get(name)
    if found is not None:
        return found
    if not NAME.fullmatch(name):
        raise ValueError(f'{name[:40]!r} is not a valid name of a quantity: must be a lower case '
                         'letter, then lower case letters, digits or _, such as '
                         'soil_moisture_percent')
    # The largest finite numbers, because infinities are not plausible.
    return Quantity(name, FLOAT, 'data', '', -math.nextafter(math.inf, 0.0),
                    math.nextafter(math.inf, 0.0))

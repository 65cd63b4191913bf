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
What sensor nodes measure: the message of a reading, its unit, and its plausible range.

A reading is a number in the unit of this table everywhere: in decoded packets, in payloads of
users, in simulated nodes and in ROS messages.
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

#: How a quantity may be called; it is the last part of a topic's name.
NAME: Final = re.compile(r'[a-z][a-z0-9_]{0,63}', re.ASCII)


class Quantity(NamedTuple):
    """
    A quantity that a node measures.

    :ivar name: the last part of the topic's name; with the unit where the message has none.
    :ivar message: type of the message.
    :ivar field: of the message with the number.
    :ivar unit: of a reading, as in the message.
    :ivar low: the lowest plausible reading; a lower one means broken or not worn.
    :ivar high: the highest plausible reading.
    """

    name: str
    message: str
    field: str
    unit: str
    low: float
    high: float

    def plausible(self, value: float) -> bool:
        """Return whether a reading is plausible; NaN is not. Safe in the real-time loop."""
        return self.low <= value <= self.high


# Of wireless nodes: SHT1x, TSR light sensors, two AA cells or more. A pulse oximeter that is not
# worn says 0, and so does a monitor without its cable: that is no reading.
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
    # Oxygen that is given: 0 is air.
    Quantity('oxygen_l_per_min', FLOAT, 'data', 'l/min', 0.0, 100.0),
    # 0 alert, 1 newly confused, 2 answers to a voice, 3 to pain, 4 to nothing.
    Quantity('consciousness', FLOAT, 'data', 'code', 0.0, 4.0),
    Quantity('acceleration_g', FLOAT, 'data', 'g', -400.0, 400.0),
    Quantity('alarm', FLOAT, 'data', 'code', 0.0, 65535.0),
    Quantity('smoke', FLOAT, 'data', '1', 0.0, 65535.0),
    Quantity('water', FLOAT, 'data', '1', 0.0, 65535.0),
    # Of a room: 1 while a person is there, else 0.
    Quantity('presence', FLOAT, 'data', '1', 0.0, 65535.0),
    # Of a worn node: the number of the node that hangs next to it.
    Quantity('nearest_node', FLOAT, 'data', 'number', 0.0, 65534.0),
)})

#: Quantities that are 1 while the button is pressed (2: "I am fine"), in smoke, in water.
ALARMS: Final = frozenset({'alarm', 'smoke', 'water'})

#: What a surveyed node measures when its text names nothing.
DEFAULT_QUANTITIES: Final = ('temperature', 'humidity', 'light', 'battery')


def quantity(name: str) -> Quantity:
    """
    Return the quantity of a name; one that is not in the table is a number without limits.

    :raises ValueError: it cannot be part of a topic's name.
    """
    found = QUANTITIES.get(name)
    if found is not None:
        return found
    if not NAME.fullmatch(name):
        raise ValueError(f'{name[:40]!r} is not a name of a quantity: it must be a small letter, '
                         'then small letters, digits and _, such as soil_moisture_percent')
    # The largest numbers instead of infinities, which are not readings.
    return Quantity(name, FLOAT, 'data', '', -math.nextafter(math.inf, 0.0),
                    math.nextafter(math.inf, 0.0))

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

"""The settings of the model of a sensor network."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.features.wsn.battery_life import ALKALINE
from rt_robot_os.features.wsn.battery_life import Curve
from rt_robot_os.features.wsn.sensor_network.watch import NetworkLimits
from rt_robot_os.features.wsn.sensor_packets import PACKET_SETTINGS
from rt_robot_os.messages.survey import HIGHEST_ID
from rt_robot_os.messages.survey import MOST_NODES

_LIMITS: Final = NetworkLimits()

SETTINGS: Final = (
    Field('packets_topics', list, ['wsn/packets/alarm', 'wsn/packets/vital', 'wsn/packets/rest'],
          'Topics of the sink, one for each class, std_msgs/msg/UInt8MultiArray'),
    *PACKET_SETTINGS,
    Field('root', int, 0, "Id of the sink's own mote, as in the section of the sink", '', 0,
          HIGHEST_ID),
    Field('sink_height_m', float, 0.3, 'Height of the sink above the floor', 'm',
          0.0, 10.0),
    Field('max_nodes', int, 256, 'Largest number of nodes besides those of the survey', '', 0,
          MOST_NODES),
    Field('silent_periods', float, _LIMITS.silent_periods, 'Number of its own periods '
          'without a packet after which a node is silent', '', 1.5, 1000.0, live=True),
    Field('silent_s', float, _LIMITS.silent_s, 'Least time without a packet after which a node is '
          'silent; ten times that while its period is unknown', 's', 0.1, 86_400.0, live=True),
    Field('delivery_min', float, _LIMITS.delivery, 'Delivery of the last minutes below which '
          'a node is weak', '', 0.0, 1.0, live=True),
    Field('battery_low_v', float, _LIMITS.battery_v, 'Voltage below which a battery is nearly '
          'empty', 'V', 0.0, 60.0, live=True),
    Field('days_low', float, _LIMITS.days, 'Remaining days below which a battery is nearly empty',
          'days', 0.0, 365.0, live=True),
    Field('battery_curve', list, [each for point in ALKALINE for each in point], 'Discharge curve '
          'of the batteries: volts and remaining share of the charge in turn, both '
          'rising; default: two AA alkaline cells', '', 0.0, 60.0, item=float),
)


def limits_from(settings: Mapping[str, Any]) -> NetworkLimits:
    """Return the limits of the evaluation."""
    return NetworkLimits(
        settings['silent_periods'], settings['silent_s'], settings['delivery_min'],
        settings['battery_low_v'], settings['days_low'])


def curve_from(name: str, settings: Mapping[str, Any]) -> Curve:
    """
    Return the discharge curve.

    :raises ConfigError: it is not valid.
    """
    numbers = settings['battery_curve']
    try:
        if len(numbers) % 2:
            raise ConfigError(['an odd number of values: give volts and share in turn'])
        return Curve(list(zip(numbers[::2], numbers[1::2])))
    except ConfigError as error:
        raise ConfigError([f'{name}.battery_curve: {each}' for each in error.problems]) from error


def check_topics(name: str, settings: Mapping[str, Any]) -> None:
    """
    Check the topics of the packets.

    :raises ConfigError: there is none, or one is given twice.
    """
    topics = settings['packets_topics']
    if not topics:
        raise ConfigError([f'{name}.packets_topics is empty: name the topics of the sink, such as '
                           'wsn/packets/rest'])
    twice = sorted({each for each in topics if topics.count(each) > 1})
    if twice:
        raise ConfigError([f'{name}.packets_topics: {each!r} is given twice'
                           for each in twice])

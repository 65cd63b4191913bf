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

"""What can be set of the model of a sensor network."""

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
          'The topics of the sink, all classes, each a std_msgs/msg/UInt8MultiArray'),
    *PACKET_SETTINGS,
    Field('root', int, 0, "Number of the sink's own mote, as in the section of the sink", '', 0,
          HIGHEST_ID),
    Field('sink_height_m', float, 0.3, 'Height of the sink on the robot, above the floor', 'm',
          0.0, 10.0),
    Field('max_nodes', int, 256, 'Nodes that are kept besides those of the survey', '', 0,
          MOST_NODES),
    Field('silent_periods', float, _LIMITS.silent_periods, 'A node of which nothing is heard for '
          'so many of its own periods is silent', '', 1.5, 1000.0, live=True),
    Field('silent_s', float, _LIMITS.silent_s, 'The same in time, at least; a node whose period '
          'is not known yet has ten times that', 's', 0.1, 86_400.0, live=True),
    Field('delivery_min', float, _LIMITS.delivery, 'Share of its packets of the last minutes '
          'below which a node is weak', '', 0.0, 1.0, live=True),
    Field('battery_low_v', float, _LIMITS.battery_v, 'Volts below which a battery is nearly empty',
          'V', 0.0, 60.0, live=True),
    Field('days_low', float, _LIMITS.days, 'Days left below which it is, too', 'days', 0.0, 365.0,
          live=True),
    Field('battery_curve', list, [each for point in ALKALINE for each in point], 'Discharge curve '
          'of the batteries: volts and the share of the charge that is left, in turn, both '
          'rising; that of two AA alkaline cells', '', 0.0, 60.0, item=float),
)


def limits_from(settings: Mapping[str, Any]) -> NetworkLimits:
    """Return what counts as trouble."""
    return NetworkLimits(settings['silent_periods'], settings['silent_s'], settings['delivery_min'],
                  settings['battery_low_v'], settings['days_low'])


def curve_from(name: str, settings: Mapping[str, Any]) -> Curve:
    """
    Return the discharge curve.

    :raises ConfigError: it is none.
    """
    numbers = settings['battery_curve']
    try:
        if len(numbers) % 2:
            raise ConfigError(['a volt without its share'])
        return Curve(list(zip(numbers[::2], numbers[1::2])))
    except ConfigError as error:
        raise ConfigError([f'{name}.battery_curve: {each}' for each in error.problems]) from error


def check_topics(name: str, settings: Mapping[str, Any]) -> None:
    """
    Look at what is read.

    :raises ConfigError: nothing, or one topic twice.
    """
    topics = settings['packets_topics']
    if not topics:
        raise ConfigError([f'{name}.packets_topics is empty: name the topics of the sink, such as '
                           'wsn/packets/rest'])
    twice = sorted({each for each in topics if topics.count(each) > 1})
    if twice:
        raise ConfigError([f'{name}.packets_topics: {each!r} stands there twice'
                           for each in twice])

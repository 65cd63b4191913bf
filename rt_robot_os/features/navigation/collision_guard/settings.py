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

"""The settings of the guard, and the outline of the robot that they give."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.motion.zones import Circle
from rt_robot_os.motion.zones import Footprint
from rt_robot_os.motion.zones import Rectangle

STOP: Final = 'stop'
SLOW: Final = 'slow'

SETTINGS: Final = (
    Field('scan_topics', list, ['scan'], 'Laser scanners, each a '
          'sensor_msgs/msg/LaserScan'),
    Field('range_topics', list, [], 'Ultrasonic and infrared sensors, each a '
          'sensor_msgs/msg/Range'),
    Field('bumper_topic', str, '', 'Bumper, cliff and wheel-drop sensors, a std_msgs/msg/UInt8 '
          'of bits: 1 right, 2 centre, 4 left, 8 cliff, 16 wheel drop; empty: there are none'),
    Field('speed_limit_topic', str, '', 'Topic of a lower speed limit than linear_max_m_s, '
          'such as of the agent near people: a std_msgs/msg/Float64 in m/s that is valid until '
          'the next one; 0: no limit; empty: none'),
    Field('robot_radius_m', float, 0.2, 'Radius of a round robot', 'm', 0.01, 10.0),
    Field('footprint_m', list, [], 'How far a robot with corners reaches from base_link: to the '
          'front, to the back, to the left, to the right; empty: it is round', 'm', 0.0, 10.0,
          item=float),
    Field('clearance_m', float, 0.05, 'Distance that stays free on its sides; half of it '
          'when it passes slowly', 'm', 0.0, 2.0, live=True),
    Field('stop_m', float, 0.15,
          'The stop zone: distance before an obstacle on its path, along the '
          'path, at which it stops', 'm', 0.0, 5.0, live=True),
    Field('slow_m', float, 0.3, 'The slow zone: with an obstacle on its path nearer than this, '
          'along the path, it drives slowly; beyond is the free zone, where it drives as fast as '
          'it can brake', 'm', 0.0, 20.0, live=True),
    Field('slow_m_s', float, 0.15, 'Speed in the slow zone, of its fastest point', 'm/s', 0.01,
          5.0,
          live=True),
    Field('hysteresis_m', float, 0.05, 'After a stop the obstacle must be further away than '
          'stop_m by this before it continues', 'm', 0.0, 2.0, live=True),
    Field('deceleration_m_s2', float, 0.5, 'Deceleration; set less than is possible', 'm/s^2',
          0.01, 20.0, live=True),
    Field('deceleration_rad_s2', float, 2.0, 'The same of a turn', 'rad/s^2', 0.01, 100.0,
          live=True),
    Field('reaction_s', float, 0.2, 'From a measurement until the wheels begin to brake: age of '
          'the measurement, and lag of the motors', 's', 0.0, 5.0, live=True),
    Field('linear_max_m_s', float, 1.0, 'Largest speed', 'm/s', 0.0, 20.0, live=True),
    Field('backward_max_m_s', float, 0.1, 'Largest speed backwards, unless a sensor looks there',
          'm/s', 0.0, 20.0, live=True),
    Field('angular_max_rad_s', float, 2.0, 'Largest turning rate', 'rad/s', 0.0, 100.0,
          live=True),
    Field('timeout_s', float, 0.5, 'Age of a command at which the robot is stopped', 's', 0.01,
          60.0, live=True),
    Field('scan_timeout_s', float, 0.5, 'Time without a laser scan that is a fault', 's', 0.01,
          60.0, live=True),
    Field('range_timeout_s', float, 0.5, 'The same of a range sensor', 's', 0.01, 60.0,
          live=True),
    Field('silent', str, STOP, 'Reaction to a sensor without messages', choices=(STOP, SLOW),
          live=True),
    Field('unseen', str, STOP, 'What a sector ahead without valid readings of a scanner (NaN, 0, '
          'less than range_min) means: stop: the robot stops before it; slow: it goes on at '
          'slow_m_s. Backwards, and turning on the spot, it goes at most at backward_max_m_s into '
          'one', choices=(STOP, SLOW), live=True),
    Field('unseen_size_m', float, 0.1, 'The narrowest thing that must not be missed between two '
          'valid rays: where a gap is narrower it counts as seen', 'm', 0.01, 2.0, live=True),
    Field('unseen_speed_m_s', float, 1.0, 'Speed at which unseen obstacles may approach: space '
          'that a scanner saw free before shrinks at this speed', 'm/s', 0.05, 20.0, live=True),
    Field('bumper_timeout_s', float, 1.0, 'The same as range_timeout_s, of the bumper; 0: it '
          'publishes changes only, and has no timeout', 's', 0.0, 60.0, live=True),
    Field('scan_minimum_m', float, 0.0, 'Points of a scanner nearer than this are the robot '
          'itself; 0: its own range_min', 'm', 0.0, 5.0),
    Field('bumper_hold_s', float, 1.0, 'How long a contact counts after the bumper is released, '
          'so that the robot does not hit it again', 's', 0.0, 60.0, live=True),
)


def footprint_of(name: str, settings: Mapping[str, Any]) -> Footprint:
    """
    Return the outline.

    :param name: of the module, for errors.
    :raises ConfigError: it has another number of sides than four, or no area.
    """
    sides = settings['footprint_m']
    if not sides:
        return Circle(settings['robot_radius_m'])
    if len(sides) != 4 or sides[0] + sides[1] <= 0.0 or sides[2] + sides[3] <= 0.0:
        raise ConfigError([f'{name}.footprint_m = {list(sides)}: must be four distances from '
                           'base_link, to the front, the back, the left and the right'])
    return Rectangle(*sides)


def check_sensors(name: str, settings: Mapping[str, Any]) -> None:
    """
    Check the list of sensors.

    :raises ConfigError: it is empty, or has one sensor twice.
    """
    topics = [*settings['scan_topics'], *settings['range_topics']]
    problems = [f'{name}: {each!r} is listed twice in scan_topics and range_topics'
                for each in sorted({each for each in topics if topics.count(each) > 1})]
    if not topics and not settings['bumper_topic']:
        problems.append(f'{name}: scan_topics, range_topics and bumper_topic are empty: it has '
                        'no sensor; use twist_guard to limit speeds only')
    if settings['safe_topic'] == settings['command_topic']:
        problems.append(f'{name}.safe_topic and command_topic are both '
                        f'{settings["safe_topic"]!r}: it would receive its own output')
    if problems:
        raise ConfigError(problems)

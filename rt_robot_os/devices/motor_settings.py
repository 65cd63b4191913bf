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

"""The settings that every motor board has."""

from __future__ import annotations

from typing import Any

from rt_robot_os.base.schema import ABSENT
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.devices.battery import battery_settings
from rt_robot_os.devices.serial.device import serial_settings


def motor_settings(
    *, baud: int, rate_hz: float, wheel_radius_m: Any = REQUIRED,
    wheel_separation_m: Any = REQUIRED, ticks_per_revolution: Any = REQUIRED,
    maximum_wheel_speed_m_s: float = 1.0, empty_v: float = 0.0, full_v: float = 0.0,
    coast_s: float = 0.4,
) -> tuple[Field, ...]:
    """
    Declare the settings that every motor board has, with the defaults of one board.

    :param rate_hz: default of the rate at which the counters are read.
    :param ticks_per_revolution: default, of the wheel; None leaves the setting out.
    :param coast_s: default, for a board that lets its wheels coast; less for one that brakes.
    """
    serial = tuple(each for each in serial_settings(
        baud=baud, frame_id='base_link', topic='', rate_hz=rate_hz)
        if each.name not in ('topic', 'depth'))
    ticks = () if ticks_per_revolution is None else (
        Field('ticks_per_revolution', float, ticks_per_revolution, 'Counts of the encoder for one '
              'turn of the wheel, gear and all four edges included. Measure it: turn the wheel '
              'ten times.', '', 1.0, 1e7),)
    return serial + (
        Field('wheel_radius_m', float, wheel_radius_m, 'Radius of the wheels.', 'm', 0.001, 2.0),
        Field('wheel_separation_m', float, wheel_separation_m,
              'Distance of the wheels, from centre to centre.',
              'm', 0.01, 5.0),
    ) + ticks + (
        Field('inverted_left', bool, False,
              'The left wheel and its encoder turn backwards when the board commands forwards.'),
        Field('inverted_right', bool, False, 'As inverted_left, for the right wheel.'),
        Field('swapped', bool, False, "The right wheel is on the board's left channel, and the "
              'other way round.'),
        Field('maximum_wheel_speed_m_s', float, maximum_wheel_speed_m_s,
              'A faster command is scaled down to it, both wheels by the same factor, so that the '
              'robot stays on its curve.',
              'm/s', 0.01, 20.0),
        Field('maximum_jump', float, 0.0,
              'Largest accepted difference between two readings, in counts; 0: that of 1.5 times '
              'maximum_wheel_speed_m_s, or of 2 m/s.',
              '', 0.0, 1e7),
        Field('standstill_s', float, 0.4,
              'A wheel that stands still for this time although it is commanded to turn stops the '
              'robot: its encoder, its motor or the wheel is stuck.',
              's', 0.1, 10.0),
        Field('coast_s', float, coast_s,
              'How far it rolls after the board has switched off its motors, divided by the speed '
              'before: 0.12 m at 0.3 m/s are 0.4 s. Measure it, with its load.',
              's', 0.0, 10.0, before=ABSENT),
        Field('standstill_from_m_s', float, 0.03,
              'Slowest command at which standstill is detected; below it friction may hold the '
              'wheel.',
              'm/s', 0.001, 20.0),
        Field('left_joint', str, 'left_wheel_joint', 'Name in joint_states, as in the URDF.'),
        Field('right_joint', str, 'right_wheel_joint', 'Name in joint_states, as in the URDF.'),
    ) + battery_settings(empty_v=empty_v, full_v=full_v)

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
Kobuki mobile bases (TurtleBot 2) on their own USB port.

A ``geometry_msgs/msg/Twist`` becomes the base's command of speed and radius; its packets, fifty a
second, become ``sensor_msgs/msg/JointState``, ``sensor_msgs/msg/BatteryState``, the bits of
``motor_faults`` and ``bumper``, and, with ``imu: true``, ``sensor_msgs/msg/Imu`` in the frame of
the base: its gyroscope, and the heading that it computes from it.

The base switches off its motors when no command has arrived for 0.6 s. Commands are repeated with
each poll only while one is active, so that it does; a stop, which it does not acknowledge either,
is repeated some times.

Its clock, which is in each packet, distinguishes a base that was switched off and on from one that
drove.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.battery import CHARGING
from rt_robot_os.devices.battery import DISCHARGING
from rt_robot_os.devices.battery import FULL
from rt_robot_os.devices.battery import UNKNOWN
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.imu import ImuFiller
from rt_robot_os.devices.imu import stddev
from rt_robot_os.devices.kobuki import wire
from rt_robot_os.devices.kobuki.wire import CoreSensors
from rt_robot_os.devices.kobuki.wire import KobukiDecoder
from rt_robot_os.devices.kobuki.wire import KobukiFrame
from rt_robot_os.devices.motor_board import MotorBoard
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.devices.motor_settings import motor_settings
from rt_robot_os.motion.differential import body_velocity
from rt_robot_os.motion.differential import tick_difference
from rt_robot_os.topics.ports import Output

CLIFF: Final = 8
WHEEL_DROP: Final = 16

_BUMPER_HZ: Final = 10.0
_BATTERY_HZ: Final = 1.0
_CHARGER: Final = 0x0F
_STATES: Final = {0: DISCHARGING, wire.CHARGED: FULL, wire.CHARGING: CHARGING}
_STOPS: Final = 5
_QUESTIONS: Final = 5
_CLOCK_BITS: Final = 16
# Tolerance between the clock of the base and the arrivals.
_LATE_MS: Final = 1000
# Consecutive packets with the same time: their content is old.
_STANDS: Final = 5
# Roll and pitch are unknown.
_UNKNOWN_RAD: Final = 1000.0
_BYTE: Final = 'std_msgs/msg/UInt8'


class Kobuki(MotorBoard[KobukiFrame]):
    """A Kobuki base."""

    SETTINGS = motor_settings(
        baud=115200, rate_hz=wire.PACKET_HZ, wheel_radius_m=wire.WHEEL_RADIUS_M,
        wheel_separation_m=wire.SEPARATION_M, ticks_per_revolution=None,
        maximum_wheel_speed_m_s=0.7, empty_v=13.2, full_v=16.7, coast_s=0.2,
    ) + (
        Field('imu', bool, True, 'Publish its gyroscope.'),
        Field('imu_frame_id', str, 'base_link',
              'Coordinate frame of the gyroscope; its axes are those of the base.'),
        stddev('angular_velocity_stddev', 0.01, 'rad/s', 'each axis of the angular velocity'),
        stddev('yaw_stddev', 0.1, 'rad', 'the heading, which drifts'),
    )
    description = 'Kobuki mobile base (TurtleBot 2)'
    ANSWERS = True
    SILENCE_S = wire.SILENCE_S
    COUNTER_BITS = wire.ENCODER_BITS
    COUNTS_SURVIVE = True
    IF_SILENT = 'check that it is switched on, and its USB cable'

    bumper = Output('bumper', _BYTE, rate_hz=_BUMPER_HZ)
    buttons = Output('buttons', _BYTE, rate_hz=1.0)
    imu = Output('imu/data', 'sensor_msgs/msg/Imu')

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: the port is neither a path nor an address.
        """
        super().__init__(name, settings, KobukiDecoder())
        self._filler = ImuFiller({
            **settings, 'acceleration_stddev': 0.0, 'mag_stddev_t': 0.0,
            'roll_pitch_stddev': _UNKNOWN_RAD})
        self._stops = self._questions = 0
        self._asked_ns = 0
        self._core: CoreSensors | None = None
        self._core_ns = 0
        self._standing = self._stood = 0
        self._told: dict[str, tuple[int, int]] = {}
        self._hardware = self._firmware = self._unique_id = ''

    def counts_per_revolution(self) -> float:
        """Return the counts of its encoders in one turn of a wheel."""
        return wire.TICKS_PER_TURN

    def connected(self, attribute: str) -> bool:
        """Return whether a topic is used: that of the gyroscope only with ``imu: true``."""
        return attribute != 'imu' or bool(self.settings['imu'])

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications, the gyroscope in its frame."""
        topic = self.topic_of('imu')
        return tuple(
            replace(spec, fixed={'header.frame_id': self.settings['imu_frame_id']})
            if spec.topic == topic else spec for spec in super().publications())

    # --- commands --------------------------------------------------------------------------------

    def drive(self, left_rad_s: float, right_rad_s: float) -> None:
        """Send the velocity at which wheels of the base's own size turn at these speeds."""
        self._stops = 0
        self.send(wire.velocity_command(*body_velocity(
            left_rad_s * wire.WHEEL_RADIUS_M, right_rad_s * wire.WHEEL_RADIUS_M,
            wire.SEPARATION_M)))

    def halt(self) -> None:
        """Tell the base to stand."""
        self._stops = _STOPS
        self.send(_STAND)

    def restart(self) -> None:
        """Reset the state: the port was just opened."""
        super().restart()
        self._stops = 0
        self._questions = _QUESTIONS
        self._asked_ns = 0
        self._core = None
        self._standing = 0
        self._told.clear()

    def is_set_up(self) -> bool:
        """Return whether a packet of the base has arrived."""
        return self._core is not None

    def write(self, now_ns: int) -> None:
        """
        Repeat a stop, and request the versions of the base once.

        :raises DeviceError: the port is gone.
        """
        if self._stops and not self.is_commanded:
            self._stops -= 1
            self.send(_STAND)
        if self._questions and now_ns - self._asked_ns >= NS_PER_S and self._core is not None:
            self._questions -= 1
            self._asked_ns = now_ns
            self.send(wire.request_extra())

    # --- what it sends ---------------------------------------------------------------------------

    def handle(self, frame: KobukiFrame, arrival_ns: int) -> int:
        """Handle one packet; in the loop."""
        parts = frame.parts
        if wire.FIRMWARE in parts or wire.HARDWARE in parts or wire.UNIQUE_ID in parts:
            self._identify(parts)
        core = wire.core_of(frame)
        if core is None or not self._goes_on(core, arrival_ns):
            self._ignored_frames += 1
            return 0
        self.report_faults(core.overcurrent & 3 | (core.wheel_drop & 3) << 2)
        samples = self.update_counts(core.left, core.right, arrival_ns)
        samples += self._tell('bumper', _contacts(core), arrival_ns, _BUMPER_HZ)
        samples += self._tell('buttons', core.buttons, arrival_ns, 1.0)
        samples += self._tell_battery(core, arrival_ns)
        if self.settings['imu'] and (turned := wire.heading(parts.get(wire.INERTIA, b''))):
            samples += self._tell_imu(turned, parts.get(wire.GYRO, b''), arrival_ns)
        return samples

    def _goes_on(self, core: CoreSensors, arrival_ns: int) -> bool:
        """Check whether the clock of the base runs, and ran since the last packet."""
        before, before_ns = self._core, self._core_ns
        self._core, self._core_ns = core, arrival_ns
        if before is None:
            return True
        if core.time_ms == before.time_ms:
            self._standing += 1
            self._stood += 1
            return self._standing < _STANDS
        self._standing = 0
        passed_ms = (arrival_ns - before_ns) // NS_PER_MS
        off_ms = tick_difference(core.time_ms, before.time_ms + passed_ms, _CLOCK_BITS)
        # A clock that disagrees and has run for a shorter time was restarted meanwhile. Otherwise
        # this computer was suspended, and the waiting packets are read late.
        if abs(off_ms) > _LATE_MS and core.time_ms <= passed_ms + _LATE_MS:
            self.counters.resets += 1
            self.counters.restart()
            self.faults.flag_briefly(MotorFault.COUNTS_NEW, arrival_ns)
            self.log.warn('its clock restarted (switched off and on, or another base): brought to '
                          'rest', throttle_s=1.0)
            self.rest()
            self._watch(arrival_ns)  # the motion meanwhile says nothing about the wheels
            self._questions, self._asked_ns = _QUESTIONS, 0
        return True

    def _identify(self, parts: Mapping[int, bytes]) -> None:
        self._questions = 0
        self._hardware = wire.version(parts.get(wire.HARDWARE, b'')) or self._hardware
        self._firmware = wire.version(parts.get(wire.FIRMWARE, b'')) or self._firmware
        unique_id = parts.get(wire.UNIQUE_ID, b'').hex()
        if self._unique_id and unique_id and unique_id != self._unique_id:
            self.log.warn('another base: it was %s, it is %s', self._unique_id, unique_id)
            self.counters.restart()
        self._unique_id = unique_id or self._unique_id

    def _tell(self, topic: str, value: int, arrival_ns: int, rate_hz: float) -> int:
        """Publish a number when it changes, and otherwise periodically."""
        last, last_ns = self._told.get(topic, (-1, 0))
        if value == last and (arrival_ns - last_ns) * rate_hz < NS_PER_S:
            return 0
        self._told[topic] = value, arrival_ns
        publisher = getattr(self, topic)
        publisher.msg.data = value
        publisher.publish(arrival_ns)
        return 1

    def _tell_battery(self, core: CoreSensors, arrival_ns: int) -> int:
        last, last_ns = self._told.get('battery', (-1, 0))
        if core.charger == last and (arrival_ns - last_ns) * _BATTERY_HZ < NS_PER_S:
            return 0
        self._told['battery'] = core.charger, arrival_ns
        return self.report_battery(core.battery * wire.BATTERY_V, arrival_ns,
                                   status=_STATES.get(core.charger & _CHARGER, UNKNOWN))

    def _tell_imu(self, turned: tuple[float, float], gyro: bytes, arrival_ns: int) -> int:
        """Publish heading and rate, and of the newest measurement the other axes."""
        heading_rad, rate_rad_s = turned
        measured = wire.angular_velocities(gyro)
        roll_rad_s, pitch_rad_s = measured[-1][:2] if measured else (0.0, 0.0)
        publisher = self.imu
        self._filler.fill(
            publisher.msg, None, (roll_rad_s, pitch_rad_s, rate_rad_s),
            (0.0, 0.0, math.sin(heading_rad / 2), math.cos(heading_rad / 2)))
        publisher.publish(arrival_ns)
        return 1

    def unused(self) -> str:
        """Return that its packets are always the same."""
        return ('its clock stands still and its packets are always the same: switch it off and on'
                if self._standing >= _STANDS else '')

    def motor_counters(self) -> dict[str, Value]:
        """Return the values for ``/diagnostics``."""
        core = self._core
        return {
            **super().motor_counters(), 'hardware': self._hardware, 'firmware': self._firmware,
            'unique_id': self._unique_id, 'old_packets': self._stood,
            'charger': _charger(core.charger) if core else '',
            'voltage_v': core.battery * wire.BATTERY_V if core else 0.0,
            'buttons': core.buttons if core else 0}


_STAND: Final = wire.velocity_command(0.0, 0.0)


def _contacts(core: CoreSensors) -> int:
    """Return the bits of ``bumper``."""
    return (core.bumper & 7 | (CLIFF if core.cliff & 7 else 0)
            | (WHEEL_DROP if core.wheel_drop & 3 else 0))


def _charger(state: int) -> str:
    """Return the state of the charger in words."""
    if not state & _CHARGER:
        return 'discharging'
    where = 'at the adapter' if state & wire.ADAPTER else 'in the dock'
    return f'{"charged" if state & _CHARGER == wire.CHARGED else "charging"} {where}'

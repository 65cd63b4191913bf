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
The motor board: two driven wheels on a serial port, as a differential drive.

A ``geometry_msgs/msg/Twist`` becomes the speeds of two wheels; the counts of their encoders become
``sensor_msgs/msg/JointState`` with angles that never wrap or jump. A driver encodes the commands
of its board and decodes its answers::

    class MyBoard(MotorBoard[Reply]):
        SETTINGS = motor_settings(baud=115200, rate_hz=50.0)

        def __init__(self, name, settings):
            super().__init__(name, settings, ReplyDecoder())

        def drive(self, left_rad_s, right_rad_s):   # of the board's own channels
            self.send(speeds(left_rad_s, right_rad_s))

        def halt(self): # immediately, in any state of the protocol
            self.send(STOP)

        def write(self, now_ns):                    # each poll
            self.send(ASK_FOR_COUNTS)

        def handle(self, frame, arrival_ns):
            return self.update_counts(frame.left, frame.right, arrival_ns)

A driver also declares how long its board continues when this computer stops sending, by
:attr:`MotorBoard.SILENCE_S` or :meth:`MotorBoard.silence_s`. The modules between commands and
wheels slow the robot accordingly.

It calls :meth:`MotorBoard.update_counts`, :meth:`MotorBoard.report_battery` and
:meth:`MotorBoard.report_faults` when it has data, :meth:`MotorBoard.line_failed` when bytes were
lost, and ``super()`` where it overrides ``restart``, ``idle`` or ``statistics``. This class
handles swapped and inverted wheels, limits, invalid commands, jumps of the counters, wheels that
do not follow their command, and the latch that follows.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.actuator import Actuator
from rt_robot_os.devices.battery import BatteryFiller
from rt_robot_os.devices.battery import UNKNOWN
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.devices.motor_faults import MotorFaults
from rt_robot_os.devices.motor_settings import motor_settings
from rt_robot_os.devices.serial.device import FrameT
from rt_robot_os.devices.serial.device import SerialDecoder
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.motion.wheel_counters import CounterReading
from rt_robot_os.motion.wheel_counters import WheelCounters
from rt_robot_os.motion.wheel_watch import WheelState
from rt_robot_os.motion.wheel_watch import WheelWatch
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

__all__ = ['motor_settings', 'MotorBoard']

# A command beyond this, in m/s or rad/s, is an error.
_BEYOND_REASON: Final = 1000.0
# Factor for speeds that are not commanded: downhill, or pushed by hand.
_MARGIN: Final = 1.5
_PUSHED_M_S: Final = 2.0
# Counts are missing after this time and this number of periods; after a shorter pause already the
# board may have been reset.
_MISSING_S: Final = 0.4
_SILENCE_S: Final = 0.25
_LATE_PERIODS: Final = 3.0
_FAULTS_EVERY_NS: Final = NS_PER_S
_SIDES: Final = ('left', 'right')
_STILL: Final = (0.0, 0.0)


class MotorBoard(Actuator, SerialDevice[FrameT]):
    """
    A board that drives two wheels.

    :cvar COUNTER_BITS: width of its counters, which wrap; 0 for numbers that do not wrap.
    :cvar COUNTS_SURVIVE: opening the port resets neither the board nor its counters, so counts
        made meanwhile are accepted, up to those of one second.
    :cvar SILENCE_S: longest time from the last command until the board stops by itself; 2 s where
        a driver does not declare it.
    :cvar IF_SLOW: how to shorten that time; shown by ``doctor``.
    :ivar counters: the angles of the wheels.
    :ivar faults: the current faults.
    """

    COUNTER_BITS: ClassVar[int] = 32
    COUNTS_SURVIVE: ClassVar[bool] = False
    SILENCE_S: ClassVar[float] = 2.0
    IF_SLOW: ClassVar[str] = 'lower maximum_wheel_speed_m_s'

    command = Input('cmd_vel_safe', wake=True, message='geometry_msgs/msg/Twist')
    joint_states = Output('joint_states', 'sensor_msgs/msg/JointState',
                          {'position': 2, 'velocity': 2})
    battery = Output('battery', 'sensor_msgs/msg/BatteryState', rate_hz=1.0)
    motor_faults = Output('motor_faults', 'std_msgs/msg/UInt32', rate_hz=1.0)

    def __init__(self, name: str, settings: Mapping[str, Any],
                 decoder: SerialDecoder[FrameT]) -> None:
        """
        Store settings and decoder; nothing is opened.

        :raises ConfigError: the port is neither a path nor an address.
        """
        super().__init__(name, settings, decoder)
        self._radius_m: float = settings['wheel_radius_m']
        self._separation_m: float = settings['wheel_separation_m']
        self._signs = (-1.0 if settings['inverted_left'] else 1.0,
                       -1.0 if settings['inverted_right'] else 1.0)
        self._swapped: bool = settings['swapped']
        unit_rad = math.tau / self.counts_per_revolution()
        late_s = _LATE_PERIODS / settings['output_rate_hz']
        self._missing_ns = round(max(_MISSING_S, late_s) * NS_PER_S)
        self.counters = WheelCounters(
            self._signs[0] * unit_rad, self._signs[1] * unit_rad, bits=self.COUNTER_BITS,
            fastest_rad_s=max(_MARGIN * settings['maximum_wheel_speed_m_s'], _PUSHED_M_S)
            / self._radius_m,
            most=settings['maximum_jump'], silence_s=max(_SILENCE_S, late_s))
        self._watches = tuple(WheelWatch(
            patience_s=settings['standstill_s'],
            slowest_rad_s=self.slowest_watched_rad_s(),
            noise_rad=self.noise_counts() * unit_rad) for _ in _SIDES)
        self._battery = BatteryFiller(settings)
        self.faults = MotorFaults()
        self._wheels_rad_s: tuple[float, float] = _STILL
        self._driven_ns = 0
        self._told_bits = -1
        self._told_ns = 0
        self._wrong_commands = self._limited_commands = self._refused_commands = 0
        self._standstills = self._wrong_ways = self._lost_replies = 0

    # --- to be defined by a driver
    # --------------------------------------------------------------------

    @abstractmethod
    def drive(self, left_rad_s: float, right_rad_s: float) -> None:
        """
        Send the speeds of the wheels to the board, without blocking.

        Called with each command and with each poll while it is active.

        :param left_rad_s: of the board's left channel, positive where it counts up; swapped and
            inverted wheels are already handled.
        :raises DeviceError: the device is gone.
        """

    @abstractmethod
    def halt(self) -> None:
        """
        Send the command to stop, without blocking, in any state of the protocol.

        :raises DeviceError: the device is gone.
        """

    @classmethod
    def silence_s(cls, settings: Mapping[str, Any]) -> float:
        """Return the longest time from the last command until the board stops by itself."""
        return cls.SILENCE_S

    @classmethod
    def run_on(cls, settings: Mapping[str, Any]) -> RunOn:
        """Return how far the robot continues when this computer stops sending."""
        if 'coast_s' not in settings:
            return RunOn()  # so that recordings from before this declaration replay unchanged
        return RunOn(cls.silence_s(settings), float(settings['coast_s']))

    def accepts_commands(self, now_ns: int) -> bool:
        """
        Get the board ready to drive, without blocking, and return whether it is.

        Called before :meth:`drive`, unless the command is to stop; when False the command waits
        for the next poll.

        :raises DeviceError: the device is gone.
        """
        return True

    def counts_per_revolution(self) -> float:
        """Return the counts of :meth:`update_counts` for one turn of a wheel."""
        return float(self.settings['ticks_per_revolution'])

    def noise_counts(self) -> float:
        """Return the noise of an encoder at standstill, in the same counts."""
        return 2.5

    def slowest_watched_rad_s(self) -> float:
        """Return the slowest command at which a wheel must turn."""
        return float(self.settings['standstill_from_m_s']) / self._radius_m

    # --- what it reports -------------------------------------------------------------------------

    def update_counts(self, left: float, right: float, arrival_ns: int) -> int:
        """
        Publish the counts of the encoders.

        :param left: of the board's left channel; ticks, or another unit that matches
            :meth:`counts_per_revolution`.
        :return: number of samples published.
        :raises DeviceError: a wheel does not follow its command, and the board could not be
            stopped.
        """
        if self._swapped:
            left, right = right, left
        counters = self.counters
        reading = counters.update(left, right, arrival_ns)
        if reading is CounterReading.REJECTED:
            return 0
        if reading is CounterReading.REBASED:
            self.faults.flag_briefly(MotorFault.COUNTS_NEW, arrival_ns)
            self.log.warn('its counters restarted (reset, or another board): brought to rest',
                          throttle_s=1.0)
            self.rest()
        self.faults.set_active(MotorFault.COUNTS_MISSING, False)
        self._watch(arrival_ns)
        message = self.joint_states.msg
        message.position[:] = counters.position_rad
        message.velocity[:] = counters.velocity_rad_s
        self.joint_states.publish(arrival_ns)
        return 1

    def report_battery(self, voltage_v: float, arrival_ns: int, current_a: float = math.nan,
                       status: int = UNKNOWN) -> int:
        """
        Publish the state of the battery.

        :param current_a: negative when it is discharged.
        :param status: ``power_supply_status`` of the message.
        :return: number of samples published.
        """
        self._battery.fill(self.battery.msg, voltage_v, current_a, status)
        self.battery.publish(arrival_ns)
        self.faults.set_active(MotorFault.BATTERY_LOW, self._battery.is_low(voltage_v))
        return 1

    def report_faults(self, bits: int) -> None:
        """
        Set the fault bits of the board; they are published from bit 16 on.

        :param bits: at most 16 bits, 0 = none; their meaning is on the page of the board.
        """
        self.faults.set_board_bits(bits)

    def line_failed(self, now_ns: int) -> None:
        """Count an answer that was lost or wrong; the fault is published for a second."""
        self._lost_replies += 1
        self.faults.flag_briefly(MotorFault.LINE, now_ns)

    def stop_for(self, fault: MotorFault, text: str) -> None:
        """
        Stop, until a command to stop, or no command, acknowledges the fault.

        :param fault: its bits; 0 if those of the board already report it.
        :param text: what is wrong, and the remedy.
        :raises DeviceError: the device is gone.
        """
        self.log.error('%s; brought to rest', text, throttle_s=1.0)
        super().rest()
        self.faults.latch(fault, text)

    # --- commands --------------------------------------------------------------------------------

    def actuate(self, now_ns: int) -> None:
        """Execute the active command, within the limits; one that is not finite is refused."""
        twist = self.command.msg
        linear_m_s, angular_rad_s = twist.linear.x, twist.angular.z
        if not (abs(linear_m_s) <= _BEYOND_REASON and abs(angular_rad_s) <= _BEYOND_REASON):
            self._wrong_commands += 1
            self.faults.flag_briefly(MotorFault.COMMAND_REFUSED, now_ns)
            self.log.warn('a command of %s m/s and %s rad/s is refused: brought to rest',
                          linear_m_s, angular_rad_s, throttle_s=1.0)
            super().rest()  # it does not acknowledge the fault that holds the robot
            return
        if not self.is_set_up() or self.faults.is_active(MotorFault.COUNTS_MISSING):
            self._refused_commands += 1
            return
        left, right = self._limited(*wheel_speeds(linear_m_s, angular_rad_s, self._separation_m))
        if left or right:
            if self.faults.is_latched:
                self._refused_commands += 1
                return
            if not self.accepts_commands(now_ns):
                return
        else:
            self.faults.release()
        if not self.is_driving:
            self._driven_ns = now_ns
        self._wheels_rad_s = left, right
        left, right = left * self._signs[0], right * self._signs[1]
        if self._swapped:
            left, right = right, left
        self.drive(left, right)

    @property
    def is_driving(self) -> bool:
        """Return whether a wheel is commanded to turn."""
        return self._wheels_rad_s != _STILL

    def is_moving(self) -> bool:
        """Return whether the active command moves the robot."""
        return self.is_driving

    def _limited(self, left_m_s: float, right_m_s: float) -> tuple[float, float]:
        """Return the speeds of the wheels in rad/s, both scaled down to the limit."""
        limit_m_s: float = self.settings['maximum_wheel_speed_m_s']
        fastest_m_s = max(abs(left_m_s), abs(right_m_s))
        scale = 1.0 / self._radius_m
        if fastest_m_s > limit_m_s:
            self._limited_commands += 1
            scale *= limit_m_s / fastest_m_s
        return left_m_s * scale, right_m_s * scale

    def safe_state(self) -> None:
        """Stop the wheels."""
        self._wheels_rad_s = _STILL
        self.halt()

    def rest(self) -> None:
        """Stop the wheels and release the latch; only a new command moves them again."""
        self.faults.release()
        super().rest()

    def restart(self) -> None:
        """Reset the state: the port was just opened."""
        self._wheels_rad_s = _STILL
        self.faults.clear()
        if self.COUNTS_SURVIVE:
            self.counters.expect_reset()
        else:
            self.counters.restart()

    # --- supervision -----------------------------------------------------------------------------

    def idle(self, now_ns: int) -> int:
        """Check for missing counts, and publish the faults."""
        if self.is_driving:
            since_ns = max(self._driven_ns, self.counters.stamp_ns)
            if now_ns - since_ns > self._missing_ns:
                self.faults.set_active(MotorFault.COUNTS_MISSING, True)
                self.log.error('no counts of its encoders arrive although it is commanded to '
                               'drive: check the line to the board; brought to rest',
                               throttle_s=1.0)
                super().rest()
        bits = self.faults.bits(now_ns)
        if bits != self._told_bits or now_ns - self._told_ns >= _FAULTS_EVERY_NS:
            self._told_bits, self._told_ns = bits, now_ns
            self.motor_faults.msg.data = bits
            self.motor_faults.publish(now_ns)
        return 0

    def _watch(self, now_ns: int) -> None:
        for side, watch, command_rad_s, position_rad in zip(
                (0, 1), self._watches, self._wheels_rad_s, self.counters.position_rad):
            state = watch.update(command_rad_s, position_rad, now_ns)
            if state is WheelState.STANDSTILL:
                self._standstills += 1
                self.stop_for(MotorFault(MotorFault.LEFT_STANDSTILL << side), (
                    f'the {_SIDES[side]} wheel stands still although it is commanded to turn: '
                    "check its encoder's wires, its motor and what may block it"))
            elif state is WheelState.WRONG_WAY:
                self._wrong_ways += 1
                self.stop_for(MotorFault(MotorFault.LEFT_WRONG_WAY << side), (
                    f'the {_SIDES[side]} wheel turns against its command: swap the wires of its '
                    'motor, or the two channels of its encoder'))

    # --- declarations ----------------------------------------------------------------------------

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications, with the configured frames and joints."""
        header = {'header.frame_id': self.settings['frame_id']}
        joints = {'name': [self.settings['left_joint'], self.settings['right_joint']]}
        fixed = {'joint_states': {**header, **joints}, 'battery': header}
        return tuple(
            replace(spec, fixed={**spec.fixed, **fixed.get(attribute, {})})
            for attribute, spec in zip(self.used(Output), super().publications()))

    def statistics(self) -> DeviceStatistics:
        """Return the current counters; contradictions are rejected readings."""
        return self._counters(contradicted=self.counters.rejected, more=self.motor_counters())

    def motor_counters(self) -> dict[str, Value]:
        """Return the values for ``/diagnostics``; ``warning`` is the latched fault."""
        left_rad, right_rad = self.counters.position_rad
        return {
            'warning': self.faults.text, 'motor_faults': max(self._told_bits, 0),
            'left_rad': left_rad, 'right_rad': right_rad, 'counter_resets': self.counters.resets,
            'standstills': self._standstills, 'wrong_ways': self._wrong_ways,
            'lost_replies': self._lost_replies, 'wrong_commands': self._wrong_commands,
            'limited_commands': self._limited_commands,
            'refused_commands': self._refused_commands}

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
RoboClaw motor controllers with two encoders, in packet serial mode, on USB or a serial line.

A ``geometry_msgs/msg/Twist`` becomes the speeds of both motors; the counters of the encoders
become ``sensor_msgs/msg/JointState``, voltage and currents ``sensor_msgs/msg/BatteryState``, the
status bits of the unit become bits of ``motor_faults``. At opening the version of the unit is read
and its own watchdog is set, so that it stops by itself when this computer stops sending. Its
velocity control keeps the gains tuned with the maker's program unless the settings have others.

In each turn, at ``output_rate_hz``, the driver sends the speeds (or a stop, without an active
command), requests the counters, and requests one further value in rotation. One request is in
flight at a time; one without a valid answer is repeated and counted, and a stop is never delayed.

The counters are set far from zero. A unit that lost its power counts from zero again, and is
detected by that immediately: it is set up again, without wrong odometry.
"""

from __future__ import annotations

from collections.abc import Mapping
import functools
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.devices.battery import DISCHARGING
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.motor_board import MotorBoard
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.devices.motor_settings import motor_settings
from rt_robot_os.devices.roboclaw import wire
from rt_robot_os.devices.roboclaw.exchange import Make
from rt_robot_os.devices.roboclaw.exchange import RequestQueue
from rt_robot_os.devices.roboclaw.wire import RoboClawDecoder
from rt_robot_os.devices.roboclaw.wire import RoboClawReply
from rt_robot_os.devices.roboclaw.wire import RoboClawRequest
from rt_robot_os.motion.differential import tick_difference

# Requested in rotation, one per turn.
_IN_TURN: Final = (wire.STATUS, wire.MAIN_BATTERY, wire.STATUS, wire.CURRENTS, wire.STATUS,
                   wire.TEMPERATURE, wire.STATUS, wire.READ_TIMEOUT)
# How often a request of the set-up, which is itself repeated, may fail.
_ATTEMPTS: Final = 3
_NAMES: Final = {
    wire.VERSION: 'firmware version', wire.SET_TIMEOUT: 'set serial timeout',
    wire.READ_TIMEOUT: 'read serial timeout', wire.SET_PID_1: 'set velocity PID of M1',
    wire.SET_PID_2: 'set velocity PID of M2', wire.ENCODERS: 'read encoders',
    wire.SET_ENCODER_1: 'set encoder 1', wire.SET_ENCODER_2: 'set encoder 2'}
# The voltage is read more often than it is published.
_BATTERY_NS: Final = round(0.9 * NS_PER_S)
# Initial value of the counters; a unit whose counters are far from it has lost its power.
_BEGINNING: Final = 1 << 30
_FAR: Final = 1 << 29
# Bits of the status: errors, which are published unmodified, and warnings, which have two bits.
_ERRORS: Final = 0x3FFF
_OVERCURRENTS: Final = 0x3_0000
_WARNINGS: Final = 0x3FC_0000
_OVERCURRENT: Final = 0x4000
_WARNING: Final = 0x8000


class RoboClaw(MotorBoard[RoboClawReply]):
    """A RoboClaw that drives two wheels: the left one is motor M1, unless they are swapped."""

    IF_SLOW = 'lower watchdog_s or maximum_wheel_speed_m_s'
    SETTINGS = motor_settings(baud=38400, rate_hz=30.0, coast_s=0.2) + (
        Field('address', int, wire.FIRST_ADDRESS, 'Address of the unit in packet serial mode, 128 '
              '(0x80) to 135.', '', wire.FIRST_ADDRESS, wire.LAST_ADDRESS),
        Field('identity', str, '',
              'Part of its version string, such as 2x15a; any other unit is refused. Empty: all '
              'are accepted.'),
        Field('watchdog_s', float, 0.3,
              'The unit stops by itself when it receives nothing for this '
              'time; in steps of 0.1 s.',
              's', 0.1, 25.5),
        Field('acceleration_m_s2', float, 0.0,
              'Limit of the acceleration of a wheel in the unit, except for stops; 0: none.',
              'm/s^2', 0.0, 100.0),
        Field('answer_timeout_s', float, 0.03,
              'An answer that is not complete after this time is lost; a network or 9600 baud '
              'needs more.', 's', 0.005, 1.0),
        Field('velocity_p', float, 0.0,
              'Gain P of the velocity control of both motors; with 0 all gains remain as stored '
              'in the unit.', '', 0.0, 65535.0),
        Field('velocity_i', float, 0.0, 'Gain I, if velocity_p is set.', '', 0.0, 65535.0),
        Field('velocity_d', float, 0.0, 'Gain D, if velocity_p is set.', '', 0.0, 65535.0),
        Field('velocity_qpps', int, 0,
              'Pulses per second of a motor at full duty, if velocity_p is set.',
              'pulses/s', 0, wire.MAX_SPEED),
    )
    description = 'RoboClaw motor controller, packet serial'
    ANSWERS = True
    COUNTER_BITS = 32
    COUNTS_SURVIVE = True
    IF_SILENT = ('check its power and its wiring, that it is in packet serial mode with this '
                 'address, and the baud rate')
    IF_GARBAGE = ('check the baud rate and the address, and that the connected device is the '
                  'configured one')

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: there are gains, but no speed at full duty.
        """
        decoder = RoboClawDecoder()
        super().__init__(name, settings, decoder)
        if settings['velocity_p'] and not settings['velocity_qpps']:
            raise ConfigError([f'{name}: velocity_p is {settings["velocity_p"]:g} and '
                               'velocity_qpps 0: measure the speed at full duty and set it'])
        self._address: int = settings['address']
        self._exchange = RequestQueue(decoder, round(settings['answer_timeout_s'] * NS_PER_S))
        self._pulses_rad = settings['ticks_per_revolution'] / math.tau
        # 0 would mean no limit.
        self._acceleration = math.ceil(
            settings['acceleration_m_s2'] / settings['wheel_radius_m'] * self._pulses_rad)
        self._watchdog = wire.serial_timeout(self._address, settings['watchdog_s'])
        self._gains = _gains(self._address, settings)
        self._stop = self._orders = wire.duty(self._address, 0, 0)
        self._moves = False
        self._setup: list[RoboClawRequest] = []
        self._problem = ''
        self._asked: dict[int, Make] = {
            command: functools.partial(wire.ask, self._address, command)
            for command in (wire.ENCODERS, *_IN_TURN)}
        self._uses = {
            wire.ENCODERS: self._use_counts, wire.STATUS: self._use_status,
            wire.MAIN_BATTERY: self._use_battery, wire.CURRENTS: self._use_currents,
            wire.TEMPERATURE: self._use_temperature, wire.READ_TIMEOUT: self._use_timeout}
        self._period_ns = period_from_rate(settings['output_rate_hz'])
        self._now_ns = self._due_ns = self._battery_ns = 0
        self._turn = self._failures = self._set_ups = self._late_turns = 0
        self._attempts = self._frames_before = 0
        self._version = ''
        self._status = 0
        self._voltage_v = 0.0
        self._currents_a = (0.0, 0.0)
        self._temperature_c = 0.0

    # --- commands --------------------------------------------------------------------------------

    def actuate(self, now_ns: int) -> None:
        """Execute the active command, within the limits."""
        self._now_ns = now_ns
        super().actuate(now_ns)

    def drive(self, left_rad_s: float, right_rad_s: float) -> None:
        """Send the speeds of M1 and M2; a command to stop is sent before everything else."""
        moved, before = self._moves, self._orders
        speeds = round(left_rad_s * self._pulses_rad), round(right_rad_s * self._pulses_rad)
        self._moves = speeds != (0, 0)
        self._orders = wire.speeds(
            self._address, *speeds, self._acceleration if self._moves else 0)
        if moved and not self._moves:
            self._interrupt()
        elif self._orders != before:  # it is repeated in each turn
            self._exchange.put_first(self._current_orders)
            self._send_what_is_due()

    def halt(self) -> None:
        """Switch off both motors: then no velocity control can wind up."""
        self._moves = False
        self._orders = self._stop
        self._interrupt()

    def _interrupt(self) -> None:
        self.send(self._exchange.interrupt(self._current_orders))

    def _current_orders(self) -> RoboClawRequest:
        return self._orders

    # --- requests --------------------------------------------------------------------------------

    def restart(self) -> None:
        """Set the unit up: the port has just been opened."""
        super().restart()
        self._exchange.clear()
        self._moves = False
        self._orders = self._stop
        self._due_ns = 0
        self._problem = ''
        self._frames_before = self._decoder.frames
        self._set_up()

    def _set_up(self) -> None:
        """Start the set-up; everything except commands to stop waits for it."""
        ask = functools.partial(wire.ask, self._address)
        self._set_ups += 1
        self._attempts = 0
        self._setup = [ask(wire.VERSION), self._watchdog, ask(wire.READ_TIMEOUT), *self._gains,
                       ask(wire.ENCODERS)]

    @classmethod
    def silence_s(cls, settings: Mapping[str, Any]) -> float:
        """Return the time of the unit's own watchdog, which is set at each start."""
        return wire.timeout_tenths(settings['watchdog_s']) / 10.0

    def is_set_up(self) -> bool:
        """Return whether the version of the unit is known, and its watchdog is set."""
        return not self._setup

    def write(self, now_ns: int) -> None:
        """
        Start the turn that is due, or continue the set-up.

        :raises DeviceError: the port is gone, or the unit does not match the settings.
        """
        if self._problem:
            raise DeviceError(f'{self.name}: {self._problem}')
        self._now_ns = now_ns
        is_idle = self._exchange.is_idle
        if self._setup:
            if is_idle:
                self._try_set_up()
        elif now_ns >= self._due_ns - self._period_ns // 4:
            if is_idle:
                self._begin_turn(now_ns)
            elif now_ns >= self._due_ns + self._period_ns:
                self._late_turns += 1
                self._due_ns += self._period_ns
        self._send_what_is_due()

    def _try_set_up(self) -> None:
        """
        Send the next request of the set-up, again if it has failed.

        :raises DeviceError: it never answers that request, although it answers others.
        """
        self._attempts += 1
        if self._attempts > _ATTEMPTS and self._decoder.frames > self._frames_before:
            command = self._setup[0].command
            raise DeviceError(f'{self.name}: it answers, but not to command {command} '
                              f'({_NAMES[command]}): update its firmware')
        self._exchange.add(self._next_of_setup)

    def _begin_turn(self, now_ns: int) -> None:
        late = now_ns - self._due_ns >= self._period_ns
        self._due_ns = (now_ns if late else self._due_ns) + self._period_ns
        more = _IN_TURN[self._turn]
        self._turn = (self._turn + 1) % len(_IN_TURN)
        exchange, asked = self._exchange, self._asked
        exchange.add(self._current_orders)
        exchange.add(asked[wire.ENCODERS])
        exchange.add(asked[more])

    def _next_of_setup(self) -> RoboClawRequest:
        return self._setup[0] if self._setup else self._orders

    def idle(self, now_ns: int) -> int:
        """Send the requests that waited for an answer, and handle missing answers."""
        self._now_ns = now_ns
        self._send_what_is_due()
        exchange = self._exchange
        failures = exchange.retries + exchange.given_up
        if failures != self._failures:
            self._failures = failures
            self.line_failed(now_ns)
        return super().idle(now_ns)

    def _send_what_is_due(self) -> None:
        data = self._exchange.due(self._now_ns)
        if data:
            self.send(data)

    # --- answers ---------------------------------------------------------------------------------

    def handle(self, frame: RoboClawReply, arrival_ns: int) -> int:
        """Handle one answer; in the loop."""
        self._exchange.answered()
        if self._setup:
            self._go_on_with_set_up(frame, arrival_ns)
            return 0
        use = self._uses.get(frame.request.command)
        return use(frame.data, arrival_ns) if use is not None else 0

    def _go_on_with_set_up(self, reply: RoboClawReply, arrival_ns: int) -> None:
        if reply.request != self._setup[0]:
            return
        command, data = reply.request.command, reply.data
        if command == wire.VERSION:
            self._identify(wire.version_text(data))
        elif command == wire.READ_TIMEOUT and data != self._watchdog.data[2:3]:
            self._problem = (f'its watchdog is {wire.unsigned(data) / 10:g} s although '
                             f'{self.settings["watchdog_s"]:g} s was set: it may be locked, see '
                             "the maker's program")
        elif command == wire.ENCODERS and self._lost_power(data):
            self.counters.restart()
            self._setup += [wire.encoder(self._address, each, _BEGINNING)
                            for each in (wire.SET_ENCODER_1, wire.SET_ENCODER_2)]
        self._setup.pop(0)
        self._attempts = 0
        if self._setup:
            self._try_set_up()

    def _identify(self, version: str) -> None:
        wanted: str = self.settings['identity']
        if wanted.lower() not in version.lower():
            self._problem = (f'it is a {version}, and identity is {wanted!r}: swap the ports, or '
                             'set another identity')
        if self._version and version != self._version:
            self.log.warn('another unit: it was a %s, it is a %s', self._version, version)
            self.counters.restart()
        self._version = version

    @staticmethod
    def _lost_power(data: bytes) -> bool:
        return any(abs(tick_difference(count, _BEGINNING, 32)) > _FAR
                   for count in wire.encoder_counts(data))

    def _use_counts(self, data: bytes, arrival_ns: int) -> int:
        if self._lost_power(data):
            self.counters.resets += 1
            self.counters.restart()
            self.faults.flag_briefly(MotorFault.COUNTS_NEW, arrival_ns)
            self.log.warn('it has lost its power: brought to rest and set up again',
                          throttle_s=1.0)
            self.rest()
            self._watch(arrival_ns)  # the motion meanwhile says nothing about the wheels
            self._set_up()
            return 0
        return self.update_counts(*wire.encoder_counts(data), arrival_ns)

    def _use_timeout(self, data: bytes, arrival_ns: int) -> int:
        if data != self._watchdog.data[2:3]:
            self.log.warn('its watchdog has changed by itself: brought to rest and set up again',
                          throttle_s=1.0)
            self.rest()
            self._set_up()
        return 0

    def _use_status(self, data: bytes, arrival_ns: int) -> int:
        bits = wire.status_bits(data)
        if bits != self._status:
            self._status = bits
            text = wire.status_text(bits)
            if text:
                self.log.warn('it reports %s', text, throttle_s=1.0)
        self.report_faults(bits & _ERRORS | (_OVERCURRENT if bits & _OVERCURRENTS else 0)
                           | (_WARNING if bits & _WARNINGS else 0))
        return 0

    def _use_battery(self, data: bytes, arrival_ns: int) -> int:
        self._voltage_v = wire.unsigned(data) * wire.BATTERY_V
        if arrival_ns - self._battery_ns < _BATTERY_NS:
            return 0
        self._battery_ns = arrival_ns
        return self.report_battery(self._voltage_v, arrival_ns, status=DISCHARGING)

    def _use_currents(self, data: bytes, arrival_ns: int) -> int:
        self._currents_a = wire.currents_a(data)
        return 0

    def _use_temperature(self, data: bytes, arrival_ns: int) -> int:
        self._temperature_c = wire.unsigned(data) * wire.TEMPERATURE_C
        return 0

    def motor_counters(self) -> dict[str, Value]:
        """Return the values for ``/diagnostics``."""
        counters, exchange = super().motor_counters(), self._exchange
        status = wire.status_text(self._status)
        return {
            **counters, 'warning': counters['warning'] or status and f'it reports {status}',
            'version': self._version, 'status': f'{self._status:#x}',
            'voltage_v': self._voltage_v, 'current_m1_a': self._currents_a[0],
            'current_m2_a': self._currents_a[1], 'temperature_c': self._temperature_c,
            'timeouts': exchange.timeouts, 'retries': exchange.retries,
            'given_up': exchange.given_up, 'late_turns': self._late_turns,
            'set_ups': self._set_ups}


def _gains(address: int, settings: Mapping[str, Any]) -> tuple[RoboClawRequest, ...]:
    """Return the commands of the velocity control; none if it is not changed."""
    if not settings['velocity_p']:
        return ()
    return tuple(wire.gains(
        address, command, settings['velocity_p'], settings['velocity_i'],
        settings['velocity_d'], settings['velocity_qpps'])
        for command in (wire.SET_PID_1, wire.SET_PID_2))

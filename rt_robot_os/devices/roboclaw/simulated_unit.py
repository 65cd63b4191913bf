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
The state and protocol of a simulated RoboClaw: parsing, memory, loss of power.

It receives time and wheel motion from outside, so that it is the same on a line and in a world.
"""

from __future__ import annotations

import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.roboclaw import wire

# Size of the data of each command that sets a value.
_ARGUMENTS: Final = {
    wire.SET_TIMEOUT: 1, wire.SET_ENCODER_1: 4, wire.SET_ENCODER_2: 4, wire.SET_PID_1: 16,
    wire.SET_PID_2: 16, wire.DUTY: 4, wire.SPEED: 8, wire.SPEED_ACCEL: 12}
_ASKED: Final = (wire.READ_TIMEOUT, wire.VERSION, wire.MAIN_BATTERY, wire.CURRENTS, wire.ENCODERS,
                 wire.TEMPERATURE, wire.STATUS)
_GAP_NS: Final = round(wire.GAP_S * 1e9)
_TENTH_NS: Final = 100_000_000


class MotorOutput(NamedTuple):
    """
    The commanded outputs of the motors.

    :ivar closed: ``first`` and ``second`` are speeds in pulses per second; otherwise duty cycles.
    :ivar acceleration: in pulses per second squared; 0 = no limit.
    """

    closed: bool = False
    first: int = 0
    second: int = 0
    acceleration: int = 0

    @property
    def moves(self) -> bool:
        """Return whether a motor is commanded to turn."""
        return bool(self.first or self.second)


class SimulatedUnit:
    """
    One unit.

    :ivar drive: the last command, or the stop of its watchdog.
    :ivar timeout_tenths: of its watchdog, in 0.1 s; 0 = none.
    :ivar offsets: values of the counters at zero angle of the wheels.
    :ivar gains: data of the last command of each velocity control, by command.
    :ivar dropped: invalid requests.
    """

    def __init__(self, address: int, version: str, old_status: bool) -> None:
        self.address = address
        self.dropped = 0
        self.battery_v = 12.1
        self.status = 0
        self.currents_a = (0.0, 0.0)
        self.temperature_c = 30.0
        self.counts = (0, 0)
        self.version = version.encode('ascii', 'replace')[:46] + b'\n\x00'
        self._old_status = old_status
        self.power_on()

    def power_on(self) -> None:
        """Reset all settings."""
        self.drive = MotorOutput()
        self.timeout_tenths = 0
        self.offsets = [0, 0]
        self.gains: dict[int, bytes] = {}
        self._held = b''
        self._heard_ns = 0
        self._told_ns = 0

    def watch(self, now_ns: int) -> None:
        """Stop when nothing has arrived for longer than the watchdog allows."""
        limit_ns = self.timeout_tenths * _TENTH_NS
        if limit_ns and now_ns - self._told_ns > limit_ns:
            self.drive = MotorOutput()

    def handle_command(self, data: bytes, now_ns: int) -> bytes:
        """
        Receive bytes, and return the answers.

        :param data: bytes that arrived together; a partial request is kept for 10 ms.
        """
        if now_ns - self._heard_ns > _GAP_NS:
            self._held = b''
        self._heard_ns = now_ns
        buffer = self._held + data
        answers = b''
        while buffer:
            size = self._size(buffer)
            if size > len(buffer) or size == 0:
                break
            if size > 0:
                answers += self._execute(buffer[:size], now_ns)
            buffer = buffer[max(size, 1):]
        self._held = buffer
        return answers

    def _size(self, buffer: bytes) -> int:
        """Return the size of the request; 0 if incomplete, -1 if invalid."""
        if buffer[0] != self.address:
            return -1
        if len(buffer) < 2:
            return 0
        command = buffer[1]
        if command in _ASKED:
            return 2
        arguments = _ARGUMENTS.get(command)
        return -1 if arguments is None else arguments + 4

    def _execute(self, request: bytes, now_ns: int) -> bytes:
        command, data = request[1], request[2:-2]
        if command in _ASKED:
            self._told_ns = now_ns
            return wire.answer(self.address, command, self._asked(command))
        if wire.crc(request):
            self.dropped += 1
            return b''
        self._told_ns = now_ns
        if command == wire.SET_TIMEOUT:
            self.timeout_tenths = data[0]
        elif command in (wire.SET_ENCODER_1, wire.SET_ENCODER_2):
            place = command - wire.SET_ENCODER_1
            self.offsets[place] += int.from_bytes(data, 'big') - self._counters()[place]
        elif command in (wire.SET_PID_1, wire.SET_PID_2):
            self.gains[command] = data
        elif command == wire.DUTY:
            self.drive = MotorOutput(False, *struct.unpack('>hh', data))
        elif command == wire.SPEED:
            self.drive = MotorOutput(True, *struct.unpack('>ii', data))
        else:
            acceleration, first, second = struct.unpack('>Iii', data)
            self.drive = MotorOutput(True, first, second, acceleration)
        return wire.ACKNOWLEDGED

    def _counters(self) -> list[int]:
        return [(count + offset) & 0xFFFFFFFF
                for count, offset in zip(self.counts, self.offsets)]

    def _asked(self, command: int) -> bytes:
        if command == wire.READ_TIMEOUT:
            return bytes((self.timeout_tenths,))
        if command == wire.VERSION:
            return self.version
        if command == wire.MAIN_BATTERY:
            return round(self.battery_v / wire.BATTERY_V).to_bytes(2, 'big')
        if command == wire.CURRENTS:
            return struct.pack('>hh', *(round(a / wire.CURRENT_A) for a in self.currents_a))
        if command == wire.ENCODERS:
            return struct.pack('>II', *self._counters())
        if command == wire.TEMPERATURE:
            return round(self.temperature_c / wire.TEMPERATURE_C).to_bytes(2, 'big')
        return wire.old_status(self.status) if self._old_status else self.status.to_bytes(4, 'big')

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

"""A body that rolls and pitches, its inertial sensor, and the filter that finds its attitude."""

from __future__ import annotations

import math

GRAVITY = 9.81
_ROLL = (0.30, 2 * math.pi * 0.5, 0.0)      # amplitude in rad, angular frequency, phase
_PITCH = (0.20, 2 * math.pi * 0.3, 1.0)
_GYRO_NOISE, _ACCELERATION_NOISE = 0.01, 0.1
_TRUST = 0.005                              # of the accelerometer in each step

Sample = tuple[float, float, float, float, float, float]


def truth(t: float) -> tuple[float, float]:
    """Return roll and pitch in rad at a time in seconds."""
    return (_ROLL[0] * math.sin(_ROLL[1] * t + _ROLL[2]),
            _PITCH[0] * math.sin(_PITCH[1] * t + _PITCH[2]))


class ImuModel:
    """Give what an inertial sensor reads: rates in rad/s and acceleration in m/s^2, noisy."""

    def __init__(self) -> None:
        self._state = 1

    def _noise(self) -> float:
        self._state = (self._state * 1103515245 + 12345) & 0x7FFFFFFF
        return self._state / 0x3FFFFFFF - 1.0

    def read(self, t: float) -> Sample:
        """Read it at a time in seconds; safe in the real-time loop."""
        roll, pitch = truth(t)
        roll_rate = _ROLL[0] * _ROLL[1] * math.cos(_ROLL[1] * t + _ROLL[2])
        pitch_rate = _PITCH[0] * _PITCH[1] * math.cos(_PITCH[1] * t + _PITCH[2])
        noise = self._noise
        return (roll_rate + _GYRO_NOISE * noise(),
                pitch_rate * math.cos(roll) + _GYRO_NOISE * noise(),
                -pitch_rate * math.sin(roll) + _GYRO_NOISE * noise(),
                -GRAVITY * math.sin(pitch) + _ACCELERATION_NOISE * noise(),
                GRAVITY * math.cos(pitch) * math.sin(roll) + _ACCELERATION_NOISE * noise(),
                GRAVITY * math.cos(pitch) * math.cos(roll) + _ACCELERATION_NOISE * noise())


class Filter:
    """A complementary filter: rates integrated, pulled towards where gravity is."""

    def __init__(self) -> None:
        self.roll = self.pitch = self.time = 0.0
        self._begun = False

    def update(self, t: float, sample: Sample) -> None:
        """Take a sample of a time in seconds; safe in the real-time loop."""
        p, q, r, ax, ay, az = sample
        roll = math.atan2(ay, az)
        pitch = math.atan2(-ax, math.hypot(ay, az))
        if not self._begun:
            self._begun, self.roll, self.pitch, self.time = True, roll, pitch, t
            return
        dt, self.time = t - self.time, t
        sine, cosine = math.sin(self.roll), math.cos(self.roll)
        self.roll += dt * (p + math.tan(self.pitch) * (q * sine + r * cosine))
        self.pitch += dt * (q * cosine - r * sine)
        self.roll += _TRUST * (roll - self.roll)
        self.pitch += _TRUST * (pitch - self.pitch)

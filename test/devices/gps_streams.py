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

"""What the NMEA driver makes of sentences, for tests; numbers as in sensor_msgs."""

from __future__ import annotations

from typing import Any

from driver_fakes import FakePublisher
from driver_fakes import read_all
from driver_fakes import scripted
from rt_robot_os.devices.nmea.driver import NmeaGps

NO_FIX, FIX, SBAS, GBAS = -1, 0, 1, 2
UNKNOWN, APPROXIMATED, DIAGONAL_KNOWN = 0, 1, 2
GPS, GLONASS, COMPASS, GALILEO = 1, 2, 4, 8


def publish(*chunks: bytes, **changes: Any) -> tuple[FakePublisher, FakePublisher, Any]:
    with scripted(NmeaGps, list(chunks), **changes) as (device, (fixes, times)):
        read_all(device, len(chunks))
        return fixes, times, device.statistics()


def diagonal(fix: Any) -> list[float]:
    covariance: list[float] = fix.position_covariance.tolist()
    assert not any(covariance[i] for i in (1, 2, 3, 5, 6, 7))
    return [covariance[i] for i in (0, 4, 8)]

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
"""Does one job of a serial device handle only so many bytes, and is nothing lost by that."""

from __future__ import annotations

from typing import Any

from driver_fakes import scripted
from imu_streams import instant
from imu_streams import numbers
import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.serial import device as serial_device
from rt_robot_os.devices.serial.device import JOB_BYTES
from rt_robot_os.devices.witmotion.driver import WitMotion

MS = 1_000_000
BURST = b''.join(b''.join(instant(n)) for n in range(1, 401))


class Listener:
    """Keeps what the tap is told."""

    command = False

    def __init__(self) -> None:
        self.told: list[tuple[int, bytes]] = []

    def read(self, now_ns: int, data: bytes) -> None:
        self.told.append((now_ns, data))


def read_burst(jobs: int) -> tuple[list[list[int]], list[list[int]], list[int], Any, Listener]:
    """Give numbers, stamps, bytes decoded after each job, counters, and what a tap was told."""
    listener = Listener()
    with scripted(WitMotion, [BURST], baud=115200) as (device, (imu, mag)):
        device.tap = listener  # type: ignore[assignment]
        frames = []
        for job in range(jobs):
            device.read(1000 * MS + job * 10 * MS)
            frames.append(device.statistics().frames)
        return [numbers(imu)], [imu.stamps, mag.stamps], frames, device.statistics(), listener


def test_a_burst_is_decoded_over_several_jobs_with_the_stamps_of_its_arrival(
        monkeypatch: pytest.MonkeyPatch) -> None:
    values, stamps, frames, statistics, listener = read_burst(4)
    assert len(BURST) > 2 * JOB_BYTES
    assert frames == [n * JOB_BYTES // 11 for n in (1, 2)] + [2000] * 2
    assert statistics.deferred_bytes == len(BURST) - JOB_BYTES
    # A recording holds what the port gave; a replay cuts it in the same way.
    assert [(now, len(data)) for now, data in listener.told] == [
        (1000 * MS, len(BURST)), (1010 * MS, 0), (1020 * MS, 0), (1030 * MS, 0)]
    monkeypatch.setattr(serial_device, 'JOB_BYTES', 10**6)
    at_once = read_burst(1)
    assert (values, stamps) == at_once[:2]
    assert at_once[3].deferred_bytes == 0


def test_what_waits_when_the_port_is_closed_is_rejected() -> None:
    with scripted(WitMotion, [BURST]) as (device, _):
        device.read(1)
        assert device.waiting_bytes == len(BURST) - JOB_BYTES
        waiting = device.pending_bytes + device.waiting_bytes
        device.close()
        with pytest.raises(DeviceError, match='call open'):
            device.read(2)
        device.open()
        assert (device.pending_bytes, device.waiting_bytes) == (0, 0)
        assert device.statistics().rejected_bytes == waiting

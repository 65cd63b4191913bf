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

"""Do the faults of simulated devices look to the drivers like those of real ones."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from driver_fakes import wait_for_device_error
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.devices.nmea.simulated import SimulatedNmea
from rt_robot_os.devices.witmotion.driver import WitMotion
from rt_robot_os.devices.witmotion.simulated import SimulatedWitMotion
from rt_robot_os.sim.faults import FAULTS
from rt_robot_os.sim.pty_port import PtyPort
from sim_harness import MS
from sim_harness import rig
from sim_harness import START_NS

BOTH = [(SimulatedWitMotion, WitMotion, None), (SimulatedNmea, NmeaGps, 115200)]


def schedule(fault: str) -> dict[str, Any]:
    return {'faults': [f'{fault} at 1 for 1'], 'rate_hz': 20.0, 'corrupt_probability': 0.02}


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_silent(kind: Any, driver: Any, baud: int | None, tmp_path: Path) -> None:
    with rig(tmp_path, kind, driver, baud=baud, sim=schedule('silent')) as made:
        assert made.run(1000) >= 38
        assert made.run(990) <= 2
        assert made.run(1010) >= 38


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_garbage(kind: Any, driver: Any, baud: int | None, tmp_path: Path) -> None:
    with rig(tmp_path, kind, driver, baud=baud, sim=schedule('garbage')) as made:
        made.run(1000)
        assert made.device.statistics().rejected_bytes == 0
        assert made.run(990) <= 3
        assert made.device.statistics().rejected_bytes > 900
        assert made.run(1010) >= 36


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_corrupt(kind: Any, driver: Any, baud: int | None, tmp_path: Path) -> None:
    with rig(tmp_path, kind, driver, baud=baud, sim=schedule('corrupt')) as made:
        made.run(1000)
        assert made.device.statistics().rejected_frames == 0
        made.run(1000)
        damaged = made.device.statistics()
        assert damaged.rejected_frames > 5
        made.run(100)
        rejected = made.device.statistics().rejected_bytes
        assert made.run(900) >= 34
        assert made.device.statistics().rejected_bytes == rejected


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_short(kind: Any, driver: Any, baud: int | None, tmp_path: Path) -> None:
    with rig(tmp_path, kind, driver, baud=baud, sim=schedule('short')) as made:
        made.run(1000)
        before = made.simulated.port.bytes_sent
        pieces = []
        for _ in range(300):
            made.now_ns = made.simulated.next_event_ns()
            sent = made.simulated.port.bytes_sent
            made.simulated.pump(made.now_ns)
            pieces.append(made.simulated.port.bytes_sent - sent)
            made.sync()
        assert max(pieces) <= 3
        assert made.simulated.port.bytes_sent > before
        made.run(2000)
        assert made.device.statistics().rejected_bytes == 0
        assert made.device.statistics().lost_samples == 0


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_unplug(kind: Any, driver: Any, baud: int | None, tmp_path: Path) -> None:
    with rig(tmp_path, kind, driver, baud=baud, sim=schedule('unplug')) as made:
        assert made.run(999) >= 38
        made.now_ns = START_NS + 1000 * MS
        made.simulated.pump(made.now_ns)
        wait_for_device_error(made.device)
        with pytest.raises(DeviceError, match='does not exist'):
            made.reopen()
        made.now_ns = START_NS + 2000 * MS
        made.simulated.pump(made.now_ns)
        made.reopen()
        assert made.run(1000) >= 34


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_stuck(kind: Any, driver: Any, baud: int | None, tmp_path: Path) -> None:
    with rig(tmp_path, kind, driver, baud=baud, sim=schedule('stuck')) as made:
        made.run(2000)
        # The samples due at 0.95 s, and at 1.00 to 1.95 s, are one.
        values = made.publishers[0].values
        assert len(set(values[:19])) == 19
        assert len(set(values[19:39])) == 1
        made.run(1000)
        assert len(set(made.publishers[0].values[41:])) > 15


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_wrong(kind: Any, driver: Any, baud: int | None, tmp_path: Path) -> None:
    with rig(tmp_path, kind, driver, baud=baud, sim=schedule('wrong')) as made:
        made.run(1000)
        frames = made.device.statistics().frames
        assert made.run(980) <= 1
        statistics = made.device.statistics()
        assert statistics.frames - frames <= 5
        assert statistics.rejected_bytes > 200
        assert made.run(1020) >= 36


@pytest.mark.parametrize('fault', FAULTS)
def test_every_fault_may_be_asked_for_while_it_runs(fault: str, tmp_path: Path) -> None:
    port = PtyPort(tmp_path / 'x')
    device = SimulatedWitMotion('x', {}, port)
    device.pump(0)
    device.inject(fault, 0.5)
    descriptor = os.open(port.link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    for now in range(0, 1000, 5):
        device.pump(now * MS)
        assert port.plugged == (fault != 'unplug' or now >= 500)
    os.close(descriptor)
    device.close()
    with pytest.raises(ConfigError, match='no fault'):
        device.inject('lightning', 1.0)

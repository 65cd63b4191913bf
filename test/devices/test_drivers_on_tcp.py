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

"""Every serial driver with its simulated device on a network: the same samples as on a line."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from driver_fakes import settings_of
import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.core.simulator_program import main
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.simulators import SIMULATORS
from rt_robot_os.sim.tcp_port import TcpPlug
from rt_robot_os.testing import Rig

MS = 1_000_000
# Settings without a default, but the port.
GIVEN = {'wheel_radius_m': 0.05, 'wheel_separation_m': 0.3, 'ticks_per_revolution': 1440.0}
KINDS = [name for name in DRIVERS.names()
         if issubclass(DRIVERS.load(name), SerialDevice) and name in SIMULATORS.names()
         # Its nodes send when their network has formed: test_sink_forwarder.py has it on TCP.
         and name != 'sink']


@pytest.fixture(params=KINDS)
def on_tcp(request: pytest.FixtureRequest) -> Iterator[Rig]:
    """Give a driver and its simulated device, connected over TCP."""
    driver, simulator = DRIVERS.load(request.param), SIMULATORS.load(request.param)
    plug = TcpPlug(0)
    simulated: Any = simulator('sim', {}, plug)  # type: ignore[call-arg]
    plug.plug()
    given = {f.name: GIVEN[f.name] for f in driver.fields() if f.name in GIVEN}
    made = Rig(simulated, driver('dut', settings_of(driver, port=plug.url, **given)))
    yield made
    made.device.close()
    simulated.close()


def run(rig: Rig, milliseconds: int) -> int:
    def each(now_ns: int) -> None:
        if now_ns % (5 * MS) == 0:
            rig.device.write(now_ns)

    return rig.run(milliseconds, each=each)


def test_there_are_some() -> None:
    assert {'bno055', 'hokuyo', 'maxbotix', 'nmea', 'ublox', 'witmotion', 'xsens'} <= set(KINDS)


def test_samples_come_at_their_rate(on_tcp: Rig) -> None:
    run(on_tcp, 3000)
    before = len(on_tcp.publishers[0].samples)
    run(on_tcp, 3000)
    rate_hz = on_tcp.device.publications()[0].rate_hz
    assert len(on_tcp.publishers[0].samples) - before == pytest.approx(3 * rate_hz, rel=0.1, abs=1)
    statistics = on_tcp.device.statistics()
    assert statistics.rejected_bytes == statistics.rejected_frames == 0


def test_a_server_that_goes_is_a_fault_and_one_that_comes_back_is_used(on_tcp: Rig) -> None:
    run(on_tcp, 3000)
    plug: Any = on_tcp.simulated.port
    on_tcp.simulated.inject('unplug', 1.0)
    with pytest.raises(DeviceError, match='tcp://127.0.0.1:.*again'):
        for _ in range(100):
            on_tcp.now_ns += MS
            on_tcp.simulated.pump(on_tcp.now_ns)
            on_tcp.device.read(on_tcp.now_ns)
    on_tcp.now_ns += 1000 * MS
    on_tcp.simulated.pump(on_tcp.now_ns)
    assert plug.plugged
    on_tcp.reopen()
    before = len(on_tcp.publishers[0].samples)
    run(on_tcp, 4000)
    assert len(on_tcp.publishers[0].samples) > before


@pytest.mark.parametrize('option, said', [
    ('baro=5000', 'it is not a serial device'), ('gps=70000', 'the port must be from 1 to 65535'),
    ('none=5000', "there is no device 'none'")])
def test_what_cannot_be_served_is_refused(
        option: str, said: str, tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['gps:nmea', 'baro:bmp280', '--dir', str(tmp_path), '--tcp', option]) == 2
    assert said in capsys.readouterr().err

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

"""What a port is written as: paths, addresses of a network, and names that are looked up."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from pathlib import Path
import select
import time
from typing import Any

from driver_fakes import bind
from driver_fakes import settings_of
from far_ends import TcpFar
from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.hokuyo.driver import Hokuyo
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.devices.serial import lookup
from rt_robot_os.devices.serial.lookup import HostName
from rt_robot_os.devices.serial.network import network_address
from rt_robot_os.devices.serial.port import open_port
from rt_robot_os.devices.ublox.driver import Ublox
from rt_robot_os.devices.xsens.driver import Xsens

S = 1_000_000_000


def test_a_name_is_looked_up_elsewhere(tmp_path: Path) -> None:
    far = TcpFar(tmp_path)
    device = NmeaGps('gps', settings_of(NmeaGps, port=far.port.replace('127.0.0.1', 'localhost'),
                                        baud=0))
    bind(device)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        try:
            device.open()  # of several addresses each opening takes the next one
            device.send(b'hello')
            select.select([device.fileno()], [], [], 0.05)
            device.read(S)
            if select.select([far.listener], [], [], 0.1)[0]:
                break
        except DeviceError as error:
            assert 'looked up' in str(error) or 'refused' in str(error), error
    assert far.read(5) == b'hello'
    device.close()
    far.go()
    for host in lookup.HOSTS.values():
        host.close()


@pytest.fixture
def look_up(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], HostName]]:
    """Give a host whose name is looked up by a program of the test."""
    host = HostName('gps.example')

    def given(program: str) -> HostName:
        monkeypatch.setattr(lookup, '_PROGRAM', program)
        return host

    yield given
    host.close()


def test_a_name_that_nobody_knows(look_up: Callable[[str], HostName]) -> None:
    host = look_up('import sys; sys.exit("Name or service not known")')
    host.prepare()
    with pytest.raises(DeviceError, match="'gps.example' is not known .Name or service not known"
                                          '.: check the name and the network, or use its IP'):
        host.take()


def test_a_look_up_that_hangs_holds_up_nobody(
        look_up: Callable[[str], HostName], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lookup, '_PATIENCE_S', 0.0)
    host = look_up('import sys; sys.stdin.close(); import time; time.sleep(60)')
    host.prepare()
    for _ in range(3):
        with pytest.raises(DeviceError, match='is being looked up; if that takes long, check the'):
            host.take()


def test_each_opening_takes_the_next_address(
        look_up: Callable[[str], HostName], monkeypatch: pytest.MonkeyPatch) -> None:
    host = look_up('print("192.0.2.1"); print("2001:db8::1")')
    monkeypatch.setattr(lookup, '_PATIENCE_S', 30.0)
    host.prepare()
    assert [host.take().host for _ in range(3)] == ['192.0.2.1', '2001:db8::1', '192.0.2.1']


# --- what is written -----------------------------------------------------------------------------

@pytest.mark.parametrize('port', ['/dev/ttyUSB0', 'sim', 'scripted', 'COM1'])
def test_what_has_no_scheme_is_a_path(port: str) -> None:
    assert network_address(port) is None


@pytest.mark.parametrize('port, host, number', [
    ('tcp://10.0.0.5:2000', '10.0.0.5', 2000), ('tcp://[fe80::1%eth0]:23', 'fe80::1%eth0', 23),
    ('udp://lidar.local:2368', 'lidar.local', 2368), ('udp-listen://:10110', '', 10110),
    ('udp-listen://239.1.2.3:5000', '239.1.2.3', 5000), ('gpsd://localhost', 'localhost', 2947)])
def test_addresses(port: str, host: str, number: int) -> None:
    address = network_address(port)
    assert address is not None
    assert (address.host, address.port) == (host, number)


@pytest.mark.parametrize('port, right', [
    ('tcp://10.0.0.5', 'must look like tcp://host:port'), ('tcp://:5', 'must look like tcp://ho'),
    ('tcp://a:99999', 'must look like tcp://host:port'), ('tcp://a:5/x', 'must look like tcp'),
    ('udp://a:0', 'must look like udp'), ('http://a:80', 'must be a path or begin with one of'),
    ('tcp://u:p@a:5', 'must look like'), ('tcp://[::1:5', 'must look like tcp')])
@pytest.mark.parametrize('driver', [NmeaGps, Ublox, Hokuyo, Xsens])
def test_a_wrong_address_is_found_with_the_configuration(
        driver: Any, port: str, right: str) -> None:
    with pytest.raises(ConfigError, match=f'dut.port = .*: {right}'):
        driver('dut', settings_of(driver, port=port))
    with pytest.raises(DeviceError, match=right):
        open_port(port, None)


@given(st.text())
def test_any_text_is_an_address_a_path_or_an_error(text: str) -> None:
    for port in (text, 'tcp://' + text):
        try:
            network_address(port)
        except ValueError as error:
            assert str(error)

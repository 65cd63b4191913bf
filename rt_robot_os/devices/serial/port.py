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

"""The port of a serial driver, whatever carries its bytes: a line, a connection, datagrams."""

from __future__ import annotations

from typing import Protocol

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.serial.lookup import host_name
from rt_robot_os.devices.serial.lookup import numeric
from rt_robot_os.devices.serial.network import FORWARDER
from rt_robot_os.devices.serial.network import GPSD
from rt_robot_os.devices.serial.network import network_address
from rt_robot_os.devices.serial.network import NetworkAddress
from rt_robot_os.devices.serial.network import TCP
from rt_robot_os.devices.serial.network import TcpPort
from rt_robot_os.devices.serial.network import UdpPort
from rt_robot_os.devices.serial.transport import SerialPort


class Port(Protocol):
    """
    What a serial device needs; a replay puts recorded bytes in place.

    :ivar bytes_read: bytes taken since it was opened.
    :ivar dropped_write_bytes: bytes that found no room.
    """

    bytes_read: int
    dropped_write_bytes: int

    def fileno(self) -> int:
        """Return the descriptor that becomes readable with what arrives."""

    def read(self) -> bytes:
        """Take what is there without blocking, empty when that is nothing."""

    def write(self, data: bytes) -> None:
        """Send without blocking."""

    def close(self) -> None:
        """Close it; may be called twice."""


def address_of(name: str, key: str, port: str, forwarder: bool = False) -> NetworkAddress | None:
    """
    Read the port of a device.

    :param key: of the setting, for the error.
    :param forwarder: it may be a serial forwarder.
    :return: None when it is a path.
    :raises ConfigError: it is neither a path nor an address; the message says what is right.
    """
    try:
        return network_address(port, forwarder)
    except ValueError as error:
        raise ConfigError([f'{name}.{key} = {port!r}: {error}']) from error


def prepare_port(port: str) -> None:
    """Look up the host of a port, if it has one; waits for a moment, so not for the loop."""
    try:
        address = network_address(port, forwarder=True)
    except ValueError:
        return  # opening it reports the error
    if address is not None and numeric(address.host) is None:
        host_name(address.host).prepare()


def open_port(port: str, baud: int | None) -> Port:
    """
    Open a port: a path is a serial line, the others are those of :mod:`.network`.

    :param baud: bits a second of a serial line; None or 0 for a pty.
    :raises DeviceError: it cannot be opened; the message names cause and remedy.
    """
    try:
        address = network_address(port, forwarder=True)
    except ValueError as error:
        raise DeviceError(f'port {port}: {error}') from error
    if address is None:
        return SerialPort(port, baud)
    found = numeric(address.host) or host_name(address.host).take()
    if address.scheme in (TCP, GPSD, FORWARDER):
        return TcpPort(address, found)
    return UdpPort(address, found)


def silence_of(port: Port | None) -> str:
    """Return what a port says about nothing coming; empty when it says nothing."""
    silence = getattr(port, 'silence', None)
    return str(silence()) if silence is not None else ''


def more_of(port: Port | None) -> dict[str, Value]:
    """Return what only this kind of port has to tell, by name."""
    more = getattr(port, 'more', None)
    return dict(more()) if more is not None else {}

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

"""The port of a serial driver, on any transport: a line, a connection, datagrams."""

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
    The interface of a port; a replay implements it with recorded bytes.

    :ivar bytes_read: bytes read since it was opened.
    :ivar dropped_write_bytes: bytes dropped for lack of room.
    """

    bytes_read: int
    dropped_write_bytes: int

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when bytes arrive."""

    def read(self) -> bytes:
        """Read the available bytes without blocking; empty if there are none."""

    def write(self, data: bytes) -> None:
        """Send without blocking."""

    def close(self) -> None:
        """Close it; may be called twice."""


def address_of(name: str, key: str, port: str, forwarder: bool = False) -> NetworkAddress | None:
    """
    Parse the port of a device.

    :param key: of the setting, for the error.
    :param forwarder: a serial forwarder is allowed.
    :return: None if it is a path.
    :raises ConfigError: it is neither a path nor an address; the message contains the valid forms.
    """
    try:
        return network_address(port, forwarder)
    except ValueError as error:
        raise ConfigError([f'{name}.{key} = {port!r}: {error}']) from error


def prepare_port(port: str) -> None:
    """Look up the host of a port, if it has one; blocks for a moment, so not for the loop."""
    try:
        address = network_address(port, forwarder=True)
    except ValueError:
        return  # opening it reports the error
    if address is not None and numeric(address.host) is None:
        host_name(address.host).prepare()


def open_port(port: str, baud: int | None) -> Port:
    """
    Open a port: a path is a serial line, other forms are those of :mod:`.network`.

    :param baud: bits per second of a serial line; None or 0 for a pty.
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
    """Return the port's own remedy when no bytes arrive; empty if it has none."""
    silence = getattr(port, 'silence', None)
    return str(silence()) if silence is not None else ''


def more_of(port: Port | None) -> dict[str, Value]:
    """Return the counters of this kind of port, by name."""
    more = getattr(port, 'more', None)
    return dict(more()) if more is not None else {}

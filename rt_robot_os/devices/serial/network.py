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
Ports on a network: a serial driver can also read from TCP and UDP.

``tcp://host:port`` connects to a device or a serial server, ``gpsd://host`` to a GPSD, from which
the bytes of its receiver are requested. ``udp://host:port`` exchanges datagrams with one device;
``udp-listen://[address]:port`` receives datagrams sent to this machine, from the first sender.
``sf://host:port`` is a serial forwarder of TinyOS, for drivers that support its protocol.

Nothing blocks: a connection is started in ``open`` and established while the device is read; names
of hosts are looked up in another process (``lookup.py``).
"""

from __future__ import annotations

from dataclasses import dataclass
import errno
import ipaddress
import os
import socket
import struct
from typing import Final
from urllib.parse import urlsplit

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.serial.lookup import HostAddress
from rt_robot_os.devices.serial.transport import StreamPort

TCP, GPSD, UDP, UDP_LISTEN, FORWARDER = 'tcp', 'gpsd', 'udp', 'udp-listen', 'sf'
_FORMS: Final = {
    TCP: 'tcp://host:port', GPSD: 'gpsd://host', UDP: 'udp://host:port',
    UDP_LISTEN: 'udp-listen://:port'}
_FORMS_OF_MOTES: Final = {**_FORMS, FORWARDER: 'sf://host:port'}
_GPSD_PORT: Final = 2947
# Raw 2: the unmodified bytes of the receiver.
_GPSD_WATCH: Final = b'?WATCH={"enable":true,"raw":2};\n'
# A device with a pulled cable neither closes nor answers; unanswered bytes end the connection.
_UNANSWERED_MS: Final = 5000
_MAX_DATAGRAM: Final = 65536
_MAX_READ: Final = 65536
_RECEIVE_BUFFER: Final = 1 << 18


@dataclass(frozen=True)
class NetworkAddress:
    """
    A port from the configuration.

    :ivar text: as written.
    :ivar host: name or address; empty: listen on all addresses.
    """

    text: str
    scheme: str
    host: str
    port: int


def network_address(text: str, forwarder: bool = False) -> NetworkAddress | None:
    """
    Parse the port of a device.

    :param forwarder: a serial forwarder is allowed.
    :return: None if it is not a network port, such as the path of a serial port.
    :raises ValueError: it is an invalid network port; the message contains the valid form.
    """
    scheme, separator, _ = text.partition('://')
    if not separator:
        return None
    forms = _FORMS_OF_MOTES if forwarder else _FORMS
    form = forms.get(scheme)
    if form is None:
        raise ValueError(f'must be a path or begin with one of '
                         f'{", ".join(f"{each}://" for each in forms)}')
    try:
        parts = urlsplit(text)
        host, port = parts.hostname or '', parts.port
    except ValueError as error:
        raise ValueError(f'must look like {form} ({error})') from error
    if scheme == GPSD and port is None:
        port = _GPSD_PORT
    rest = parts.path or parts.query or parts.fragment or '@' in parts.netloc
    if not port or rest or not (host or scheme == UDP_LISTEN):
        raise ValueError(f'must look like {form}')
    return NetworkAddress(text, scheme, host, port)


class TcpPort(StreamPort):
    """A connection, established while it is read; bytes written before wait for it."""

    def __init__(self, address: NetworkAddress, found: HostAddress) -> None:
        """
        Start to connect.

        :param found: address of the host.
        :raises DeviceError: that is not possible; the message names cause and remedy.
        """
        super().__init__()
        self._address = address
        self._socket = socket.socket(found.family, socket.SOCK_STREAM)
        try:
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
            self._socket.connect(found.sockaddr(address.port))
        except BlockingIOError:
            pass  # it is established later
        except OSError as error:
            self._socket.close()
            raise self._gone(error) from error
        self._fd = self._socket.fileno()
        if address.scheme == GPSD:
            self.write(_GPSD_WATCH)

    def silence(self) -> str:
        """Return what to check when it is not connected; empty once it is."""
        try:
            self._socket.getpeername()
        except OSError:
            return (f'{self._address.text} does not answer to the connection: check address and '
                    'cable, that the device is switched on, and firewalls')
        return ''

    def close(self) -> None:
        """Close the connection; may be called twice and does not raise."""
        self._fd = -1
        self._socket.close()

    def _gone(self, error: OSError | None) -> DeviceError:
        place = self._address.text
        if error is None:
            return DeviceError(f'{place}: the other side closed the connection: check whether it '
                               'serves another client; it will be connected again')
        if error.errno == errno.ECONNREFUSED:
            return DeviceError(f'{place}: the connection was refused: check the port number, and '
                               'that a program listens there')
        return DeviceError(f'{place}: {_cause(error)}: check address, cable and network; it will '
                           'be connected again')


class UdpPort:
    """
    Datagrams, each read completely.

    :ivar bytes_read: bytes read since it was opened.
    :ivar dropped_write_bytes: bytes that could not be sent.
    :ivar foreign_datagrams: datagrams of others than the first sender; not used.
    """

    def __init__(self, address: NetworkAddress, found: HostAddress) -> None:
        """
        Open it; nothing is sent.

        :param found: address of the host, or the address to listen on.
        :raises DeviceError: that is not possible; the message names cause and remedy.
        """
        self.bytes_read = self.dropped_write_bytes = self.foreign_datagrams = 0
        self._address = address
        self._peer: tuple[object, ...] | None = None
        self._listens = address.scheme == UDP_LISTEN
        self._socket = socket.socket(found.family, socket.SOCK_DGRAM)
        try:
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            if self._listens:
                self._listen(found)
            else:
                self._socket.connect(found.sockaddr(address.port))
        except OSError as error:
            self._socket.close()
            raise self._problem(error) from error

    def fileno(self) -> int:
        """Return the file descriptor, for waiting until it is readable; -1 when closed."""
        return self._socket.fileno()

    def read(self) -> bytes:
        """
        Read the available datagrams; safe in the loop, at most about 128 KiB per call.

        :raises DeviceError: the device cannot be reached.
        """
        parts: list[bytes] = []
        size = 0
        while size < _MAX_READ:
            try:
                data, sender = self._socket.recvfrom(_MAX_DATAGRAM)
            except BlockingIOError:
                break
            except OSError as error:
                if parts:
                    break  # the next read reports the error, and these bytes are not lost
                raise self._problem(error) from error
            if self._listens:
                if self._peer is None or sender[0] == self._peer[0]:
                    self._peer = sender
                else:
                    self.foreign_datagrams += 1
                    size += len(data)
                    continue
            parts.append(data)
            size += max(len(data), 1)
        found = b''.join(parts)
        self.bytes_read += len(found)
        return found

    def write(self, data: bytes) -> None:
        """
        Send a datagram without blocking; safe in the loop. A failure is counted.

        :raises DeviceError: the device cannot be reached.
        """
        if not data:
            return
        try:
            if not self._listens:
                self._socket.send(data)
            elif self._peer is not None:
                self._socket.sendto(data, self._peer)
            else:
                self.dropped_write_bytes += len(data)
        except BlockingIOError:
            self.dropped_write_bytes += len(data)
        except OSError as error:
            raise self._problem(error) from error

    def more(self) -> dict[str, Value]:
        """Return the counters of this kind of port."""
        return {'foreign_datagrams': self.foreign_datagrams} if self._listens else {}

    def silence(self) -> str:
        """Return what to check when no bytes arrive."""
        if self._listens:
            return (f'nothing arrives at {self._address.text}: check that the device sends to the '
                    'address of this machine and to this port, and firewalls')
        return (f'{self._address.text} sends nothing: check the address, and that the device '
                'answers to the sender; for one that sends by itself use udp-listen://')

    def close(self) -> None:
        """Close it; may be called twice and does not raise."""
        self._socket.close()

    def _listen(self, found: HostAddress) -> None:
        group = ipaddress.ip_address(found.host.partition('%')[0])
        if group.is_multicast:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._socket.bind(found.sockaddr(self._address.port))
        if not group.is_multicast:
            return
        if found.family == socket.AF_INET:
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                                    struct.pack('=4s4x', group.packed))
        else:
            scope = found.sockaddr(0)[3]
            self._socket.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP,
                                    group.packed + struct.pack('=I', scope))

    def _problem(self, error: OSError) -> DeviceError:
        place = self._address.text
        if error.errno == errno.ECONNREFUSED:
            return DeviceError(f'{place}: no program listens there: check the port number')
        if error.errno == errno.EADDRINUSE:
            return DeviceError(f'{place}: another program listens there: stop it, or set the '
                               'device to another port')
        if error.errno == errno.EADDRNOTAVAIL:
            return DeviceError(f'{place}: this machine does not have that address: leave it out '
                               'to listen on all')
        return DeviceError(f'{place}: {_cause(error)}: check address, cable and network')


def _cause(error: OSError) -> str:
    return os.strerror(error.errno) if error.errno else str(error)

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
Corrections for a satellite receiver: RTCM 3 of a base station or a caster, checked and forwarded.

They arrive through their own port, in the same forms as that of a device, or from a caster:
``ntrip://user:password@host:2101/MOUNT``. Their errors are reported and counted, and are never a
fault of the receiver. Opening, reading and checking happen at low priority, in ``maintain``; the
task of the device only sends complete messages.
"""

from __future__ import annotations

from base64 import b64encode
from collections import Counter
from collections import deque
from collections.abc import Callable
from typing import Final
from urllib.parse import unquote
from urllib.parse import urlsplit

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.logger import Logger
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.serial.lookup import host_name
from rt_robot_os.devices.serial.lookup import numeric
from rt_robot_os.devices.serial.network import NetworkAddress
from rt_robot_os.devices.serial.network import TCP
from rt_robot_os.devices.serial.network import TcpPort
from rt_robot_os.devices.serial.port import address_of
from rt_robot_os.devices.serial.port import open_port
from rt_robot_os.devices.serial.port import Port
from rt_robot_os.devices.serial.port import prepare_port
from rt_robot_os.devices.serial.port import silence_of
from rt_robot_os.devices.ublox.rtcm import RtcmDecoder

_NTRIP: Final = 'ntrip://'
_NTRIP_PORT: Final = 2101
# Stations send each second, or every ten seconds on an expensive line.
_SILENCE_NS: Final = 30 * NS_PER_S
_RETRY_NS: Final = NS_PER_S
_RETRY_MAXIMUM_NS: Final = 30 * NS_PER_S
_POSITION_NS: Final = 10 * NS_PER_S
_READY_MESSAGES: Final = 64
_NUMBERS: Final = 32
# Limit of bytes per job; a station sends some kilobytes per second.
_JOB_BYTES: Final = 8192
_HEAD: Final = 64


class RtcmCorrections:
    """
    One source of corrections.

    :ivar problem: its current error; empty while messages arrive.
    :ivar numbers: count of messages by their number; 0: those beyond the first 32 kinds.
    """

    def __init__(self, name: str, port: str, baud: int, log: Logger,
                 position: Callable[[], bytes] = bytes) -> None:
        """
        Check the port; nothing is opened.

        :param name: of the device, for errors.
        :param position: returns an NMEA sentence with the position, for a caster that computes a
            base station there; empty if unknown.
        :raises ConfigError: the port is neither a path nor an address.
        """
        self.problem = 'not opened yet'
        self.numbers: Counter[int] = Counter()
        self._caster = _caster(name, port)
        if self._caster is None:
            address_of(name, 'corrections', port)
        self._text = self._caster.address.text if self._caster else port
        self._setting = port
        self._baud = baud
        self._log = log
        self._position = position
        self._position_due_ns = 0
        self._decoder = RtcmDecoder()
        self._port: Port | None = None
        self._head = self._left = b''
        self._ready: deque[bytes] = deque()
        self._dropped = self._last_ns = self._opened_ns = self._retry_at_ns = 0
        self._pause_ns = _RETRY_NS

    def prepare(self) -> None:
        """Look up the host; blocks for a moment, so not for the loop."""
        prepare_port(f'tcp://{_bracketed(self._caster.address.host)}:1' if self._caster
                     else self._setting)

    def maintain(self, now_ns: int) -> None:
        """Open, read and check if due; does not block, but belongs at low priority."""
        try:
            if self._port is None:
                if now_ns < self._retry_at_ns:
                    return
                self._port = self._open()
                self._opened_ns = now_ns
                self._head = self._left = b''
                self._position_due_ns = now_ns
                self._decoder.reset()
            self._read(self._port, now_ns)
        except DeviceError as error:
            self._fail(str(error), now_ns)

    def take(self) -> bytes:
        """Return the next complete message, empty if there is none; safe in the loop."""
        try:
            return self._ready.popleft()
        except IndexError:
            return b''

    def close(self) -> None:
        """Close the port; may be called twice and does not raise."""
        port, self._port = self._port, None
        if port is not None:
            port.close()
        self._ready.clear()

    def report(self, now_ns: int) -> dict[str, Value]:
        """Return its counters and its state."""
        return {
            'corrections': self.problem or 'coming',
            'corrections_age_s': (now_ns - self._last_ns) / NS_PER_S if self._last_ns else -1.0,
            'corrections_messages': ', '.join(
                f'{number}: {count}' for number, count in sorted(dict(self.numbers).items())),
            'corrections_rejected_bytes': self._decoder.rejected_bytes,
            'corrections_dropped': self._dropped,
        }

    def _open(self) -> Port:
        caster = self._caster
        if caster is None:
            return open_port(self._setting, self._baud)
        address = caster.address
        port = TcpPort(address, numeric(address.host) or host_name(address.host).take())
        port.write(caster.request)
        return port

    def _read(self, port: Port, now_ns: int) -> None:
        port.write(b'')  # the part that was not sent yet
        data = self._left or port.read()
        data, self._left = data[:_JOB_BYTES], data[_JOB_BYTES:]
        if len(self._head) < _HEAD:
            self._head += data[:_HEAD - len(self._head)]
        for frame in self._decoder.feed(data):
            known = frame.number in self.numbers or len(self.numbers) < _NUMBERS
            self.numbers[frame.number if known else 0] += 1
            if len(self._ready) >= _READY_MESSAGES:
                self.take()
                self._dropped += 1
            self._ready.append(frame.data)
            self._last_ns = now_ns
            self._pause_ns = _RETRY_NS
            if self.problem:
                self.problem = ''
                self._log.info('corrections arrive from %s', self._text)
        if now_ns - max(self._last_ns, self._opened_ns) > _SILENCE_NS:
            raise DeviceError(self._why_nothing(port))
        if self._caster is not None:
            self._check_answer()
            self._tell_position(port, now_ns)

    def _tell_position(self, port: Port, now_ns: int) -> None:
        if now_ns >= self._position_due_ns and self._head:
            sentence = self._position()
            if sentence:
                port.write(sentence)
                self._position_due_ns = now_ns + _POSITION_NS

    def _why_nothing(self, port: Port) -> str:
        said = silence_of(port)
        return said or (f'{self._text}: no RTCM 3 message for {_SILENCE_NS // NS_PER_S} s: check '
                        'that the source sends RTCM 3')

    def _check_answer(self) -> None:
        """Read the first answer of a caster: the stream, or an error."""
        head = self._head
        if head.startswith(b'SOURCETABLE'):
            raise DeviceError(f'{self._text}: the caster has no such mount point: see its list '
                              '(curl http://host:2101)')
        status = head.split(b' ')[1:2]
        if head.startswith(b'HTTP/') and status and len(head) > 12 and status != [b'200']:
            code = status[0][:3].decode('ascii', 'replace')
            raise DeviceError(f'{self._text}: the caster answers {code!r}: '
                              + ('check user and password' if code in ('401', '403')
                                 else 'check the mount point'))

    def _fail(self, problem: str, now_ns: int) -> None:
        port, self._port = self._port, None
        if port is not None:
            port.close()
        self._retry_at_ns = now_ns + self._pause_ns
        self._pause_ns = min(2 * self._pause_ns, _RETRY_MAXIMUM_NS)
        if problem != self.problem:
            self.problem = problem
            self._log.warn('no corrections: %s', problem)


class _Caster:
    """The address of a caster, and the request to it."""

    def __init__(self, address: NetworkAddress, request: bytes) -> None:
        self.address = address
        self.request = request


def _caster(name: str, port: str) -> _Caster | None:
    """
    Parse the address of a caster; None if it is another kind of address.

    :raises ConfigError: it is one with an error.
    """
    if not port.startswith(_NTRIP):
        return None
    try:
        parts = urlsplit(port)
        host, number = parts.hostname, parts.port or _NTRIP_PORT
    except ValueError:
        host, number = None, 0
    mount = parts.path[1:] if host else ''
    if not host or not mount or any(c.isspace() or not c.isascii() for c in port):
        raise ConfigError([f'{name}.corrections must look like ntrip://user:password@host:2101/'
                           'MOUNT'])
    lines = [f'GET /{mount} HTTP/1.0', 'User-Agent: NTRIP rt_robot_os', 'Accept: */*']
    if parts.username:
        user = f'{unquote(parts.username)}:{unquote(parts.password or "")}'
        lines.append(f'Authorization: Basic {b64encode(user.encode()).decode()}')
    text = f'ntrip://{_bracketed(host)}:{number}/{mount}'  # never the password
    return _Caster(NetworkAddress(text, TCP, host, number),
                   '\r\n'.join((*lines, '', '')).encode())


def _bracketed(host: str) -> str:
    return f'[{host}]' if ':' in host else host

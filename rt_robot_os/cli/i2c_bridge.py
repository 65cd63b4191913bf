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
The program `i2c_bridge`: a real I2C bus behind a socket, so that nobody in the core waits for it.

Linux lets no signal through while an I2C adapter works. Here that wait is in another process. The
core starts one for each real bus by itself; by hand it serves a bus to several robots.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import contextlib
import errno
import os
from pathlib import Path
import select
import signal
import socket
import stat
import sys
import time

from rt_robot_os.devices.i2c.bus import I2cTransport
from rt_robot_os.devices.i2c.errors import is_gone
from rt_robot_os.devices.i2c.errors import open_error
from rt_robot_os.devices.i2c.packets import NO_BUS
from rt_robot_os.devices.i2c.socket_bus import SocketTransport
from rt_robot_os.errors import DeviceError
from rt_robot_os.errors import RtRobotError
from rt_robot_os.link.paths import runtime_folder
from rt_robot_os.linux.realtime import set_fifo
from rt_robot_os.sim.i2c_port import I2cPort

OK, FAILED, BAD_ARGUMENTS = 0, 1, 2
_WAIT_S = 0.5
_PINNED_BY_S = 5.0


class Bridge:
    """
    Does the transactions of a socket on a real bus, and opens that again when it was gone.

    :ivar transfers: transactions that went well.
    :ivar failures: transactions that did not.
    """

    def __init__(self, path: str) -> None:
        """Keep the path; the bus is opened with the first transaction, or :meth:`open`."""
        self.transfers = 0
        self.failures = 0
        self._path = path
        self._transport: I2cTransport | None = None

    def open(self) -> I2cTransport:  # noqa: A003
        """
        Open the bus unless it is.

        :raises DeviceError: it cannot be opened; the message says what to do.
        """
        if self._transport is None:
            self._transport = open_transport(self._path)
        return self._transport

    def transfer(
        self, address: int, data: bytes, size: int, now_ns: int,
    ) -> tuple[int, bytes, int]:
        """
        Do one transaction.

        :return: errno (0 when it went well), the bytes read or what is to be said of the error,
            and 0: they may go at once.
        """
        try:
            answer = self.open().transfer(address, data, size)
        except DeviceError as error:
            self.failures += 1
            return NO_BUS, str(error).encode(), 0
        except OSError as error:
            self.failures += 1
            if is_gone(error):
                self.close()
            return error.errno or errno.EIO, (error.strerror or '').encode(), 0
        self.transfers += 1
        return 0, answer, 0

    def close(self) -> None:
        """Let go of the bus; may be called twice."""
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.close()


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until SIGTERM or Ctrl-C; the exit code is 2 when the bus cannot be opened."""
    parser = argparse.ArgumentParser(
        prog='i2c_bridge', description='Serve a real I2C bus on a socket. The core starts one by '
        'itself; start it by hand for several robots on one bus, and give the path that it prints '
        'as port of the devices.')
    parser.add_argument('bus', help='such as /dev/i2c-1')
    parser.add_argument('--socket', type=Path, help='where; by default in the runtime folder')
    parser.add_argument('--priority', type=int, default=70, choices=range(100), metavar='0..99',
                        help='SCHED_FIFO priority, 0: none (default %(default)s)')
    # Of the core that started it: its process, and the socket that it made. The bridge ends when
    # its standard input is closed.
    parser.add_argument('--with-parent', type=int, default=0, help=argparse.SUPPRESS)
    parser.add_argument('--listener', type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args(sys.argv[1:] if argv is None else argv)
    bridge = Bridge(arguments.bus)
    try:
        if not arguments.with_parent:
            bridge.open()
        listener = None
        if arguments.listener is not None:
            listener = socket.socket(fileno=arguments.listener)
        port = I2cPort(arguments.socket or runtime_folder() / Path(arguments.bus).name, bridge,
                       listener)
        port.plug()
    except RtRobotError as error:
        print(error, file=sys.stderr)
        return BAD_ARGUMENTS
    if arguments.with_parent:
        # One that is started again inherits what the core has: its CPU and its priority.
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        _leave_cpu(arguments.with_parent)
    if arguments.priority:
        result = set_fifo(arguments.priority)
        if not arguments.with_parent:
            print(f'i2c_bridge: {result}', file=sys.stderr)
    print(port.socket_path, flush=True)
    try:
        _serve(port, arguments.with_parent)
    finally:
        port.unplug()
        bridge.close()
        if arguments.with_parent:
            with contextlib.suppress(OSError):  # somebody has tidied up
                port.socket_path.parent.rmdir()
    return OK


def open_transport(path: str) -> I2cTransport:
    """
    Open a bus to wait on: a real one, or one that another process serves.

    :raises DeviceError: it cannot be opened; the message says what to do.
    """
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISSOCK(mode):
            return SocketTransport(path)
        if stat.S_ISCHR(mode):
            from rt_robot_os.devices.i2c.linux_bus import LinuxTransport
            return LinuxTransport(path)
    except ImportError as error:
        raise DeviceError(
            f'I2C bus {path}: the Python package smbus2 cannot be imported ({error}): '
            'sudo apt install python3-smbus2, or pip install smbus2') from error
    except OSError as error:
        raise open_error(path, error) from error
    raise DeviceError(f'{path} is not an I2C bus: check the port (ls /dev/i2c-* lists them)')


def _leave_cpu(parent: int) -> None:
    """Leave the CPU of a core that is pinned to it alone, if there is another."""
    try:
        of_core = os.sched_getaffinity(parent)
        others = set(range(os.cpu_count() or 1)) - of_core
        if len(of_core) == 1 and others:
            os.sched_setaffinity(0, others)
    except OSError:
        pass  # it has ended, or these are not ours: then it stays where it is


def _serve(port: I2cPort, parent: int) -> None:
    """
    Serve until a signal comes.

    :param parent: the core that started it, or 0. The end of the standard input is then the end,
        too, and Ctrl-C is left to the core.
    """
    stopped: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda signum, frame: stopped.append(signum))
    if parent:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    # One that is started again by a core that runs begins with the signals that it had blocked.
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    lifeline = sys.stdin.fileno() if parent else -1
    watched = [port.fileno()] + [lifeline] * bool(parent)
    # The core is pinned after it has started this process.
    look_at = time.monotonic() + _PINNED_BY_S if parent else float('inf')
    while not stopped:
        readable, _, _ = select.select(watched, [], [], _WAIT_S)
        if lifeline in readable:
            break
        port.serve(time.monotonic_ns())
        if time.monotonic() > look_at:
            look_at = float('inf')
            _leave_cpu(parent)


if __name__ == '__main__':
    sys.exit(main())

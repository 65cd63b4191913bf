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
The program `i2c_bridge`: a real I2C bus behind a socket, so that transfers can be preempted.

Linux lets no signal through while an I2C adapter works. Here that wait is in another process; the
core waits for a socket instead, and what has a higher priority runs meanwhile.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import errno
from pathlib import Path
import select
import signal
import sys
import time

from rt_robot_os.drivers.i2c import I2cTransport
from rt_robot_os.drivers.i2c import is_gone
from rt_robot_os.drivers.i2c import open_transport
from rt_robot_os.errors import DeviceError
from rt_robot_os.errors import RtRobotError
from rt_robot_os.link.paths import runtime_folder
from rt_robot_os.linux.realtime import set_fifo
from rt_robot_os.sim.i2c_port import I2cPort

OK, FAILED, BAD_ARGUMENTS = 0, 1, 2
_WAIT_S = 0.5


class Bridge:
    """
    Does the transactions of a socket on a real bus, and opens that again when it was gone.

    :ivar transfers: transactions that went well.
    :ivar failures: transactions that did not.
    """

    def __init__(self, path: str) -> None:
        """
        Open the bus.

        :raises DeviceError: it cannot be opened; the message says what to do.
        """
        self.transfers = 0
        self.failures = 0
        self._path = path
        self._transport: I2cTransport | None = open_transport(path)

    def transfer(
        self, address: int, data: bytes, size: int, now_ns: int,
    ) -> tuple[int, bytes, int]:
        """
        Do one transaction.

        :return: errno (0 when it went well), the bytes read, and 0: they may go at once.
        """
        try:
            if self._transport is None:
                self._transport = open_transport(self._path)
            answer = self._transport.transfer(address, data, size)
        except DeviceError:
            self.failures += 1
            return errno.ENODEV, b'', 0
        except OSError as error:
            self.failures += 1
            if is_gone(error):
                self.close()
            return error.errno or errno.EIO, b'', 0
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
        prog='i2c_bridge', description='Put a real I2C bus behind a socket, so that the core can '
        'be preempted while it transfers. Give the path that it prints as port of the devices.')
    parser.add_argument('bus', help='such as /dev/i2c-1')
    parser.add_argument('--socket', type=Path, help='where; by default in the runtime folder')
    parser.add_argument('--priority', type=int, default=70, choices=range(100), metavar='0..99',
                        help='SCHED_FIFO priority, 0: none (default %(default)s)')
    arguments = parser.parse_args(sys.argv[1:] if argv is None else argv)
    try:
        bridge = Bridge(arguments.bus)
        port = I2cPort(arguments.socket or runtime_folder() / Path(arguments.bus).name, bridge)
        port.plug()
    except RtRobotError as error:
        print(error, file=sys.stderr)
        return BAD_ARGUMENTS
    if arguments.priority:
        print(f'i2c_bridge: {set_fifo(arguments.priority)}', file=sys.stderr)
    print(port.socket_path, flush=True)
    try:
        _serve(port)
    finally:
        port.unplug()
        bridge.close()
    return OK


def _serve(port: I2cPort) -> None:
    stopped: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda signum, frame: stopped.append(signum))
    while not stopped:
        select.select([port.fileno()], [], [], _WAIT_S)
        port.serve(time.monotonic_ns())


if __name__ == '__main__':
    sys.exit(main())

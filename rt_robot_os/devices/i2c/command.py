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
The program `i2c_bridge`: serve a real I2C bus on a socket.

Linux handles no signal while an I2C adapter works, so this happens in a separate process. The core
starts one for each real bus; started by hand it serves a bus to several robots.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import contextlib
import os
from pathlib import Path
import select
import signal
import socket
import sys
import time

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.devices.i2c.real_bus import RealBus
from rt_robot_os.devices.i2c.simulated_port import I2cPort
from rt_robot_os.linux.paths import runtime_folder
from rt_robot_os.linux.realtime import set_fifo

_WAIT_S = 0.5
_PINNED_BY_S = 5.0


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='i2c_bridge', description='Serve a real I2C bus on a socket. The core starts one by '
        'itself; start it by hand for several robots on one bus, and give the path that it prints '
        'as port of the devices.')
    parser.add_argument('bus', help='such as /dev/i2c-1')
    parser.add_argument('--socket', type=Path, help='where; by default in the runtime folder')
    parser.add_argument('--priority', type=int, default=70, choices=range(100), metavar='0..99',
                        help='SCHED_FIFO priority, 0: none (default %(default)s)')
    # From the core that started it: its process id, and the socket that it made. The bridge ends
    # when its standard input is closed.
    parser.add_argument('--with-parent', type=int, default=0, help=argparse.SUPPRESS)
    parser.add_argument('--listener', type=int, help=argparse.SUPPRESS)
    return parser.parse_args(argv)


def run(argv: Sequence[str]) -> int:
    """
    Serve until SIGTERM or Ctrl-C.

    :param argv: without the program's name.
    :return: the exit code, 2 when the bus cannot be opened.
    """
    arguments = _arguments(argv)
    bus = RealBus(arguments.bus)
    stopped: list[int] = []
    with ended_by_signals(stopped.append):
        # A bridge that is restarted by a running core inherits its blocked signals.
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        try:
            port = _port(bus, arguments)
        except RtRobotError as error:
            print(error, file=sys.stderr)
            return BAD_USE
        try:
            _prepare(arguments)
            print(port.socket_path, flush=True)
            _serve(port, arguments.with_parent, stopped)
        finally:
            port.unplug()
            bus.close()
            if arguments.with_parent:
                with contextlib.suppress(OSError):  # it has been removed already
                    port.socket_path.parent.rmdir()
    return OK


def _port(bus: RealBus, arguments: argparse.Namespace) -> I2cPort:
    """
    Make the socket.

    :raises RtRobotError: it cannot be made, or, when started by hand, the bus cannot be opened.
    """
    if not arguments.with_parent:
        bus.open()
    listener = None
    if arguments.listener is not None:
        listener = socket.socket(fileno=arguments.listener)
    port = I2cPort(arguments.socket or runtime_folder() / Path(arguments.bus).name, bus, listener)
    port.plug()
    return port


def _prepare(arguments: argparse.Namespace) -> None:
    """Set the CPU and the priority of the program."""
    if arguments.with_parent:
        # A restarted bridge inherits the CPU and the priority of the core.
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        _leave_cpu(arguments.with_parent)
    if arguments.priority:
        result = set_fifo(arguments.priority)
        if not arguments.with_parent:
            warn('i2c_bridge', result)


def _leave_cpu(parent: int) -> None:
    """Avoid the CPU of a pinned core, if there is another."""
    try:
        of_core = os.sched_getaffinity(parent)
        others = set(range(os.cpu_count() or 1)) - of_core
        if len(of_core) == 1 and others:
            os.sched_setaffinity(0, others)
    except OSError:
        pass  # it has ended, or belongs to another user: nothing is changed


def _serve(port: I2cPort, parent: int, stopped: Sequence[int]) -> None:
    """
    Serve until a signal arrives.

    :param parent: the core that started it, or 0. With a core, the end of the standard input also
        ends the program.
    """
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

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

"""The programs `simulator` and `player`: simulated devices and recorded logs on real paths."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from collections.abc import Sequence
import os
from pathlib import Path
import sys
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import OK
from rt_robot_os.devices.simulators import SIMULATORS
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.linux.lock_file import LockFile
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.base import Simulated
from rt_robot_os.sim.commands import execute_command
from rt_robot_os.sim.commands import send_command
from rt_robot_os.sim.commands import WHERE
from rt_robot_os.sim.commands import WORLD
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.faults import FAULT_HELP
from rt_robot_os.sim.paths import hold_paths
from rt_robot_os.sim.paths import release
from rt_robot_os.sim.player import at_line_speed
from rt_robot_os.sim.player import by_nmea_time
from rt_robot_os.sim.player import load_log
from rt_robot_os.sim.player import Piece
from rt_robot_os.sim.player import Player
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.server import SimServer
from rt_robot_os.sim.tcp_port import TcpPlug
from rt_robot_os.sim.world.events import EVENT_FORMS

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World


def _by_scan_time(lines: Sequence[bytes]) -> tuple[Piece, ...]:
    # Late: it needs NumPy.
    from rt_robot_os.devices.hokuyo.scan_log import by_scan_time
    return by_scan_time(lines)


_PACES: Final = {'line': at_line_speed, 'times': by_nmea_time, 'scans': _by_scan_time}
_BAUD: Final = 9600
_SCAN_BAUD: Final = 500000


def simulator(argv: Sequence[str]) -> int:
    """
    Run simulated devices until SIGTERM, SIGINT or the end of the parent process.

    :param argv: without the program's name.
    :return: the exit status, 2 when the arguments are wrong.
    """
    parser = _simulator_parser()
    arguments = parser.parse_args(argv)
    if arguments.tell:
        return _send_command(arguments)
    if not arguments.devices:
        parser.error('name a device, such as imu:witmotion')
    try:
        world = _world(Path(arguments.world)) if arguments.world else None
        devices = build_devices(arguments, world)
    except ConfigError as error:
        return _fail(error)
    server = SimServer(tuple(devices.values()), report=_report_error)
    held: list[LockFile] = []
    try:
        with ended_by_signals(lambda _: server.stop()):
            held = hold_paths(_folder(arguments.dir, []), devices)
            for device in devices.values():
                device.port.plug()
            for name, device in devices.items():
                where = device.port.url if isinstance(device.port, TcpPlug) else device.path
                print(f'{name} {where}', flush=True)
            server.read_lines(sys.stdin.fileno(), lambda line: _inject(devices, line, world))
            _run(server, arguments.keep_running)
    except DeviceError as error:
        return _fail(error)
    finally:
        server.close()
        release(held)
    return OK


def _world(path: Path) -> World:
    # Late: it needs NumPy, and most simulated devices do not.
    from rt_robot_os.settings.world import load_world
    from rt_robot_os.sim.world.world import World
    return World(load_world(path))


def player(argv: Sequence[str]) -> int:
    """
    Play a recorded log through a pty.

    :param argv: without the program's name.
    :return: the exit status, 2 when the arguments are wrong.
    """
    arguments = _player_parser().parse_args(argv)
    try:
        lines = load_log(arguments.file)
        pieces = _PACES[arguments.pace](lines)
        baud = arguments.baud
        if baud is None:
            baud = _SCAN_BAUD if arguments.pace == 'scans' else _BAUD
        playing = Player(
            pieces, PtyPort(arguments.link), baud, loop=arguments.loop,
            speed=arguments.speed, wait_for_reader=arguments.wait)
    except ConfigError as error:
        return _fail(error)
    server = SimServer([playing], report=_report_error)
    try:
        with ended_by_signals(lambda _: server.stop()):
            playing.port.plug()
            print(playing.port.link, flush=True)
            _run(server, arguments.keep_running, lambda: playing.over)
    except DeviceError as error:
        return _fail(error)
    finally:
        server.close()
    return OK


def build_devices(arguments: argparse.Namespace, world: World | None = None
                  ) -> dict[str, Simulated]:
    """
    Make the simulated devices of the arguments; nothing is plugged in.

    :param world: that they sense.
    :raises ConfigError: with every problem found.
    """
    problems: list[str] = []
    types: dict[str, str] = {}
    for text in arguments.devices:
        name, _, kind = text.partition(':')
        if not name or not kind or '/' in name or name.startswith('.'):
            problems.append(f'device {text!r} is not understood: write NAME:TYPE, imu:witmotion')
        elif name in types:
            problems.append(f'there are two devices with the name {name!r}: rename one')
        else:
            types[name] = kind
    bauds = _per_device(arguments.baud, types, '--baud', problems)
    rates = _per_device(arguments.rate, types, '--rate', problems)
    numbers = _per_device(arguments.tcp, types, '--tcp', problems)
    faults = _faults(arguments.fault, types, problems)
    folder = _folder(arguments.dir, problems)
    place = RobotSite(folder, world)
    devices: dict[str, Simulated] = {}
    for name, kind in types.items():
        settings: dict[str, Any] = {'faults': faults[name], 'seed': arguments.seed}
        if name in rates:
            settings['rate_hz'] = rates[name]
        try:
            wanted = {'baud': int(bauds[name])} if name in bauds else {}
            device = SIMULATORS.load(kind).made_for(name, settings, place, wanted)
            if told := SIMULATORS.deprecation(kind):
                _report_error(told)
            device.check_speed()
            if name in numbers:
                _put_on_network(name, device, int(numbers[name]))
            devices[name] = device
        except ConfigError as error:
            problems.extend(error.problems)
    if problems:
        raise ConfigError(problems)
    return devices


def _put_on_network(name: str, device: Simulated, number: int) -> None:
    if not isinstance(device, SimulatedDevice):
        raise ConfigError([f'--tcp {name}={number}: it is not a serial device'])
    if not 0 < number < 65536:
        raise ConfigError([f'--tcp {name}={number}: the port must be from 1 to 65535'])
    device.port = TcpPlug(number)


def _simulator_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='simulator', description='Simulated devices, with faults on demand: serial devices '
        'on ptys, chips on an emulated I2C bus.',
        epilog='A line "imu silent 3" on standard input makes the device imu silent for three '
        f'seconds. Faults: {FAULT_HELP}. With a world, "{WORLD} person anna 2.0 1.0" places anna '
        f'there, and so on: {EVENT_FORMS}. "{WORLD} {WHERE}" prints all positions.')
    parser.add_argument('devices', nargs='*', metavar='NAME:TYPE',
                        help=f'such as imu:witmotion; types: {", ".join(SIMULATORS.names())}')
    parser.add_argument('--dir', help='folder of the paths, '
                        'by default $XDG_RUNTIME_DIR/rt_robot_os')
    parser.add_argument('--baud', action='append', default=[], metavar='[NAME=]BAUD',
                        help='speed of the line, 0 has none')
    parser.add_argument('--rate', action='append', default=[], metavar='[NAME=]HZ',
                        help='samples a second')
    parser.add_argument('--fault', action='append', default=[], metavar='"NAME: FAULT at S for S"',
                        help='such as "imu: unplug at 5 for 2", seconds after the start')
    parser.add_argument('--tcp', action='append', default=[], metavar='NAME=PORT',
                        help='serve a serial device at tcp://127.0.0.1:PORT instead of a pty')
    parser.add_argument('--world', metavar='FILE', help='the world that the devices sense: a YAML '
                        'file with a map, people, marks and so on; see docs/world.md')
    parser.add_argument('--seed', type=int, default=1, help='of noise and faults')
    parser.add_argument('--tell', metavar='ORDER', help='simulate nothing: send such a line to '
                        'the simulated devices of a running robot, and end')
    add_robot_option(parser)
    _add_keep_running(parser)
    return parser


def _player_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='player', description='Play a recorded log of bytes through a pty.')
    parser.add_argument('file', help='the log; lines beginning with # are skipped')
    parser.add_argument('--link', required=True, help='path that the driver opens')
    parser.add_argument('--baud', type=int,
                        help=f'speed of the line ({_BAUD}; {_SCAN_BAUD} with --scans)')
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument('--times', action='store_const', const='times', dest='pace', default='line',
                      help='start each epoch at the time in its NMEA sentences')
    pace.add_argument('--scans', action='store_const', const='scans', dest='pace',
                      help='the log holds scans of a Hokuyo URG-04LX, one per line, in the format '
                      'of BreezySLAM; read it with type: hokuyo and configure: false')
    parser.add_argument('--loop', action='store_true', help='restart at the end')
    parser.add_argument('--speed', type=float, default=1.0, help='times faster than recorded')
    parser.add_argument('--wait', action='store_true', help='start when a reader opens the port')
    _add_keep_running(parser)
    return parser


def _add_keep_running(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--keep-running', action='store_true',
                        help='continue when the process that started this one ends')


def _per_device(
    texts: Sequence[str], types: dict[str, str], option: str, problems: list[str],
) -> dict[str, float]:
    """Parse ``VALUE`` for all devices or ``NAME=VALUE`` for one; later ones win."""
    values: dict[str, float] = {}
    for text in texts:
        name, equals, number = text.rpartition('=')
        try:
            value = float(number)
        except ValueError:
            value = -1.0
        if not 0 <= value < 1e9:
            problems.append(f'{option} {text!r}: {number!r} is not a number from 0')
        elif equals and name not in types:
            problems.append(f'{option} {text!r}: there is no device {name!r}')
        else:
            values.update(dict.fromkeys([name] if equals else types, value))
    return values


def _faults(
    texts: Sequence[str], types: dict[str, str], problems: list[str],
) -> dict[str, list[str]]:
    faults: dict[str, list[str]] = {name: [] for name in types}
    for text in texts:
        name, _, fault = text.partition(':')
        if name.strip() in faults and fault.strip():
            faults[name.strip()].append(fault.strip())
        else:
            problems.append(
                f'--fault {text!r} is not understood: write it like "imu: unplug at 5 for 2" with '
                f'one of the devices {", ".join(types)}')
    return faults


def _folder(given: str | None, problems: list[str]) -> Path:
    if given:
        return Path(given)
    runtime = os.environ.get('XDG_RUNTIME_DIR')
    if not runtime:
        problems.append('XDG_RUNTIME_DIR is not set: give the folder of the paths with --dir')
    return Path(runtime or '.') / 'rt_robot_os'


def _inject(devices: dict[str, Simulated], line: str, world: World | None) -> None:
    """Execute a command such as ``imu silent 3`` or ``world kidnap 1.0 2.0 0.5``."""
    try:
        _print_answer(execute_command(line, devices, world))
    except ConfigError as error:
        _report_error(str(error))


def _print_answer(answer: str) -> None:
    if answer:
        print(answer, flush=True)


def _send_command(arguments: argparse.Namespace) -> int:
    """Send a command to the simulated devices of a running robot."""
    # Late: `--help` does not need it.
    from rt_robot_os.core.simulators import device_folder
    try:
        _print_answer(send_command(Path(arguments.dir) if arguments.dir else device_folder(
            socket_path(arguments.robot)), arguments.tell))
    except (ConfigError, DeviceError, StartError) as error:
        return _fail(error)
    return OK


def _run(server: SimServer, keep_running: bool, until: Callable[[], bool] | None = None) -> None:
    server.run(on_start=None if keep_running else lambda: _die_with_parent(server), until=until)


def _die_with_parent(server: SimServer) -> None:
    # Late: a caller that only builds simulated devices does not need it.
    from rt_robot_os.linux.process import die_with_parent
    if not die_with_parent(os.getppid()):
        server.stop()


def _report_error(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _fail(error: Exception) -> int:
    _report_error(str(error))
    return BAD_USE

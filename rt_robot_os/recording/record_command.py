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

"""The program `record`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.recording.library import need_mcap

if TYPE_CHECKING:
    from rt_robot_os.recording.bag import Bag
    from rt_robot_os.recording.recorder import RecorderStatus

_UNITS = {'': 1, 'k': 1 << 10, 'M': 1 << 20, 'G': 1 << 30}


def _bytes(text: str) -> int:
    number, unit = (text[:-1], text[-1]) if text[-1:] in ('k', 'M', 'G') else (text, '')
    try:
        value = round(float(number) * _UNITS[unit])
    except (ValueError, OverflowError):
        raise argparse.ArgumentTypeError(f'{text!r}: a number of bytes such as 500M') from None
    if value < 1 << 16:
        raise argparse.ArgumentTypeError(f'{text!r}: at least 64k')
    return value


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < 1e9:
        raise argparse.ArgumentTypeError(f'{text!r}: a number above 0')
    return value


def _count(text: str) -> int:
    if not text.isdigit() or not int(text):
        raise argparse.ArgumentTypeError(f'{text!r}: a number from 1')
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='record', description='Record the ROS topics of a running robot as MCAP, for ros2 '
        'bag, Foxglove and PlotJuggler, with the data for replay. Ctrl-C ends it.')
    parser.add_argument('topics', nargs='*', metavar='TOPIC',
                        help='such as /imu/data, by its name in ROS or in the core (default: all '
                        'ROS topics of the robot)')
    parser.add_argument('-o', '--output', type=Path, metavar='FOLDER',
                        help='a new folder; it must not exist (default: robot_ and the time)')
    add_robot_option(parser)
    parser.add_argument('--duration', type=_positive, metavar='S', help='end after this time')
    parser.add_argument('--max-bytes', type=_bytes, default=0, metavar='N',
                        help='start a new file when one has N bytes: 500M, 2G')
    parser.add_argument('--max-files', type=_count, default=0, metavar='N',
                        help='delete the oldest file when there are more')
    parser.add_argument('--compression', choices=('zstd', 'lz4', 'none'), default='zstd')
    parser.add_argument('--unmirrored', action='store_true',
                        help='also record topics of the core that are not mirrored to ROS')
    parser.add_argument('--core-names', action='store_true',
                        help='record topics with the names and types of the core')
    parser.add_argument('--no-bytes', action='store_true',
                        help='record no data for replay: bytes of devices, times of jobs')
    parser.add_argument('--repair', type=Path, metavar='PATH',
                        help='repair a truncated recording, and do nothing else')
    return parser


def _show_status(status: RecorderStatus) -> None:
    seconds = status.elapsed_ns / NS_PER_S
    text = (f'{seconds:8.1f} s  {status.messages:9d} messages  {status.size / 1e6:9.2f} MB  '
            f'lost {sum(status.lost.values())}')
    if status.lost:
        worst = sorted(status.lost.items(), key=lambda item: -item[1])
        text += ' (' + ', '.join(f'{name} {count}' for name, count in worst[:4])
        text += ', ...)' if len(worst) > 4 else ')'
    if sys.stderr.isatty():
        print(f'\r\x1b[K{text}', end='', file=sys.stderr, flush=True)
    else:
        print(text, file=sys.stderr, flush=True)


def _tell(text: str) -> None:
    begin = '\r\x1b[K' if sys.stderr.isatty() else ''
    print(f'{begin}{text}', file=sys.stderr, flush=True)


def _record(arguments: argparse.Namespace) -> int:
    from rt_robot_os.recording.bag import Bag
    from rt_robot_os.recording.bag import Limits
    from rt_robot_os.recording.recorder import Recorder
    from rt_robot_os.recording.recorder import UnknownTopicError
    from rt_robot_os.recording.selection import Wanted
    robot = arguments.robot
    folder = arguments.output or Path(f'{robot}_{datetime.now():%Y_%m_%d-%H_%M_%S}')
    bag = Bag(folder, arguments.compression, Limits(arguments.max_bytes, arguments.max_files))
    recorder = Recorder(
        socket_path(robot), bag,
        Wanted(tuple(arguments.topics), not arguments.no_bytes,
               round((arguments.duration or 0) * NS_PER_S), arguments.core_names,
               arguments.unmirrored),
        _tell, _show_status)

    def stop(signo: int) -> None:
        recorder.stopping = True

    try:
        with ended_by_signals(stop):
            recorder.run()
    except UnknownTopicError as error:
        print(error, file=sys.stderr)
        return BAD_USE
    finally:
        if bag.empty:
            folder.rmdir()
        elif sys.stderr.isatty():
            print(file=sys.stderr)
    if bag.empty:
        print('nothing was recorded: no core answered', file=sys.stderr)
        return FAILED
    _print_summary(bag)
    return OK


def _print_summary(bag: Bag) -> None:
    print(f'{bag.folder}: {bag.messages} messages in {bag.duration_ns / NS_PER_S:.1f} s, '
          f'{bag.size / 1e6:.2f} MB, {sum(bag.lost.values())} lost' + (
              f', the oldest {bag.removed} files deleted' if bag.removed else ''))
    if bag.refused:
        print('samples that could not be converted: ' + ', '.join(
            f'{count} of {name}' for name, count in bag.refused.items()))
    if bag.silent and not bag.removed:
        print(f'no message came on {", ".join(bag.silent)}')


def run(argv: Sequence[str]) -> int:
    """
    Record until Ctrl-C.

    :param argv: without the program's name.
    :return: 1 after a failure, 2 for a wrong command line or topic.
    """
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.max_files and not arguments.max_bytes:
        parser.error('--max-files needs --max-bytes, the maximum size of a file')
    try:
        need_mcap('none' if arguments.repair else arguments.compression)
        if arguments.repair is not None:
            from rt_robot_os.recording.repair import repair_all
            done, failed = repair_all(arguments.repair)
            print(*done, sep='\n')
            print(*failed, sep='\n', end='\n' if failed else '', file=sys.stderr)
            return FAILED if failed else OK
        return _record(arguments)
    except RtRobotError as error:
        print(error, file=sys.stderr)
        return FAILED

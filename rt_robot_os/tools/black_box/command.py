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

"""Command line of the program `black_box`: save, read and draw the last activity of a core."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime
import json
from pathlib import Path
import sys

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.base.output_files import check_output
from rt_robot_os.base.output_files import check_picture
from rt_robot_os.base.programs import OK
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.client import connect
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.tools.black_box import chain_text
from rt_robot_os.tools.black_box import chart_of
from rt_robot_os.tools.black_box import default_folder
from rt_robot_os.tools.black_box import DumpFile
from rt_robot_os.tools.black_box import dumps
from rt_robot_os.tools.black_box import file_name
from rt_robot_os.tools.black_box import History
from rt_robot_os.tools.black_box import join
from rt_robot_os.tools.black_box import newest
from rt_robot_os.tools.black_box import perfetto_document
from rt_robot_os.tools.black_box import read_dump
from rt_robot_os.tools.black_box import save_chart
from rt_robot_os.tools.black_box import show
from rt_robot_os.tools.black_box import understand
from rt_robot_os.tools.black_box import window
from rt_robot_os.tools.black_box import write_parts
from rt_robot_os.tools.black_box.chart_drawing import FORMATS

_FILE = 'a dump (default: the newest in the folder)'


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='black_box', description='The last activity of a core: the dumps that it saves after '
        'a fault, or a new one. Times are relative to the dump, so they are negative.')
    parser.add_argument('--folder', type=Path, default=default_folder(),
                        help='folder of the dumps (default %(default)s)')
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')

    one = commands.add_parser('dump', help='request a dump from a running core and save it')
    one.add_argument('output', type=Path, nargs='?', metavar='FILE',
                     help='output file (default: a new file in the folder)')
    add_robot_option(one)
    one.add_argument('--reason', default='asked for by black_box dump', help='stored in the dump')

    commands.add_parser('list', help='list the dumps, the oldest first')

    one = commands.add_parser('show', help='print a dump as text')
    one.add_argument('file', type=Path, nargs='?', metavar='FILE', help=_FILE)
    one.add_argument('--last', type=int, default=40, metavar='N',
                     help='number of last events (default %(default)s)')

    one = commands.add_parser('chain', help='print which jobs released which, from one task to '
                              'another')
    one.add_argument('tasks', metavar='FROM,..,TO', help='tasks or devices on the path, such as '
                     'sink,agent,base')
    one.add_argument('file', type=Path, nargs='?', metavar='FILE', help=_FILE)
    one.add_argument('--last', type=int, default=3, metavar='N',
                     help='number of last chains, besides the longest (default %(default)s)')

    one = commands.add_parser('export', help='convert a dump for other programs')
    one.add_argument('file', type=Path, nargs='?', metavar='FILE', help=_FILE)
    one.add_argument('--perfetto', type=Path, required=True, metavar='OUT.json',
                     help='for ui.perfetto.dev and chrome://tracing')

    one = commands.add_parser('plot', help='draw a dump; requires matplotlib')
    one.add_argument('file', type=Path, nargs='?', metavar='FILE', help=_FILE)
    one.add_argument('output', type=Path, metavar='OUT', help='a .svg or .png')
    one.add_argument('--from', dest='from_s', type=float, metavar='S', help='start, such as -0.05')
    one.add_argument('--to', dest='to_s', type=float, metavar='S', help='end, such as 0')
    one.add_argument('--last', type=float, metavar='MS',
                     help='time before the dump; default without these three: 50 ms around the '
                     'last fault, or before the dump')
    return parser


def _dump(arguments: argparse.Namespace) -> None:
    robot = arguments.robot
    with connect(robot, 'black_box') as client:
        parts = client.request_all('black_box', reason=arguments.reason)
    dump = join(parts)
    path = arguments.output
    if path is None:
        arguments.folder.mkdir(parents=True, exist_ok=True)
        path = arguments.folder / file_name(robot, dump.reason, datetime.now())
    size = write_parts(parts, path)
    print(f'{path}: {len(dump.records)} records, {size} bytes')


def _list(arguments: argparse.Namespace) -> None:
    found = dumps(arguments.folder)
    for path in found:
        try:
            dump = read_dump(path).dump
            print(f'{path}: {dump.reason} ({len(dump.records)} records)')
        except BlackBoxError as error:
            print(error)
    if not found:
        print(f'{arguments.folder} contains no dump')


def _read(arguments: argparse.Namespace) -> tuple[DumpFile, History]:
    path = arguments.file
    if path is None:
        path = newest(arguments.folder)
        print(f'reading {path}', file=sys.stderr)
    found = read_dump(path)
    return found, understand(found.dump, found.kinds)


def _show(arguments: argparse.Namespace) -> None:
    if arguments.last < 0:
        raise BlackBoxError(f'--last {arguments.last}: must be 0 or more events')
    found, history = _read(arguments)
    sys.stdout.write(show(history, arguments.last, found.facts))


def _chain(arguments: argparse.Namespace) -> None:
    names = [name.strip() for name in arguments.tasks.split(',')]
    if len(names) < 2 or not all(names) or arguments.last < 0:
        raise BlackBoxError(f'{arguments.tasks} --last {arguments.last}: name two tasks or more, '
                            'separated by commas, such as sink,base, and 0 chains or more')
    _, history = _read(arguments)
    sys.stdout.write(chain_text(history, names, arguments.last))


def _export(arguments: argparse.Namespace) -> None:
    check_output('--perfetto', arguments.perfetto)
    found, history = _read(arguments)
    document = perfetto_document(history, str(found.facts.get('robot', 'robot')), found.facts)
    try:
        with arguments.perfetto.open('w') as stream:
            json.dump(document, stream, separators=(',', ':'))
    except OSError as error:
        raise BlackBoxError(f'{arguments.perfetto} cannot be written: {error.strerror}') from error
    print(f'{arguments.perfetto}: {len(document["traceEvents"])} events; open it in '
          'https://ui.perfetto.dev')


def _plot(arguments: argparse.Namespace) -> None:
    check_picture('plot', arguments.output, FORMATS)
    _, history = _read(arguments)
    from_ns, to_ns = _window(arguments, history)
    save_chart(chart_of(history, from_ns, to_ns), arguments.output)
    print(f'{arguments.output}: {(from_ns - history.to_ns) / NS_PER_MS:.3f} to '
          f'{(to_ns - history.to_ns) / NS_PER_MS:.3f} ms')


def _window(arguments: argparse.Namespace, history: History) -> tuple[int, int]:
    from_s, to_s, last_ms = arguments.from_s, arguments.to_s, arguments.last
    if last_ms is not None:
        if from_s is not None or to_s is not None or not 0 < last_ms < 1e9:
            raise BlackBoxError(f'--last {last_ms:g}: must be milliseconds above 0, and not with '
                                '--from or --to')
        return max(history.from_ns, history.to_ns - round(last_ms * NS_PER_MS)), history.to_ns
    if from_s is None and to_s is None:
        return window(history)
    first_ns = history.from_ns if from_s is None else _moment(from_s, '--from', history)
    last_ns = history.to_ns if to_s is None else _moment(to_s, '--to', history)
    if first_ns >= last_ns:
        raise BlackBoxError(f'--from {from_s} --to {to_s}: the first must be before the second')
    return first_ns, last_ns


def _moment(time_s: float, option: str, history: History) -> int:
    if not -1e6 < time_s < 1e6:
        raise BlackBoxError(f'{option} {time_s:g}: must be seconds relative to the dump, from '
                            f'{(history.from_ns - history.to_ns) / NS_PER_S:.3f} to 0')
    return history.to_ns + round(time_s * NS_PER_S)


_COMMANDS = {'dump': _dump, 'list': _list, 'show': _show, 'chain': _chain, 'export': _export,
             'plot': _plot}


def run(argv: Sequence[str]) -> int:
    """
    Run one command.

    :param argv: without the program's name.
    :raises RtRobotError: it failed.
    """
    arguments = _parser().parse_args(argv)
    _COMMANDS[arguments.command](arguments)
    return OK

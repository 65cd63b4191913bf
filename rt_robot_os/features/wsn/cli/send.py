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

"""The command `wsn send`: send a command to nodes, and wait for its acknowledgement."""

from __future__ import annotations

import argparse
from contextlib import closing
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.features.wsn.cli.line import open_line
from rt_robot_os.features.wsn.cli.line import SinkLine
from rt_robot_os.features.wsn.cli.options import add_baud
from rt_robot_os.features.wsn.cli.options import add_stack
from rt_robot_os.features.wsn.cli.options import whole_number
from rt_robot_os.features.wsn.packets.commands import ALL
from rt_robot_os.features.wsn.packets.commands import command_packet
from rt_robot_os.features.wsn.packets.commands import parse_command
from rt_robot_os.features.wsn.packets.decode import AUTO
from rt_robot_os.features.wsn.packets.framing import PROTOCOLS
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.serial_link import TRIES
from rt_robot_os.features.wsn.packets.tos_msg import GROUP
from rt_robot_os.features.wsn.packets.tos_msg import MICA
from rt_robot_os.features.wsn.packets.tos_msg import MicaMsg
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg

#: Bytes of payload that a packet may have.
_MOST_DATA: Final = 114
_LISTEN_S: Final = 10.0
_OVER_S: Final = 1.0
_WAIT_S: Final = 0.25

_EPILOG: Final = """
Commands: rate NODE MS, sleep NODE, wake NODE, focus NODE, unfocus NODE; NODE is an address or all.
They are Surge's. Other packets: --am TYPE --data HEX, or --packet HEX unmodified.

  wsn send /dev/ttyUSB0 --stack tinyos1 rate 5 2000
  wsn send sf://localhost:9002 sleep all
  wsn send /dev/ttyUSB0 --stack tinyos2 --am 0x93 --to all --data 0001020000000000

The exit code is 0 when the mote has acknowledged it, or a serial forwarder has accepted it; 1 when
not, or without a port; 2 for a wrong command line.
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser of the program."""
    parser = commands.add_parser(
        'send', allow_abbrev=False, help='send a command to nodes', epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage='wsn send [options] PORT|sf://HOST:PORT [COMMAND ...]')
    parser.add_argument('where', metavar='PORT|sf://HOST:PORT',
                        help='a serial port, or a serial forwarder')
    parser.add_argument('--am', type=whole_number(0, 255), metavar='TYPE', help='AM type')
    parser.add_argument('--data', type=_bytes, default=b'', metavar='HEX', help='payload')
    parser.add_argument('--to', type=_address, default=ALL, metavar='NODE',
                        help='destination of --am (default: all)')
    parser.add_argument('--packet', type=_bytes, metavar='HEX',
                        help='a whole packet without framing')
    parser.add_argument('--group', type=whole_number(0, 255), metavar='N',
                        help=f'AM group (default: {GROUP:#x} under TinyOS 1.x, 0 under 2.x)')
    add_stack(parser)
    add_baud(parser)
    parser.add_argument('--tries', type=whole_number(1, 100), default=TRIES, metavar='N',
                        help='number of transmissions (default: %(default)s)')
    parser.set_defaults(run=run, takes_words=True)


def run(arguments: argparse.Namespace) -> int:
    """
    Send a packet.

    :return: the exit code.
    :raises RtRobotError: it cannot be sent.
    """
    _check(arguments)
    platform = '' if arguments.platform == AUTO else arguments.platform
    where = arguments.where
    with closing(open_line(where, arguments.stack, platform, arguments.baud,
                           arguments.tries)) as line:
        stack = arguments.stack if arguments.stack != AUTO else _stack_of(line, where)
        packet = _packet(arguments, stack, platform)
        line.send(packet, stack)
        end_s = time.monotonic() + arguments.tries * _WAIT_S + _OVER_S
        while not (outcome := line.outcome()) and time.monotonic() < end_s:
            line.wait()
            line.read()
    if outcome == 'acknowledged':
        print(f'acknowledged: {packet.hex()}')
        return OK
    if outcome == 'sent':
        print(f'{where} has accepted it, and does not report whether the mote did: {packet.hex()}')
        return OK
    warn('wsn', f'{where} did not acknowledge {packet.hex()} in {arguments.tries} tries: its '
         'queue is full, or it does not run a base station; check --stack and --baud')
    return FAILED


def _check(arguments: argparse.Namespace) -> None:
    """Check the arguments before anything is opened."""
    given = [bool(arguments.words), arguments.am is not None, arguments.packet is not None]
    if sum(given) != 1:
        raise ConfigError(['give one of: a command such as rate 5 2000, --am TYPE --data HEX, or '
                           '--packet HEX'])
    if arguments.words:
        try:
            parse_command(' '.join(arguments.words))
        except ValueError as error:
            raise ConfigError([str(error)]) from error


def _packet(arguments: argparse.Namespace, stack: str, platform: str) -> bytes:
    if arguments.packet is not None:
        return bytes(arguments.packet)
    is_t2 = stack == TINYOS_2.name
    group = arguments.group if arguments.group is not None else 0 if is_t2 else GROUP
    if arguments.words:
        return command_packet(parse_command(' '.join(arguments.words)), stack, platform, group)
    am_type, data, destination = arguments.am, arguments.data, arguments.to
    if is_t2:
        return SerialAm(destination, 0, am_type, data, group).pack()
    if platform == MICA:
        return MicaMsg(destination, am_type, data, group).pack()
    return TelosMsg(destination, am_type, data, group).pack()


def _stack_of(line: SinkLine, where: str) -> str:
    """Listen until a packet shows the generation of TinyOS."""
    begun_s = time.monotonic()
    has_hinted = False
    while time.monotonic() < begun_s + _LISTEN_S:
        if not has_hinted and time.monotonic() > begun_s + _OVER_S:
            has_hinted = True
            warn('wsn', f'listening to {where} for a packet that shows the generation of TinyOS; '
                 'with --stack this is not needed')
        line.wait()
        for captured in line.read():
            if captured.protocol in PROTOCOLS:
                return PROTOCOLS[captured.protocol].name
        if stack := line.peer_stack():
            return stack
    raise DeviceError(f'{where} sent no packet in {_LISTEN_S:g} s that shows the generation of '
                      'TinyOS: give --stack tinyos1 or --stack tinyos2, and check --baud')


def _bytes(text: str) -> bytes:
    try:
        data = bytes.fromhex(text.removeprefix('0x'))
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text[:40]!r}: must be bytes as hexadecimal digits, '
                                         'such as 0200d007') from None
    if len(data) > _MOST_DATA:
        raise argparse.ArgumentTypeError(f'{len(data)} bytes: at most {_MOST_DATA}')
    return data


def _address(text: str) -> int:
    return ALL if text == 'all' else whole_number(0, ALL)(text)

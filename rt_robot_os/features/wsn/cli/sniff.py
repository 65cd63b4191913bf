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

"""The command `wsn sniff`: decode the packets of a recorded or a live line."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from collections.abc import Iterator
from contextlib import closing
from contextlib import contextmanager
from functools import partial
import json
import signal
import sys
from typing import Any
from typing import Final

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.features.wsn.cli.captured_packet import AIR
from rt_robot_os.features.wsn.cli.captured_packet import CapturedPacket
from rt_robot_os.features.wsn.cli.line import listen
from rt_robot_os.features.wsn.cli.line import open_line
from rt_robot_os.features.wsn.cli.options import add_baud
from rt_robot_os.features.wsn.cli.options import add_stack
from rt_robot_os.features.wsn.cli.options import payloads_of
from rt_robot_os.features.wsn.cli.options import seconds
from rt_robot_os.features.wsn.cli.options import whole_number
from rt_robot_os.features.wsn.cli.record import line_of
from rt_robot_os.features.wsn.cli.record import record_of
from rt_robot_os.features.wsn.cli.recordings import is_recording
from rt_robot_os.features.wsn.cli.recordings import PacketRecording
from rt_robot_os.features.wsn.cli.tally import Tally
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import Frame
from rt_robot_os.features.wsn.packets.framing import FrameReader

_EPILOG: Final = """
The format of a FILE is detected from its content: bytes of a serial line, CSV of frames or air, or
a pcap of 802.15.4, each gzipped or not; - is the standard input. The summary goes to standard
error.

  wsn sniff /dev/ttyUSB0 --baud 57600
  wsn sniff sf://localhost:9002 --json | jq .readings
  wsn sniff night.serial.bin --payload 'soil 0x42 wet:H[%]=soil_moisture_percent,0.1'

The exit code is 0 at the end of the file or of the time and after Ctrl-C; 1 without any packet, or
if the port or the file cannot be read or is gone; 2 for a wrong command line.
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser of the program."""
    parser = commands.add_parser(
        'sniff', allow_abbrev=False, help='decode the packets of a recorded or a live line',
        epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('where', metavar='FILE|PORT|sf://HOST:PORT',
                        help='a recording, a serial port, or a serial forwarder')
    parser.add_argument('--json', action='store_true', help='write one JSON object a packet')
    add_stack(parser)
    parser.add_argument('--group', type=whole_number(0, 255), metavar='N',
                        help='AM group of the network; packets of others are marked')
    add_baud(parser)
    parser.add_argument('--payload', action='append', default=[], metavar='TEXT|FILE.yaml',
                        help='a user-defined payload, or a file with several; may be repeated')
    parser.add_argument('--seconds', type=seconds, default=0.0, metavar='S',
                        help='stop reading a live line after S seconds')
    parser.add_argument('--quiet', action='store_true', help='write only the summary')
    parser.set_defaults(run=run)


class Sniffer:
    """
    Decodes and writes the received packets.

    :param decoder: of the packets.
    :param reader: of the frames, with the counters of rejected ones.
    """

    def __init__(self, arguments: argparse.Namespace, decoder: PacketDecoder,
                 reader: FrameReader) -> None:
        self._arguments = arguments
        self._decoder = decoder
        self._reader = reader
        self._tally = Tally()

    @property
    def packets(self) -> int:
        """Return the number of decoded packets."""
        return self._decoder.packets

    def run(self, heard: Iterable[CapturedPacket], flush: bool) -> None:
        """Write each packet as a line."""
        for each in heard:
            packet = self._decode(each)
            again = self._tally.take(packet, each.time_s)
            if self._arguments.quiet:
                continue
            record = record_of(each, packet, again)
            print(json.dumps(record) if self._arguments.json else line_of(record), flush=flush)

    def summary(self) -> None:
        """Write the summary to standard error."""
        sys.stdout.flush()
        for line in self._tally.lines(self._decoder, self._reader):
            print(line, file=sys.stderr)

    def _decode(self, heard: CapturedPacket) -> Packet:
        if heard.medium == AIR:
            return self._decoder.decode_air(heard.data)
        return self._decoder.decode_frame(
            Frame(heard.protocol, heard.token, heard.data, 0, 0))


def run(arguments: argparse.Namespace) -> int:
    """
    Decode to the end, or until Ctrl-C.

    :return: the exit code.
    :raises RtRobotError: the source cannot be read.
    """
    decoder = PacketDecoder(arguments.stack, payloads_of(arguments.payload), arguments.platform,
                            arguments.group)
    if is_recording(arguments.where):
        with closing(PacketRecording(arguments.where)) as recording:
            sniffer = Sniffer(arguments, decoder, recording.reader)
            code = _sniff(sniffer, recording, False)
            if recording.bad_lines:
                warn('wsn', f'{arguments.where}: {recording.bad_lines} lines contain no frame')
            if not decoder.packets and recording.reader.rejected_bytes:
                warn('wsn', f"{arguments.where} contains no frame of TinyOS' serial line: is it a "
                     'recording of another protocol, or at a wrong baud rate?')
            return code
    platform = '' if arguments.platform == 'auto' else arguments.platform
    with _ended_like_ctrl_c(), closing(open_line(
            arguments.where, arguments.stack, platform, arguments.baud)) as line:
        sniffer = Sniffer(arguments, decoder, line.reader)
        return _sniff(sniffer, listen(line, arguments.seconds, partial(warn, 'wsn')), True)


def _sniff(sniffer: Sniffer, heard: Iterable[CapturedPacket], flush: bool) -> int:
    code, interrupted = OK, False
    try:
        sniffer.run(heard, flush)
    except KeyboardInterrupt:
        interrupted = True
    except BrokenPipeError:
        raise  # the reader of the pipe is gone: no summary either
    except RtRobotError as error:
        # A driver would open the port again.
        warn('wsn', str(error).partition('; it will be')[0])
        code = FAILED
    sniffer.summary()
    return code if sniffer.packets or interrupted else FAILED


@contextmanager
def _ended_like_ctrl_c() -> Iterator[None]:
    """Handle SIGTERM like Ctrl-C: stop reading, and write the summary."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)

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
The child process that writes the dumps of a core.

Compressing and writing may block for any time, and a native call cannot be preempted: the core
only sends small parts, one datagram each, and continues. A dump that was received completely is
written even if the core has died meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
import json
import marshal
from pathlib import Path
import signal
import socket
import sys
from typing import Any

from rt_robot_os.base.errors import BlackBoxError

DATAGRAM_BYTES_MAXIMUM = 1 << 17
DUMPS_AT_ONCE = 3


def _parts(received: list[bytes]) -> Iterator[dict[str, Any]]:
    for number, packet in enumerate(received):
        part: dict[str, Any] = marshal.loads(packet)[1]
        if not number:
            part['facts'] = {**part['facts'], 'host': socket.gethostname()}
        yield part


def write(received: list[bytes], folder: Path, robot: str) -> dict[str, Any]:
    """
    Write a dump whose parts were all received.

    :return: the answer to the core: a ``text``, and whether it is an ``error``.
    """
    # Late: most robots write no dump, and each start would wait for the import.
    from rt_robot_os.core.dumps.folder import keep
    from rt_robot_os.core.dumps.folder import KEPT
    reason = marshal.loads(received[0])[1]['reason']
    try:
        path, size, deleted = keep(_parts(received), folder, robot, reason)
    except BlackBoxError as error:
        return {'error': True, 'text': f'not saved: {error}'}
    gone = (f'; of more than {KEPT} dumps the oldest were deleted: '
            f'{", ".join(old.name for old in deleted)}') if deleted else ''
    return {'error': False, 'text': f'saved as {path} ({size} bytes){gone}'}


def serve(connection: socket.socket, folder: Path, robot: str) -> None:
    """Write dumps until the core closes its end; parts of several dumps may be interleaved."""
    received: dict[int, list[bytes]] = {}
    while True:
        try:
            packet = connection.recv(DATAGRAM_BYTES_MAXIMUM)
        except ConnectionResetError:
            continue  # reported once, before the last parts: the core has not read all answers
        if not packet:
            return
        number, part = marshal.loads(packet)
        received.setdefault(number, []).append(packet)
        if len(received) > DUMPS_AT_ONCE:  # the oldest is incomplete: its sender failed
            del received[min(received)]
        if 'end' in part:
            answer = write(received.pop(number), folder, robot)
            try:
                connection.send(json.dumps(answer).encode())
            except OSError:
                print(f'{datetime.now():%H:%M:%S} black box: {answer["text"]}', file=sys.stderr)


def main() -> int:
    """Serve the socket whose number is the first argument; then folder and robot."""
    # Ctrl-C and the end of a session stop the core, whose last dump this process still writes.
    for signo in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(signo, signal.SIG_IGN)
    with socket.socket(fileno=int(sys.argv[1])) as connection:
        serve(connection, Path(sys.argv[2]), sys.argv[3])
    return 0


if __name__ == '__main__':
    sys.exit(main())

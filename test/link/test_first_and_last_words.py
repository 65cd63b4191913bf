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
What was said while the other side did not listen is not lost.

Linux tells the end of a peer that has not read everything ahead of what that peer has sent before.
"""

from __future__ import annotations

import json
import marshal
from pathlib import Path
import socket
import tempfile
import threading
from typing import Any

import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.core.dumps import writer_process
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.reader import Reader


def test_reports_that_come_with_the_greeting_are_handed_on_in_order() -> None:
    with tempfile.TemporaryDirectory(prefix='rte') as name, \
            socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        path = Path(name) / 'core.sock'
        listener.bind(str(path))
        listener.listen()

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                number = json.loads(connection.recv(10_000)[HEADER_BYTES:])['id']
                connection.send(encode_json(PacketKind.REPORT, {'text': 'before'}))
                connection.send(encode_json(PacketKind.REPLY, {'topics': []}, seq=number))
                connection.send(encode_json(PacketKind.REPORT, {'text': 'after'}))
                connection.recv(1)  # until the client goes

        server = threading.Thread(target=serve, daemon=True)
        server.start()
        with LinkClient(path) as client:
            said: list[dict[str, Any]] = []
            client.on_report = said.append
            for _ in range(30):
                if len(said) < 2:
                    client.pump(1.0)
        assert [report['text'] for report in said] == ['before', 'after']
        server.join(10.0)


def test_the_last_words_of_a_core_that_has_not_read_everything_arrive() -> None:
    core, ours = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    reader = Reader(ours)
    said: list[dict[str, Any]] = []
    reader.on_report = said.append
    core.send(encode_json(PacketKind.REPORT, {'text': 'last but one'}))
    core.send(encode_json(PacketKind.REPORT, {'text': 'last'}))
    ours.send(b'a beat that the core does not read any more')
    core.close()
    with pytest.raises(LinkError, match='closed the connection'):
        while True:
            reader.pump(1.0)
    reader.close()
    assert [report['text'] for report in said] == ['last but one', 'last']


def test_the_writer_of_black_boxes_outlives_an_answer_that_nobody_reads(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[int] = []
    monkeypatch.setattr(writer_process, 'write', lambda received, folder, robot: written.append(
        len(received)) or {'error': False, 'text': 'saved'})
    core, ours = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for number in (1, 2):
        core.send(marshal.dumps((number, {'end': True})))
    ours.send(b'an answer that the core does not read any more')
    core.close()
    with ours:
        writer_process.serve(ours, tmp_path, 'robot')
    assert written == [1, 1]

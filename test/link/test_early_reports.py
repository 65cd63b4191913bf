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

"""What a core says while a client is still being greeted is not lost."""

from __future__ import annotations

import json
from pathlib import Path
import socket
import tempfile
import threading
from typing import Any

from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import Kind


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
                connection.send(encode_json(Kind.REPORT, {'text': 'before'}))
                connection.send(encode_json(Kind.REPLY, {'topics': []}, seq=number))
                connection.send(encode_json(Kind.REPORT, {'text': 'after'}))
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

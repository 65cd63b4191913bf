#!/usr/bin/env python3
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
How soon a gateway is heard again after the network is back.

A gateway and a server are in a network namespace each. What connects them drops everything without
a word for some seconds (frames go to an address that nobody has), or is down. Ten records a second
are made meanwhile. Needs root. Prints JSON: seconds from the return of the network until the
server has stored a record, and whether each is there.

    scripts/outage_reconnect.py --seconds 0.5,2,4,10,30
"""

from __future__ import annotations

import argparse
import asyncio
from contextlib import suppress
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from rt_robot_os.gateway.gateway import Gateway  # noqa: E402
from rt_robot_os.gateway.part import Record  # noqa: E402
from rt_robot_os.gateway.settings import GatewaySettings  # noqa: E402
from rt_robot_os.messages.uplink.importance import Importance  # noqa: E402
from rt_robot_os.messages.uplink.messages import decode  # noqa: E402
from rt_robot_os.messages.uplink.messages import encode  # noqa: E402
from websockets.asyncio.server import serve  # noqa: E402
from websockets.asyncio.server import ServerConnection  # noqa: E402
from websockets.exceptions import ConnectionClosed  # noqa: E402

PORT = 18443
EVERY_S = 0.1
NET = '10.99.77'
NOBODY = '02:00:00:00:00:99'
WAYS = ('drops everything', 'is down')


class Network:
    """Two namespaces with a cable between them."""

    def __init__(self) -> None:
        """Name them."""
        self.robot, self.server = (f'out{os.getpid()}{end}' for end in 'rs')

    def run(self, space: str, *words: str) -> None:
        """Run a command in a namespace."""
        subprocess.run(['ip', 'netns', 'exec', space, *words], check=True)

    def make(self) -> None:
        """Make them."""
        for space in (self.robot, self.server):
            subprocess.run(['ip', 'netns', 'add', space], check=True)
        self.run(self.robot, 'ip', 'link', 'add', 'cable', 'type', 'veth', 'peer', 'name', 'cable',
                 'netns', self.server)
        for number, space in enumerate((self.robot, self.server), 1):
            self.run(space, 'ip', 'addr', 'add', f'{NET}.{number}/24', 'dev', 'cable')
            self.run(space, 'ip', 'link', 'set', 'cable', 'up')

    def take(self, way: str) -> None:
        """Take the network away."""
        if way == 'is down':
            self.run(self.robot, 'ip', 'link', 'set', 'cable', 'down')
            return
        for space, other in ((self.robot, 2), (self.server, 1)):
            self.run(space, 'ip', 'neigh', 'replace', f'{NET}.{other}', 'lladdr', NOBODY, 'dev',
                     'cable', 'nud', 'permanent')

    def give(self, way: str) -> None:
        """Give it back."""
        if way == 'is down':
            self.run(self.robot, 'ip', 'link', 'set', 'cable', 'up')
            return
        for space, other in ((self.robot, 2), (self.server, 1)):
            self.run(space, 'ip', 'neigh', 'del', f'{NET}.{other}', 'dev', 'cable')

    def end(self) -> None:
        """Delete them."""
        for space in (self.robot, self.server):
            subprocess.run(['ip', 'netns', 'del', space], check=False)


async def talk(socket: ServerConnection) -> None:
    """Serve one connection: take everything."""
    with suppress(ConnectionClosed):
        async for text in socket:
            if isinstance(text, bytes):
                continue
            message = decode(text)
            if message['kind'] == 'hello':
                await socket.send(encode('welcome', {'utc_ns': time.time_ns()}))
            elif message['kind'] == 'records':
                await socket.send(encode('stored', {'batch': message['batch']}))


async def serving() -> None:
    """Serve until killed."""
    async with serve(talk, f'{NET}.2', PORT, compression=None, ping_interval=None):
        await asyncio.Event().wait()


def measure(network: Network, gateway: Gateway, way: str, seconds: float) -> dict[str, Any]:
    """Take the network away for some seconds."""
    while not gateway.server.connected:
        time.sleep(0.02)
    time.sleep(1.0)
    network.take(way)
    gone_s = time.monotonic()
    while time.monotonic() < gone_s + seconds:
        keep(gateway, way)
        time.sleep(EVERY_S)
    before = gateway.keeper.dispatch.stored
    network.give(way)
    back_s = time.monotonic()
    while gateway.keeper.dispatch.stored == before and time.monotonic() < back_s + 60.0:
        keep(gateway, way)
        time.sleep(EVERY_S / 10)
    heard_s = time.monotonic() - back_s
    deadline_s = time.monotonic() + 60.0
    while gateway.keeper.dispatch.stored < gateway.keeper.kept and time.monotonic() < deadline_s:
        time.sleep(0.02)
    return {'network': way, 'away_s': seconds, 'heard_after_s': round(heard_s, 2),
            'kept': gateway.keeper.kept, 'there': gateway.keeper.dispatch.stored}


def keep(gateway: Gateway, way: str) -> None:
    """Make a record."""
    gateway.keeper.keep(Record(Importance.EVENT, 'log', {'text': way}, time.time_ns()))


def inside(away_s: list[float], network: Network) -> int:
    """Measure, within the robot's namespace."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        token = Path(folder) / 'token'
        token.write_text('token-of-a-measurement')
        token.chmod(0o600)
        settings = GatewaySettings(server=f'ws://{NET}.2:{PORT}', token_file=str(token))
        gateway = Gateway(settings, 'robot', Path(folder) / 'none.sock', Path(folder) / 'files',
                          lambda text: None)
        ended = threading.Event()
        thread = threading.Thread(target=lambda: asyncio.run(gateway.run(ended.is_set)))
        thread.start()
        try:
            for way in WAYS:
                for seconds in away_s:
                    found.append(measure(network, gateway, way, seconds))
        finally:
            ended.set()
            thread.join()
    worst_s = max(each['heard_after_s'] for each in found)
    complete = all(each['kept'] == each['there'] for each in found)
    print(json.dumps({'runs': found, 'worst_s': worst_s, 'each_there': complete,
                      'met': worst_s <= 2.0 and complete}, indent=2))
    return 0 if worst_s <= 2.0 and complete else 1


def main() -> int:
    """Make namespaces, and measure in them."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().split('\n')[0])
    parser.add_argument('--seconds', default='0.5,2,4,10,30', help='how long it is away')
    parser.add_argument('--inside', default='', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    network = Network()
    if arguments.inside == 'server':
        asyncio.run(serving())
    if arguments.inside:
        network.robot, network.server = arguments.inside.split(',')
        return inside([float(each) for each in arguments.seconds.split(',')], network)
    if os.geteuid() != 0:
        print('outage_reconnect: needs root, for network namespaces', file=sys.stderr)
        return 2
    own = [sys.executable, __file__, '--inside']
    try:
        network.make()
        server = subprocess.Popen(['ip', 'netns', 'exec', network.server, *own, 'server'])
        try:
            return subprocess.run(
                ['ip', 'netns', 'exec', network.robot, *own, f'{network.robot},{network.server}',
                 '--seconds', arguments.seconds], check=False).returncode
        finally:
            server.kill()
            server.wait()
    finally:
        network.end()


if __name__ == '__main__':
    sys.exit(main())

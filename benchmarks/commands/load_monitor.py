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
Put load on a server of the monitor, and print what it did as JSON.

    ./scripts/bench load_monitor [--scenes fan_out,stopped,alarms,fleet,connections]
        [--seconds 20] [--clients 20] [--videos 5] [--backlog 1000000] [--database URL] [--runs 3]

The server is a process of its own with a database in a folder that is removed at the end; robots
and browsers are connections of this process. Ages are from the robot's stamp to this process's
having read the message. ``server_cpu`` is the server's processor time over the time that passed.

* ``fan_out``: a robot with 30 signals at 20 Hz, browsers that watch all of them, others that look
  at a camera with 10 pictures of 40 KB a second.
* ``stopped``: the same, with one browser that reads nothing; ages are those of the others.
* ``alarms``: the same browsers; a second robot brings what it kept while the network was down.
* ``connections``: 10,000 connections, each with half a request, while ``/healthz`` is asked for.
* ``fleet``: 50 robots, each with 60 observations a second, in batches of a second.

With several runs each figure is the median.
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Awaitable
from collections.abc import Callable
from collections.abc import Coroutine
from contextlib import AsyncExitStack
from contextlib import suppress
import json
import os
from pathlib import Path
import platform
import re
import resource
import secrets
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

from rt_robot_os.messages.uplink.frames import encode_frame
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.server import DATABASE
from rt_robot_os.monitor.store.store import Store
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect

ROOT = Path(__file__).resolve().parents[2]
SIGNALS = 30
LIVE_HZ = 20.0
PICTURE_HZ = 10.0
PICTURE = b'\xff\xd8\xff\xe0' + secrets.token_bytes(40_000)
ROBOTS = 50
ROWS_A_SECOND = 60
ALARM_EVERY_S = 0.1
BATCH = 500
IN_FLIGHT = 4


class Server:
    """A server in a process of its own, with an operator and robots that may come in."""

    def __init__(self, folder: Path, database: str, robots: int) -> None:
        """Start it."""
        folder.mkdir()
        url = database or str(folder / DATABASE)
        store = Store.open(url)
        accounts = Accounts.open(store.engine, folder)
        mark = secrets.token_hex(3)
        self.tokens = [accounts.robots.add(f'robot-{mark}-{each}')[1] for each in range(robots)]
        user = accounts.users.add(f'load-{mark}', Role.OWNER, ('*',), 'load', 'no password')
        _, self.secret = accounts.sessions.begin(user.id, '127.0.0.1', 'load')
        accounts.close()
        store.close()
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'rt_robot_os.monitor.program', '--port', '0', '--folder',
             str(folder), '--database', url], stderr=subprocess.PIPE, text=True,
            env={**os.environ, 'PYTHONPATH': str(ROOT)})
        assert self.process.stderr is not None
        found = re.search(r'http://(\S+)', self.process.stderr.readline())
        assert found is not None, self.process.stderr.read()
        self.address = found[1]

    def cpu_s(self) -> float:
        """Return the processor time that it has taken."""
        fields = Path(f'/proc/{self.process.pid}/stat').read_text().rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def memory_mb(self) -> float:
        """Return its resident memory."""
        pages = int(Path(f'/proc/{self.process.pid}/statm').read_text().split()[1])
        return pages * os.sysconf('SC_PAGE_SIZE') / 1e6

    def end(self) -> None:
        """End it."""
        self.process.terminate()
        self.process.wait(20)

    async def robot(self, stack: AsyncExitStack, number: int, path: str = '/robot/state'
                    ) -> ClientConnection:
        """Connect a robot."""
        found = await stack.enter_async_context(connect(
            f'ws://{self.address}{path}', compression=None, proxy=None, max_size=None,
            additional_headers={'Authorization': f'Bearer {self.tokens[number]}'}))
        await found.send(encode('hello', {
            'version': 1, 'boot': secrets.token_hex(8), 'utc_ns': time.time_ns(),
            'name': f'robot {number}', 'people': [f'person{number}'], 'cameras': ['hall'],
            'capabilities': [], 'nodes': [], 'map': None, 'limits': {}}))
        return found

    async def browser(self, stack: AsyncExitStack, path: str = '/live') -> ClientConnection:
        """Connect a browser."""
        return await stack.enter_async_context(connect(
            f'ws://{self.address}{path}', compression=None, proxy=None, max_size=None,
            additional_headers={'Cookie': f'session={self.secret}',
                                'Origin': f'http://{self.address}'}))


class Ages:
    """The ages of what came, in ms."""

    def __init__(self) -> None:
        """Begin without any."""
        self.ms: list[float] = []
        self.counts = False

    def note(self, utc_ns: int) -> None:
        """Note one, once it counts."""
        if self.counts:
            self.ms.append((time.time_ns() - utc_ns) / 1e6)

    def result(self, name: str) -> dict[str, Any]:
        """Return them as figures."""
        if len(self.ms) < 2:
            return {f'{name}_n': len(self.ms)}
        parts = statistics.quantiles(self.ms, n=100)
        return {f'{name}_n': len(self.ms), f'{name}_p50_ms': round(parts[49], 1),
                f'{name}_p95_ms': round(parts[94], 1), f'{name}_p99_ms': round(parts[98], 1)}


class Scene:
    """Robots and browsers of one measurement."""

    def __init__(self, server: Server, stack: AsyncExitStack) -> None:
        """Begin without any."""
        self.server = server
        self.stack = stack
        self.signals, self.alarms, self.pictures = Ages(), Ages(), Ages()
        self.tasks: list[asyncio.Task[None]] = []
        self.alarm_ns: dict[str, int] = {}
        self.stored_rows = 0
        self.stored_ms: list[float] = []

    def start(self, what: Coroutine[Any, Any, None]) -> None:
        """Run something until the end."""
        self.tasks.append(asyncio.ensure_future(what))

    async def watch(self, reads: bool = True) -> None:
        """Add a browser that watches all signals of all robots."""
        page = await self.server.browser(self.stack)
        await page.send(json.dumps({'kind': 'watch', 'robot': None, 'signals': ['*'],
                                    'rate_hz': LIVE_HZ}))
        if reads:
            self.start(self._read(page))
        else:
            page.transport.pause_reading()

    async def _read(self, page: ClientConnection) -> None:
        async for text in page:
            message = json.loads(text)
            if message['kind'] == 'signals':
                self.signals.note(message['utc_ns'])
            elif message['kind'] == 'alarm' and message['id'] in self.alarm_ns:
                self.alarms.note(self.alarm_ns[message['id']])

    async def look(self, robot: str) -> None:
        """Add a browser that looks at a camera."""
        page = await self.server.browser(self.stack, '/camera')
        await page.send(encode('look', {'robot': robot, 'camera': 'hall', 'rate_hz': PICTURE_HZ}))

        async def read() -> None:
            async for frame in page:
                if isinstance(frame, bytes):
                    head = json.loads(frame[4:4 + int.from_bytes(frame[:4], 'little')])
                    self.pictures.note(head['utc_ns'])
                    await page.send(encode('taken', {'robot': robot, 'camera': 'hall',
                                                     'n': head['n']}))
        self.start(read())

    async def live_robot(self, number: int = 0) -> ClientConnection:
        """Add a robot with live signals, as fast as they are taken."""
        robot = await self.server.robot(self.stack, number)
        taken = asyncio.Semaphore(2)

        async def read() -> None:
            async for text in robot:
                if json.loads(text)['kind'] == 'taken':
                    taken.release()

        async def send() -> None:
            due, n = time.monotonic(), 0
            while True:
                due += 1 / LIVE_HZ
                await asyncio.sleep(max(0.0, due - time.monotonic()))
                await taken.acquire()
                n += 1
                now_ns = time.time_ns()
                await robot.send(encode('live', {'n': n, 'utc_ns': now_ns, 'signals': {
                    f'health/person{number}/sign{each}': [now_ns, n + each / 7]
                    for each in range(SIGNALS)}}))
        self.start(read())
        self.start(send())
        return robot

    async def camera(self, number: int = 0) -> None:
        """Add the camera of a robot."""
        media = await self.server.robot(self.stack, number, '/robot/media')
        wanted = asyncio.Event()

        async def read() -> None:
            async for text in media:
                message = json.loads(text)
                if message['kind'] == 'want' and message['cameras']:
                    wanted.set()

        async def send() -> None:
            await wanted.wait()
            due, n = time.monotonic(), 0
            while True:
                due += 1 / PICTURE_HZ
                await asyncio.sleep(max(0.0, due - time.monotonic()))
                n += 1
                await media.send(encode_frame('picture', {
                    'camera': 'hall', 'n': n, 'utc_ns': time.time_ns(), 'age_ns': 0,
                    'width': 640, 'height': 480}, PICTURE))
        self.start(read())
        self.start(send())

    async def alarm(self, robot: ClientConnection) -> None:
        """Raise alarms, each of which is over at once."""
        for number in range(1, 1 << 30):
            await asyncio.sleep(ALARM_EVERY_S)
            name = f'a{number}'
            self.alarm_ns[name] = now_ns = time.time_ns()
            for state in ('raised', 'resolved'):
                await robot.send(encode('records', {'batch': f'{name}{state}', 'records': [{
                    'seq': 2 * number + (state == 'resolved'), 'importance': 0,
                    'type': 'alarm_event', 'utc_ns': now_ns, 'content': {
                        'seq': 2 * number + (state == 'resolved'), 'alarm': name, 'event': state,
                        'state': state, 'level': 'critical', 'subject': 'person0',
                        'kinds': ['fall'], 'text': 'a fall'}}], 'lost': {}}))
                if state == 'raised':
                    await asyncio.sleep(ALARM_EVERY_S)
                    self.alarm_ns.pop(name)

    async def keep(self, number: int, rows: int, batch: int, every_s: float) -> None:
        """Add a robot that sends rows which must be stored; ``every_s`` 0: as fast as it can."""
        robot = await self.server.robot(self.stack, number)
        sent: dict[int, float] = {}
        free = asyncio.Semaphore(IN_FLIGHT)

        async def read() -> None:
            async for text in robot:
                message = json.loads(text)
                if message['kind'] == 'stored':
                    self.stored_ms.append((time.monotonic() - sent.pop(message['batch'])) * 1e3)
                    self.stored_rows += batch
                    free.release()
                elif message['kind'] == 'refused':
                    raise RuntimeError(message['text'])

        async def send() -> None:
            due = time.monotonic() + every_s * (number % 17) / 17
            begin_ns = time.time_ns() - rows * 1_000_000_000
            for first in range(0, rows, batch):
                due += every_s
                await asyncio.sleep(max(0.0, due - time.monotonic()))
                await free.acquire()
                text = encode('records', {'batch': first, 'lost': {}, 'records': [{
                    'seq': seq, 'importance': 3, 'type': 'observation',
                    'utc_ns': begin_ns + seq * 1_000_000_000, 'content': {
                        'person': f'person{number}', 'sign': f'sign{seq % 6}', 'value': seq % 90,
                        'quality': 'good', 'source': 'belt'}}
                    for seq in range(first, first + batch)]})
                sent[first] = time.monotonic()
                await robot.send(text)
        self.start(read())
        self.start(send())

    async def measure(self, seconds: float) -> dict[str, Any]:
        """Let it run, and return what was seen; the first two seconds do not count."""
        await asyncio.sleep(2)
        for each in (self.signals, self.alarms, self.pictures):
            each.counts = True
        self.stored_rows, self.stored_ms = 0, []
        began, cpu = time.monotonic(), self.server.cpu_s()
        own = time.process_time()
        await asyncio.sleep(seconds)
        passed = time.monotonic() - began
        found: dict[str, Any] = {
            'server_cpu': round((self.server.cpu_s() - cpu) / passed, 3),
            'load_cpu': round((time.process_time() - own) / passed, 3),
            'server_mb': round(self.server.memory_mb(), 1)}
        for name, ages in (('signal', self.signals), ('alarm', self.alarms),
                           ('picture', self.pictures)):
            if ages.ms:
                found |= ages.result(name)
        if self.stored_ms:
            found['stored_rows_s'] = round(self.stored_rows / passed)
            found['stored_p95_ms'] = round(sorted(self.stored_ms)[
                int(0.95 * len(self.stored_ms))], 1)
        for task in self.tasks:
            if task.done() and not task.cancelled() and task.exception() is not None:
                raise RuntimeError('a part of the load has ended') from task.exception()
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)
        return found


async def fan_out(scene: Scene, arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure browsers that watch a robot."""
    await _browsers(scene, arguments)
    return await scene.measure(arguments.seconds)


async def stopped(scene: Scene, arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure browsers beside one that reads nothing."""
    await scene.watch(reads=False)
    await _browsers(scene, arguments)
    return await scene.measure(arguments.seconds)


async def alarms(scene: Scene, arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure alarms beside what another robot has kept."""
    robot = await _browsers(scene, arguments)
    await scene.keep(1, arguments.backlog, BATCH, 0.0)
    scene.start(scene.alarm(robot))
    return await scene.measure(arguments.seconds)


async def fleet(scene: Scene, arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure many robots."""
    for number in range(ROBOTS):
        await scene.keep(number, round(ROWS_A_SECOND * (arguments.seconds + 60)), ROWS_A_SECOND,
                         1.0)
    return await scene.measure(arguments.seconds)


async def connections(scene: Scene, arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure how long an answer takes beside connections that never ask for anything."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    host, _, port = scene.server.address.partition(':')

    async def answer() -> float:
        began = time.monotonic()
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(b'GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n')
        if b' 200 ' not in await reader.readline():
            raise RuntimeError('/healthz did not answer')
        writer.close()
        return (time.monotonic() - began) * 1e3

    idle, took = [], []
    cpu, begin = scene.server.cpu_s(), time.monotonic()
    for number in range(arguments.connections):
        idle.append(await asyncio.open_connection(host, int(port)))
        idle[-1][1].write(b'GET /healthz HTTP/1.1\r\nHost: local')
        if number % 100 == 0:
            took.append(await answer())
    passed = time.monotonic() - begin
    for _ in range(50):
        took.append(await answer())
    found = {'connections': len(idle), 'opened_s': round(passed, 2),
             'healthz_p50_ms': round(statistics.median(took), 1),
             'healthz_worst_ms': round(max(took), 1),
             'server_cpu_s': round(scene.server.cpu_s() - cpu, 2),
             'server_mb': round(scene.server.memory_mb(), 1)}
    for _, writer in idle:
        writer.transport.abort()
    return found


async def _browsers(scene: Scene, arguments: argparse.Namespace) -> ClientConnection:
    robot = await scene.live_robot()
    if arguments.videos:
        await scene.camera()
        overview = await scene.server.browser(scene.stack)
        state = json.loads(await overview.recv())
        await overview.close()
        for _ in range(arguments.videos):
            await scene.look(next(each['id'] for each in state['robots']))
    for _ in range(arguments.clients):
        await scene.watch()
    return robot


SCENES: dict[str, Callable[[Scene, argparse.Namespace], Awaitable[dict[str, Any]]]] = {
    'fan_out': fan_out, 'stopped': stopped, 'alarms': alarms, 'fleet': fleet,
    'connections': connections}


async def run(name: str, arguments: argparse.Namespace) -> dict[str, Any]:
    """Run a scene with a server of its own."""
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder) / 'monitor', arguments.database, ROBOTS)
        try:
            async with AsyncExitStack() as stack:
                found = await SCENES[name](Scene(server, stack), arguments)
                with suppress(Exception):  # a browser that has stopped closes for ever
                    await asyncio.wait_for(stack.aclose(), 3)
                return found
        finally:
            server.end()


def medians(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the median of each figure."""
    return {key: statistics.median(each[key] for each in runs if key in each)
            for key in runs[0]}


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--scenes', default=','.join(SCENES))
    parser.add_argument('--seconds', type=float, default=20.0)
    parser.add_argument('--clients', type=int, default=20)
    parser.add_argument('--videos', type=int, default=5)
    parser.add_argument('--backlog', type=int, default=1_000_000, help='rows')
    parser.add_argument('--connections', type=int, default=10_000)
    parser.add_argument('--database', default='', help='URL; SQLite when absent')
    parser.add_argument('--runs', type=int, default=1)
    arguments = parser.parse_args()
    found: dict[str, Any] = {
        'python': platform.python_version(), 'cpus': os.cpu_count(),
        'load_before': os.getloadavg()[0], 'seconds': arguments.seconds, 'runs': arguments.runs,
        'clients': arguments.clients, 'videos': arguments.videos,
        'database': arguments.database.partition(':')[0] or 'sqlite'}
    for name in arguments.scenes.split(','):
        found[name] = medians([asyncio.run(run(name, arguments)) for _ in range(arguments.runs)])
    print(json.dumps(found, indent=2))


if __name__ == '__main__':
    main()

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

"""How punctual the core is while a gateway carries to a server that others watch."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Mapping
import json
from pathlib import Path
import time
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.tools.bench.cases.mirror.subjects import settings
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps

_CARRIER = f'{__name__}:carrier'
_SERVER = f'{__name__}:server'
_FLOAT = 'std_msgs/msg/Float64'
_SCAN = 'sensor_msgs/msg/LaserScan'
_TOKEN = 'token-of-a-measurement'
_SIGNALS_HZ = 20.0
_SCAN_HZ = 10.0


def core(harness: Harness) -> Measurement:
    """Run a 1 kHz task beside tasks that publish what a gateway reads, if there is one."""
    a = harness.arguments
    path = socket_path('bench')
    names = [f'health/anna/sign{number}' for number in range(a['signals'])]
    tested = Core(settings({
        **{name: (_FLOAT, {}) for name in names},
        'scan': (_SCAN, {'header.frame_id': 'laser', 'ranges': [1.0] * 682, 'intensities': 0})}),
        path)
    stamps = Stamps(2 * (a['warmup_ns'] + a['measure_ns']) // a['period_ns'] + 1000)
    tested.kernel.add_task('bench/probe', stamps.stamp, priority=90,
                           rate_hz=NS_PER_S / a['period_ns'])
    publishers = [tested.bus.publisher(name) for name in names]
    scan = tested.bus.publisher('scan')

    def publish() -> None:
        for number, each in enumerate(publishers):
            each.msg.data = float(number + time.monotonic_ns() % 1000)
            each.publish()

    tested.kernel.add_task('bench/signals', publish, priority=40, rate_hz=_SIGNALS_HZ)
    tested.kernel.add_task('bench/scan', lambda: scan.publish(), priority=41, rate_hz=_SCAN_HZ)
    if not a['gateway']:
        return _run(harness, tested, stamps)
    port_file = harness.folder / 'port'
    with harness.helper(_SERVER, {'port': str(port_file), 'viewers': a['viewers']},
                        same_cpu=False):
        with harness.helper(_CARRIER, {
                'path': str(path), 'port': str(port_file), 'folder': str(harness.folder)},
                same_cpu=False):
            return _run(harness, tested, stamps)


def _run(harness: Harness, tested: Core, stamps: Stamps) -> Measurement:
    a = harness.arguments
    sent = [0]

    def count() -> None:
        sent[0] = sum(m.sent for c in tested.link.statistics() for m in c.mirrors)

    before: list[int] = []

    def watch() -> None:
        count()
        if not before and time.monotonic_ns() >= tested.kernel.start_ns + a['warmup_ns']:
            before.append(sent[0])

    tested.kernel.add_task('bench/watch', watch, priority=1, rate_hz=10.0)
    harness.prepare(freeze=True)
    cpu_ns, wall_ns = time.process_time_ns(), time.monotonic_ns()
    tested.run(a['warmup_ns'] + a['measure_ns'])
    cpu_ns, wall_ns = time.process_time_ns() - cpu_ns, time.monotonic_ns() - wall_ns
    carried = sent[0] - (before[0] if before else 0)
    if a['gateway'] and not carried:
        raise RuntimeError('nothing was carried')
    start_ns = tested.kernel.start_ns
    return Measurement({'starts': stamps.taken()}, {
        'phase_ns': start_ns, 'begin_ns': start_ns + a['warmup_ns'],
        'measure_ns': a['measure_ns'], 'cpu_percent': 100.0 * cpu_ns / wall_ns,
        'sent': carried})


def carrier(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be the gateway."""
    from rt_robot_os.gateway.gateway import Gateway
    from rt_robot_os.gateway.settings import GatewaySettings
    folder = Path(arguments['folder'])
    token = folder / 'token'
    token.write_text(_TOKEN)
    token.chmod(0o600)
    port = Path(arguments['port']).read_text()
    made = Gateway(GatewaySettings(server=f'ws://127.0.0.1:{port}', token_file=str(token),
                                   live=('health/*/* 20', 'scan 10')), 'bench',
                   Path(arguments['path']), folder / 'gateway', lambda text: None)
    ready()
    asyncio.run(made.run(lambda: False))


def server(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Stand in for the server: take everything, and pass it on to viewers."""
    asyncio.run(_serve(Path(arguments['port']), arguments['viewers'], ready))


async def _serve(port_file: Path, viewers: int, ready: Callable[[], None]) -> None:
    from websockets.asyncio.client import connect
    from websockets.asyncio.server import broadcast
    from websockets.asyncio.server import serve
    from websockets.asyncio.server import ServerConnection
    watching: set[ServerConnection] = set()

    async def talk(socket: ServerConnection) -> None:
        if socket.request is not None and socket.request.path == '/live':
            watching.add(socket)
            await socket.wait_closed()
            return
        async for text in socket:
            answer = _answer(decode(text))
            if answer:
                await socket.send(answer)
            if isinstance(text, str) and '"kind":"live"' in text[:40]:
                broadcast(watching, text)
            elif isinstance(text, str) and '"kind":"hello"' in text[:40] and viewers:
                await socket.send(encode('want', {'signals_hz': _SIGNALS_HZ, 'cameras': {}}))

    async def watch(port: int) -> None:
        async with connect(f'ws://127.0.0.1:{port}/live', compression=None) as socket:
            async for text in socket:
                json.loads(text)

    async with serve(talk, '127.0.0.1', 0, compression=None) as made:
        port = int(next(iter(made.sockets)).getsockname()[1])
        port_file.write_text(str(port))
        tasks = [asyncio.ensure_future(watch(port)) for _ in range(viewers)]
        ready()
        await asyncio.gather(*tasks, asyncio.Event().wait())


def _answer(message: Mapping[str, Any]) -> str:
    kind = message['kind']
    if kind == 'hello':
        return encode('welcome', {'utc_ns': time.time_ns(), 'want_map': False})
    if kind == 'live':
        return encode('taken', {'n': message['n']})
    return encode('stored', {'batch': message['batch']}) if kind == 'records' else ''

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


"""Real processes as clients: stopped, killed, and many at once."""

from __future__ import annotations

from collections.abc import Callable
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.topics import Layout

Until = Callable[..., Any]
ROOT = Path(__file__).resolve().parents[2]
PARTS = ('sent', 'full', 'lost', 'skipped', 'limited', 'waiting')

# Mirrors cmd_vel, says so, and reads until a sample with stamp 1 comes: then says what it saw.
CLIENT = """
import json, sys
from pathlib import Path
from rt_robot_os.link import LinkClient
client = LinkClient(Path(sys.argv[1]), sys.argv[2])
seen = []
client.on_data = lambda head, cdr: seen.append((head.seq, head.missed, head.stamp_ns))
client.mirror('cmd_vel')
print('ready', flush=True)
while not seen or seen[-1][2] != 1:
    client.pump(1.0)
Path(sys.argv[3]).write_text(json.dumps([s[:2] for s in seen]))
"""


def start(core: Any, name: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, '-c', CLIENT, str(core.path), name,
         str(core.folder / name)], stdout=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(
            [str(ROOT), os.environ.get('PYTHONPATH', '')])})
    assert process.stdout is not None
    assert process.stdout.readline() == 'ready\n'
    return process


def publish(client: LinkClient, channel: int, count: int, stamp_ns: int = 0) -> None:
    twist = Layout.compile('geometry_msgs/msg/Twist').prototype
    while count:
        try:
            client.publish(channel, twist, stamp_ns)
            count -= 1
        except LinkError:
            client.request('reset_statistics')  # answered after what was sent before it


def head_of(client: LinkClient) -> int:
    told = client.statistics()
    return next(int(t['published']) for t in told.topics if t['name'] == 'cmd_vel')


def mirrors_of(client: LinkClient) -> dict[str, dict[str, Any]]:
    return {c['name']: c['mirrors'][0] for c in client.statistics().clients if c['mirrors']}


def test_a_stopped_client_loses_is_counted_exactly_and_disturbs_no_other(
        core: Any, until: Until) -> None:
    writer = core.client('writer')
    channel = writer.advertise('cmd_vel')
    stopped, others = start(core, 'stopped'), [start(core, f'{n}') for n in range(2)]
    try:
        stopped.send_signal(signal.SIGSTOP)
        published = 0
        while not mirrors_of(writer)['stopped']['full']:
            publish(writer, channel, 500)
            published += 500
        until(lambda: head_of(writer) == published, 'all samples published')
        mirrors = mirrors_of(writer)
        assert set(mirrors) == {'stopped', '0', '1'}
        for mirror in mirrors.values():
            assert mirror['published'] == published == sum(mirror[key] for key in PARTS)
        stopped.send_signal(signal.SIGCONT)

        def last_one_sent() -> bool:
            # Until there is room again for a sample of the client that was stopped.
            publish(writer, channel, 1, stamp_ns=1)
            return all(process.poll() is not None for process in (stopped, *others))

        until(last_one_sent, 'the end of all clients')
        for name in ('stopped', '0', '1'):
            seen = json.loads((core.folder / name).read_text())
            assert [seq for seq, _ in seen] == [n + missed for n, (_, missed) in enumerate(seen)]
        assert writer.statistics().core['failures_total'] == 0
    finally:
        for process in (stopped, *others):
            process.kill()
            process.wait()
            assert process.stdout is not None
            process.stdout.close()


def test_a_client_finds_the_core_again_after_a_restart(core: Any, until: Until) -> None:
    client = core.client('before')
    first = client.core['pid']
    core.end(signal.SIGKILL)

    def told() -> bool:
        try:
            client.pump(0.05)
        except LinkError as error:
            assert 'core' in str(error)
            return True
        return False

    until(told, 'the end of the connection')
    core.process = core.spawn()
    again = core.client('after')
    assert again.core['pid'] == core.process.pid != first
    assert again.request('reset_statistics') == {}

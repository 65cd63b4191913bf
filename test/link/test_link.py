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

"""Clients of a real core over its real socket."""

from __future__ import annotations

from collections.abc import Callable
import os
import random
import signal
import socket
import subprocess
import sys
from typing import Any

import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.kernel import TaskStatistics
from rt_robot_os.link import LinkClient
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.topics import Layout

Until = Callable[..., Any]
PARTS = ('sent', 'full', 'lost', 'skipped', 'limited', 'waiting')


class Collector:
    """Keep what comes on a client."""

    def __init__(self, client: LinkClient) -> None:
        self.client = client
        self.headers: list[Header] = []
        self.samples: list[bytes] = []
        client.on_data = self._keep

    def _keep(self, head: Header, cdr: memoryview) -> None:
        self.headers.append(head)
        self.samples.append(bytes(cdr))

    def pump(self) -> int:
        self.client.pump(0.02)
        return len(self.samples)


def twist(x: float) -> bytes:
    layout = Layout.compile('geometry_msgs/msg/Twist')
    buffer = layout.new_buffer()
    layout.view(buffer).linear.x = x
    return bytes(buffer)


def x_of(cdr: bytes) -> float:
    layout = Layout.compile('geometry_msgs/msg/Twist')
    return float(layout.to_dict(cdr)['linear']['x'])


def mirror_of(watch: LinkClient, name: str, topic: str = 'cmd_vel') -> dict[str, Any]:
    for client in watch.statistics().clients:
        if client['name'] == name:
            for mirror in client['mirrors']:
                if mirror['topic'] == topic:
                    return dict(mirror)
    return {}


def task_of(watch: LinkClient, name: str) -> TaskStatistics:
    return next(t for t in watch.statistics().tasks if t.name == name)


def topic_of(watch: LinkClient, name: str) -> dict[str, Any]:
    return next(t for t in watch.statistics().topics if t['name'] == name)


def test_a_client_is_told_what_there_is(core: Any) -> None:
    client = core.client()
    assert client.core['pid'] == core.process.pid
    assert set(client.topics) == {'cmd_vel', 'text', 'cmd_vel_safe', 'picture'}
    assert client.topics['cmd_vel'].type_name == 'geometry_msgs/msg/Twist'
    assert client.topics['cmd_vel'].size == 52
    assert 'guard' in client.core['tasks']


def test_drain_brings_every_sample_in_order_to_every_client(core: Any, until: Until) -> None:
    readers = [Collector(core.client(f'reader {n}')) for n in range(3)]
    for reader in readers:
        reader.client.mirror('cmd_vel')
    writer = core.client('writer')
    channel = writer.advertise('cmd_vel')
    for n in range(300):
        writer.publish(channel, twist(n))
        if n % 20 == 19:  # the ring holds 64
            for reader in readers:
                until(lambda r=reader, n=n: r.pump() > n, f'{n + 1} samples')
    for reader in readers:
        assert [x_of(s) for s in reader.samples] == list(range(300))
        assert [h.seq for h in reader.headers] == list(range(300))
        assert all(h.missed == 0 for h in reader.headers)


def test_latest_may_skip_and_counts_it(core: Any, until: Until) -> None:
    reader = Collector(core.client('reader'))
    reader.client.mirror('cmd_vel', policy='latest')
    writer = core.client('writer')
    channel = writer.advertise('cmd_vel')
    for n in range(200):
        writer.publish(channel, twist(n))
    until(lambda: reader.pump() and x_of(reader.samples[-1]) == 199, 'the newest sample')
    mirror = mirror_of(writer, 'reader')
    assert mirror['published'] == 200 == sum(mirror[key] for key in PARTS)
    assert mirror['sent'] == len(reader.samples) and mirror['lost'] == mirror['full'] == 0


def test_a_rate_limit_passes_over_and_counts_it(core: Any, until: Until) -> None:
    reader = Collector(core.client('reader'))
    reader.client.mirror('cmd_vel_safe', max_rate_hz=10.0)  # of 100 Hz
    until(lambda: reader.pump() >= 10, 'ten samples')
    mirror = mirror_of(core.client('watch'), 'reader', 'cmd_vel_safe')
    assert mirror['published'] == sum(mirror[key] for key in PARTS)
    first, last, count = reader.headers[0], reader.headers[-1], len(reader.headers)
    # How many were passed over is up to the machine: a busy one has the guard miss releases.
    assert 0 < last.seq - first.seq + 1 - count <= mirror['limited'] + mirror['lost']
    assert last.stamp_ns - first.stamp_ns > 0.8 * 100_000_000 * (count - 1)


def test_the_policy_can_be_changed_and_the_mirror_ended(core: Any, until: Until) -> None:
    reader = Collector(core.client('reader'))
    reader.client.mirror('cmd_vel_safe')
    until(lambda: reader.pump() > 5, 'samples')
    reader.client.mirror('cmd_vel_safe', policy='latest', max_rate_hz=5.0)
    watch = core.client('watch')
    assert mirror_of(watch, 'reader', 'cmd_vel_safe')['policy'] == 'latest'
    reader.client.request('unmirror', topic='cmd_vel_safe')
    assert mirror_of(watch, 'reader', 'cmd_vel_safe') == {}
    assert topic_of(watch, 'cmd_vel_safe')['subscribers'] == []


def test_a_late_client_gets_the_last_value_if_it_asks(core: Any, until: Until) -> None:
    writer = core.client('writer')
    channel = writer.advertise('cmd_vel')
    for n in range(3):
        writer.publish(channel, twist(n))
    until(lambda: topic_of(writer, 'cmd_vel')['published'] == 3, 'the samples taken')
    asks, does_not = Collector(core.client('asks')), Collector(core.client('does not'))
    asks.client.mirror('cmd_vel', initial=True)
    does_not.client.mirror('cmd_vel')
    until(asks.pump, 'the last value')
    assert x_of(asks.samples[0]) == 2
    does_not.client.request('reset_statistics')
    assert does_not.samples == []


def test_a_client_that_does_not_read_loses_and_every_sample_is_accounted_for(
        core: Any, until: Until) -> None:
    reader = Collector(core.client('reader'))
    reader.client.mirror('cmd_vel_safe')
    watch = core.client('watch')
    watch.request('change', name='guard.rate_hz', value=2000.0)
    until(lambda: (m := mirror_of(watch, 'reader', 'cmd_vel_safe'))['full'] and m['lost'],
          'losses')
    watch.request('change', name='guard.rate_hz', value=10.0)
    mirror = mirror_of(watch, 'reader', 'cmd_vel_safe')
    assert mirror['published'] == sum(mirror[key] for key in PARTS)
    # What the client sees agrees: the gaps in the numbers are the samples it is told it missed.
    until(lambda: reader.pump() and reader.headers[-1].missed, 'a sample after the gap')
    last = reader.headers[-1]
    assert last.seq - reader.headers[0].seq + 1 == len(reader.headers) + last.missed


def test_a_variable_tail_arrives_with_its_own_length(core: Any, until: Until) -> None:
    reader = Collector(core.client('reader'))
    reader.client.mirror('text')
    writer = core.client('writer')
    channel = writer.advertise('text')
    layout = Layout.compile('std_msgs/msg/String', tail=100)
    buffer = layout.new_buffer()
    for text in ('', 'a', 'hello', 'x' * 99):
        layout.view(buffer).data = text
        writer.publish(channel, bytes(buffer[:layout.length(buffer)]))
    until(lambda: reader.pump() == 4, 'four texts')
    assert [layout.to_dict(s)['data'] for s in reader.samples] == ['', 'a', 'hello', 'x' * 99]


def test_statistics_are_those_of_the_core(core: Any, until: Until) -> None:
    client = core.client('me')
    before = task_of(client, 'guard')
    after = until(lambda: (t := task_of(client, 'guard')).runs > before.runs + 20 and t, 'jobs')
    assert after.priority == 40 and after.period_ns == 10_000_000
    assert after.releases - after.runs - after.missed in (0, 1)
    assert after.latency.count in (after.runs, after.runs - 1)
    assert 0 < after.execution.p50_ns <= after.execution.p99_ns <= after.execution.maximum_ns
    statistics = client.statistics()
    assert statistics.core['pid'] == core.process.pid
    assert [c['name'] for c in statistics.clients] == ['me']
    client.request('change', name='guard.rate_hz', value=0.1)  # none comes while it is asked
    client.request('reset_statistics')
    assert task_of(client, 'guard').runs < after.runs


@pytest.mark.parametrize(('do', 'arguments', 'reason'), [
    ('fly', {}, "unknown request 'fly'; known are advertise"),
    ('mirror', {'topic': 'nothing'}, "no topic 'nothing'; there are: cmd_vel"),
    ('mirror', {'topic': 7}, 'topic = 7: must be a string'),
    ('mirror', {'topic': 'cmd_vel', 'policy': 'all'}, "policy = 'all': must be drain or latest"),
    ('mirror', {'topic': 'cmd_vel', 'max_rate_hz': -1}, 'max_rate_hz = -1: must be a number'),
    ('change', {'name': 'guard.rate_hz', 'value': 0}, 'guard.rate_hz = 0: must be a number from'),
    ('change', {'name': 'guard.rate_hz', 'value': 'x'}, "guard.rate_hz = 'x': must be a number"),
    ('change', {'name': 'link/beat.rate_hz', 'value': 1}, 'link/beat.rate_hz: not a parameter'),
    ('change', {'name': 'guard.timeout_s', 'value': -1}, 'guard.timeout_s'),
    ('change', {'name': 'guard.safe_topic', 'value': 'x'}, 'not a parameter that can be changed'),
    ('change', {'name': 'nobody.x', 'value': 1}, 'nobody.x: not a parameter that can be changed'),
    ('change', {'value': 1}, 'name = None: must be a string'),
    ('set_rate', {'task': 'guard', 'rate_hz': 10.0}, "unknown request 'set_rate'"),
    ('set_parameter', {'owner': 'guard', 'name': 'timeout_s', 'value': 1.0}, 'unknown request'),
])
def test_a_request_that_cannot_be_met_is_refused_with_the_reason(
        core: Any, do: str, arguments: dict[str, Any], reason: str) -> None:
    client = core.client()
    with pytest.raises(LinkError, match=reason):
        client.request(do, **arguments)
    assert client.request('reset_statistics') == {}  # and it is still welcome


def test_a_sample_that_does_not_fit_is_refused_and_counted(core: Any, until: Until) -> None:
    client = core.client('me')
    channel = client.advertise('cmd_vel')
    client.publish(channel, b'\x00\x01\x00\x00short')
    client.publish(channel, twist(1.0))
    until(lambda: client.statistics().clients[0]['received'] == 1, 'the good one')
    assert client.statistics().clients[0]['refused'] == 1


def strangers() -> list[tuple[str, bytes]]:
    rng = random.Random(1)
    return [
        ('empty kind', header(PacketKind.BEAT)[:5]), ('noise', rng.randbytes(300)),
        ('other version', b'\x02\x63' + bytes(22)),
        ('a kind for clients', header(PacketKind.REPORT)),
        ('a kind that is none', b'\xee\x01' + bytes(22)),
        ('a channel never advertised', header(PacketKind.DATA, 1) + twist(1.0)),
        ('no JSON', header(PacketKind.REQUEST) + b'{'),
        ('no object', header(PacketKind.REQUEST) + b'[1]'),
        ('no number', encode_json(PacketKind.REQUEST, {'do': 'hello'})),
        ('a deep one', header(PacketKind.REQUEST) + b'[' * 10_000),
        ('too long', header(PacketKind.REQUEST) + b' ' * 20_000),
    ]


@pytest.mark.parametrize('packet', [p for _, p in strangers()], ids=[n for n, _ in strangers()])
def test_a_client_that_talks_nonsense_is_dropped_and_the_core_runs_on(
        core: Any, until: Until, packet: bytes) -> None:
    good = core.client('good')
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
        stranger.connect(str(core.path))
        stranger.settimeout(60)
        stranger.send(packet)
        try:
            while stranger.recv(70_000):
                pass
        except ConnectionResetError:
            pass
    refused = until(lambda: good.statistics().core['refused'], 'the refusal counted')
    assert refused == 1 and core.process.poll() is None


def test_any_noise_of_any_length_is_survived(core: Any, until: Until) -> None:
    good = core.client('good')
    rng = random.Random(7)
    for _ in range(100):
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
            stranger.connect(str(core.path))
            stranger.settimeout(60)
            try:
                for _ in range(rng.randint(1, 5)):
                    head = bytes([rng.choice([1, 2, 3, 4, 5, 6, 200]), rng.choice([1, 1, 1, 9])])
                    stranger.send(head + rng.randbytes(rng.randint(0, 400)))
            except OSError:
                pass  # dropped already
    before = task_of(good, 'guard').runs
    until(lambda: task_of(good, 'guard').runs > before + 20, 'the core running on')
    until(lambda: len(good.statistics().clients) == 1, 'all strangers gone')
    assert good.statistics().core['failures_total'] == 0


def test_more_clients_than_places_are_refused(core: Any, until: Until) -> None:
    for n in range(17):  # one place is kept for the parent of the core, which is this process
        core.client(f'{n}')
    with pytest.raises(LinkError):
        LinkClient(core.path, 'one too many', timeout_s=5.0)
    core.clients.pop().close()
    assert core.client('in its place').request('reset_statistics') == {}


def test_another_user_is_refused(core: Any, until: Until) -> None:
    if os.getuid() != 0:
        pytest.skip('needs root to become another user')
    good = core.client('good')
    os.chmod(core.folder, 0o755)
    os.chmod(core.path, 0o666)  # even if the permissions failed to keep it out
    code = (f'import os, socket; os.setuid(65534); s = socket.socket(socket.AF_UNIX, '
            f'socket.SOCK_SEQPACKET); s.connect({str(core.path)!r}); s.settimeout(60)\n'
            'try:\n    print(len(s.recv(99)))\nexcept OSError:\n    print(0)')
    answer = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                            timeout=60, check=True)
    assert answer.stdout.strip() == '0'
    until(lambda: good.statistics().core['refused'] == 1, 'the refusal counted')


@pytest.mark.parametrize('use', [LinkClient.beat, lambda client: client.pump(60.0)],
                         ids=['sending', 'reading'])
def test_a_core_that_ended_is_told_in_the_same_words_however_it_is_noticed(
        core: Any, use: Any) -> None:
    client = core.client()
    core.end()
    with pytest.raises(LinkError, match='the core closed the connection'):
        while True:
            use(client)


def test_a_client_that_is_killed_is_forgotten(core: Any, until: Until) -> None:
    watch = core.client('watch')
    code = ('import sys, time; from pathlib import Path; from rt_robot_os.link import LinkClient\n'
            f'c = LinkClient(Path({str(core.path)!r}), "victim"); c.mirror("cmd_vel_safe")\n'
            'print("ready", flush=True); time.sleep(60)')
    with subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE,
                          env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}) as victim:
        assert victim.stdout is not None and victim.stdout.readline() == b'ready\n'
        assert len(watch.statistics().clients) == 2
        victim.kill()
    until(lambda: len(watch.statistics().clients) == 1, 'the victim forgotten')
    assert topic_of(watch, 'cmd_vel_safe')['subscribers'] == []


def test_the_core_stops_when_it_is_asked_and_removes_its_socket(core: Any) -> None:
    core.client().request('stop')
    assert core.process.wait(60) == 0
    assert not core.path.exists()


def test_a_leftover_socket_is_replaced_and_a_client_finds_the_new_core(
        core: Any, until: Until) -> None:
    core.client()
    core.end(signal.SIGKILL)
    assert core.path.exists()
    core.process = core.spawn()
    assert core.client('again').core['pid'] == core.process.pid


def test_a_second_core_on_the_same_path_is_refused(core: Any) -> None:
    client = core.client()
    second = core.spawn()
    assert second.wait(60) == 2
    assert client.request('reset_statistics') == {}


def test_the_socket_is_for_its_user_alone(core: Any) -> None:
    core.client()
    assert core.path.stat().st_mode & 0o777 == 0o600
    assert core.folder.stat().st_mode & 0o777 == 0o700


def test_nobody_listening_is_told_with_the_path(tmp_path: Any) -> None:
    with pytest.raises(LinkError, match='no core answers at .*nowhere.sock'):
        LinkClient(tmp_path / 'nowhere.sock')

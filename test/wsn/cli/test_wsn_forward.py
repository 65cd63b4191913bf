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

"""A serial port that several programs share, and commands that reach the mote."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from contextlib import contextmanager
import json
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys
import threading

from processes import environment
from processes import wait_until
from pty_motes import Mote
import pytest

from rt_robot_os.features.wsn.cli import forward
from rt_robot_os.features.wsn.cli.command import run
from rt_robot_os.features.wsn.cli.forward import Server
from rt_robot_os.features.wsn.packets.forwarding import Forwarder
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.serial_am import SerialAm

PACKET = SerialAm(0xFFFF, 0, 0x55, b'hello').pack()
Capture = pytest.CaptureFixture[str]


@contextmanager
def forwarding(port: str, stack: str) -> Iterator[tuple[Forwarder, str]]:
    """Run a forwarder in a thread; give it and its address."""
    listener = socket.create_server(('127.0.0.1', 0))
    forwarder = Forwarder(stack)
    server = Server(forwarder, listener, port, 0)
    server.patience_s = 0.02
    server.open()
    over = threading.Event()

    def serve() -> None:
        while not over.is_set():
            server.turn()

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield forwarder, f'sf://127.0.0.1:{listener.getsockname()[1]}'
    finally:
        over.set()
        thread.join()
        server.close()


@pytest.mark.parametrize('stack', ['tinyos2', 'auto'])
def test_several_programs_read_one_mote(stack: str, capsys: Capture) -> None:
    with Mote((frame(0x45, PACKET),)) as mote, forwarding(mote.path, stack) as (forwarder, url):
        with closing(_client(url)) as lazy:
            assert run(['sniff', url, '--json', '--seconds', '0.2']) == 0
            assert lazy.recv(2) == b'U '
        out = capsys.readouterr().out
        wait_until(lambda: forwarder.clients == 0, 'the disconnection')
    records = [json.loads(line) for line in out.splitlines()]
    assert records and {each['hex'] for each in records} == {PACKET.hex()}
    assert {each['medium'] for each in records} == {'forwarder'}


def _client(url: str) -> socket.socket:
    host, _, port = url.removeprefix('sf://').rpartition(':')
    return socket.create_connection((host, int(port)), 10)


def test_what_a_program_sends_reaches_the_mote_though_frames_are_lost(capsys: Capture) -> None:
    with Mote(ignored=1) as mote, forwarding(mote.path, 'tinyos2') as (forwarder, url):
        assert run(['send', url, 'rate', '5', '2000']) == 0
        wait_until(lambda: forwarder.link.acknowledged, 'the acknowledgement')
    assert 'does not report whether the mote did' in capsys.readouterr().out
    packet = SerialAm(5, 0, 18, bytes.fromhex('0002 00000800')).pack()
    assert mote.taken == [(0x44, 0x26, packet)] * 2
    assert forwarder.link.resends == 1


def test_a_program_that_is_none_is_disconnected(capsys: Capture) -> None:
    with Mote() as mote, forwarding(mote.path, 'tinyos1') as (forwarder, url):
        with closing(_client(url)) as client:
            client.sendall(b'GET / HTTP/1.0\r\n\r\n')
            assert client.recv(2) == b'T!'
            wait_until(lambda: forwarder.clients == 0, 'the disconnection')
    assert 'not a serial forwarder: it started with 47 45' in capsys.readouterr().err


def test_a_port_that_comes_back_is_opened_again_and_clients_stay(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forward, '_RETRY_S', 0.01)
    link = tmp_path / 'mote'
    first = Mote((frame(0x45, PACKET),))
    with first:
        os.symlink(first.path, link)
        with forwarding(str(link), 'tinyos2') as (forwarder, url):
            with closing(_client(url)) as client:
                client.sendall(b'U ')
                wait_until(lambda: forwarder.from_mote, 'a packet')
                link.unlink()
                first.unplug()
                with Mote((frame(0x45, PACKET),)) as second:
                    os.symlink(second.path, link)
                    before = forwarder.from_mote
                    wait_until(lambda: forwarder.from_mote > before, 'a packet of the other')
                assert forwarder.clients == 1


def test_the_program_ends_in_order(tmp_path: Path) -> None:
    with Mote((frame(0x45, PACKET),)) as mote:
        process = subprocess.Popen(
            [sys.executable, '-m', 'rt_robot_os.features.wsn.cli.program', 'forward', mote.path,
             '--listen', '0'], stderr=subprocess.PIPE, text=True, env=environment(tmp_path))
        assert process.stderr is not None
        url = process.stderr.readline().split()[-1]
        assert url.startswith('sf://127.0.0.1:')
        assert run(['sniff', url, '--quiet', '--seconds', '0.2']) == 0
        process.send_signal(signal.SIGTERM)
        said = process.stderr.read()
        assert process.wait(60) == 0
        process.stderr.close()
    assert 'packets from the mote' in said and 'Traceback' not in said


@pytest.mark.parametrize(('arguments', 'sent', 'code'), [
    (['--stack', 'tinyos1', 'rate', '5', '2000'], '06010800ffff0500127d020000080000', 0),
    (['sleep', 'all', '--stack', 'tinyos1', '--platform', 'mica'], 'ffff127d05' '0300000000', 0),
    (['--stack', 'tinyos2', '--am', '0x93', '--to', '3', '--data', '0001'],
     '00' '0003' '0000' '02' '00' '93' '0001', 0),
    (['--stack', 'tinyos2', '--packet', '0x010203'], '010203', 0)])
def test_a_packet_is_sent_and_acknowledged(
        arguments: list[str], sent: str, code: int, capsys: Capture) -> None:
    with Mote() as mote:
        assert run(['send', mote.path, *arguments]) == code
    assert capsys.readouterr().out == f'acknowledged: {sent}\n'
    assert mote.taken == [(0x44 if 'tinyos2' in arguments else 0x41, 0x26, bytes.fromhex(sent))]


def test_a_mote_that_does_not_acknowledge_is_tried_and_told_of(capsys: Capture) -> None:
    with Mote(ignored=9) as mote:
        assert run(['send', mote.path, '--stack', 'tinyos1', '--tries', '2', 'wake', '3']) == 1
    assert len(mote.taken) == 2
    assert 'did not acknowledge' in capsys.readouterr().err


def test_the_generation_is_heard_from_the_line(capsys: Capture) -> None:
    with Mote((frame(0x45, PACKET),)) as mote:
        assert run(['send', mote.path, 'wake', '3']) == 0
    assert [each[0] for each in mote.taken] == [0x44]


@pytest.mark.parametrize(('arguments', 'said'), [
    (['rate', '5'], 'must be rate NODE MS, such as rate 5 2000'),
    (['rate', '5', 'soon'], "the period 'soon' must be milliseconds from 1"),
    (['sleep', '70000'], "the node '70000' must be a number from 0 to 65535, or all"),
    (['dance', '5'], 'must start with one of rate, sleep, wake, focus, unfocus'),
    ([], 'give one of: a command'), (['wake', '5', '--am', '1'], 'or --packet HEX')])
def test_a_wrong_command_is_refused_before_the_port_is_opened(
        arguments: list[str], said: str, capsys: Capture) -> None:
    assert run(['send', '/dev/none', *arguments]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize('arguments', [
    ['send', '/dev/none', '--am', '256'], ['send', '/dev/none', '--data', 'xyz'],
    ['send', '/dev/none', '--turn'], ['sniff', 'a', 'b'], ['forward', 'x', '--listen', 'here'],
    ['sniff', 'a', '--seconds', '-1'], []])
def test_a_wrong_command_line_ends_with_2(arguments: list[str], capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stop:
        run(arguments)
    assert stop.value.code == 2

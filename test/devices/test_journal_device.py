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

"""The journal as a device, with the real process on a real disk: killed, full, taken, damaged."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import contextlib
import json
import os
from pathlib import Path
import resource
import signal
import socket
import time
from typing import Any

from journal_rig import Rig
from journal_rig import worker_of
from processes import wait_until
import pytest

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.journal_device import driver
from rt_robot_os.features.alarms.journal_device.protocol import JournalPacket
from rt_robot_os.features.alarms.journal_device.protocol import packet
from rt_robot_os.features.alarms.journal_device.service import JournalService
from rt_robot_os.features.alarms.journal_device.simulated import SimulatedJournal
from rt_robot_os.features.alarms.journal_file import NAME
from rt_robot_os.linux.process import parent_of

pytest.importorskip('std_msgs.msg', reason='the ROS 2 messages are not installed')


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Callable[..., Rig]]:
    made: list[Rig] = []

    def make(**given: Any) -> Rig:
        made.append(Rig(tmp_path / 'alarms', **given))
        return made[-1]

    yield make
    for each in made:
        each.device.close()


def test_what_was_stored_comes_back_with_its_age(rig: Callable[..., Rig]) -> None:
    first = rig()
    assert first.begin() == []
    first.keep(1, 'one')
    first.keep(2, 'two')
    first.keep(3, 'two', is_open=False)
    first.until_stored(3)
    first.device.close()
    second = rig()
    assert second.begin() == ['one', 'two']  # the second one for its number
    ages = [each['age_ns'] for each in second.said if 'record' in each]
    assert all(0 < age < 600e9 for age in ages)


def test_a_process_that_is_killed_is_told_and_the_next_goes_on(rig: Callable[..., Rig]) -> None:
    one = rig()
    for seq in range(1, 6):
        assert len(one.begin()) == seq - 1
        one.keep(seq)
        one.until_stored(seq)
        os.kill(worker_of(one), signal.SIGKILL)
        with pytest.raises(DeviceError, match='ended without a message'):
            one.until(lambda: False)
        assert 'ended' in one.said[-1]['fault']
        one.keep(seq + 100)  # to nobody: whoever made it sends it again
        one.device.close()


def test_a_full_disk_is_told_and_what_was_stored_stays(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.begin()
    one.keep(1)
    one.until_stored(1)
    resource.prlimit(worker_of(one), resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    one.keep(2)
    with pytest.raises(DeviceError, match='cannot be written: File too large'):
        one.until(lambda: False)
    assert one.begin() == ['1']
    one.keep(2)
    one.until_stored(2)


def test_two_robots_with_one_folder_are_told_apart(rig: Callable[..., Rig]) -> None:
    first, second = rig(), rig()
    first.begin()
    first.keep(1)
    first.until_stored(1)  # it could be written, not only read
    with pytest.raises(DeviceError, match='give each robot a folder of its own'):
        second.begin()
    assert not any('record' in each for each in second.said)  # those are the first robot's
    assert [each for each in second.said if 'fault' in each]
    first.device.close()
    deadline = time.monotonic() + 60
    while True:  # the first process needs a moment to end
        try:
            assert second.begin() == ['1']
            second.keep(2)
            second.until_stored(2)
            break
        except DeviceError:
            assert time.monotonic() < deadline
            second.device.close()


def test_a_folder_that_cannot_be_is_told(tmp_path: Path) -> None:
    (tmp_path / 'alarms').write_text('a file')
    one = Rig(tmp_path / 'alarms')
    with pytest.raises(DeviceError, match='the journal cannot be written: .*alarms'):
        one.begin()
    one.device.close()


def test_a_journal_that_can_neither_be_locked_nor_written_is_read(
        rig: Callable[..., Rig], tmp_path: Path) -> None:
    first = rig()
    first.begin()
    first.keep(1)
    first.until_stored(1)
    worker = Path('/proc', str(worker_of(first)))
    first.device.close()
    lock = tmp_path / 'alarms' / 'lock'
    wait_until(lambda: not worker.exists(), 'the end of the process')
    lock.unlink(missing_ok=True)  # it had to be ended by force
    lock.mkdir()  # as on a file system that cannot be written
    second = rig()
    with pytest.raises(DeviceError, match='cannot be written'):
        second.begin()
        second.until(lambda: False)
    told = [key for each in second.said for key in ('record', 'restored', 'fault') if key in each]
    assert told == ['record', 'restored', 'fault']
    assert second.said[0]['record']['alarm'] == '1'


def test_damage_in_the_middle_is_told_and_the_rest_kept(
        rig: Callable[..., Rig], tmp_path: Path) -> None:
    first = rig()
    first.begin()
    for seq in (1, 2, 3):
        first.keep(seq)
    first.until_stored(3)
    first.device.close()
    path = tmp_path / 'alarms' / NAME
    data = bytearray(path.read_bytes())
    data[data.index(b'"seq": 2')] ^= 1
    path.write_bytes(data)
    second = rig()
    assert second.begin() == ['1', '3']
    assert 'damaged in 1 places' in str(second.device.statistics().more['warning'])


def test_a_simulated_journal_is_the_real_thing_and_may_be_full(tmp_path: Path) -> None:
    simulated = SimulatedJournal('journal', {'faults': ['full at 5 for 20']}, tmp_path / 'sim')
    simulated.pump(0)
    one = Rig(simulated.path)
    try:
        for number, now_s in enumerate((0, 10)):
            one.device.open()
            simulated.pump(now_s * NS_PER_S)  # starts its process, and befalls it
            one.until(lambda: sum('restored' in each for each in one.said) > number)
            one.keep(number + 1)
            if not now_s:
                one.until_stored(1)
        with pytest.raises(DeviceError, match='cannot be written: File too large'):
            one.until(lambda: False)
        # It could be read all the same.
        assert [each['record']['alarm'] for each in one.said if 'record' in each] == ['1']
        assert [each['generation'] for each in one.said if 'restored' in each] == [1, 0]
    finally:
        one.device.close()
        simulated.close()


def test_only_this_user_reads_what_is_about_people(
        rig: Callable[..., Rig], tmp_path: Path) -> None:
    one = rig()
    one.begin()
    one.keep(1)
    one.until_stored(1)
    folder = tmp_path / 'alarms'
    assert folder.stat().st_mode & 0o077 == 0
    assert all(path.stat().st_mode & 0o077 == 0 for path in folder.iterdir())


def test_records_that_found_no_room_are_asked_for_again(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.begin()
    for seq in range(1, 20):  # more than the topic keeps, before the device looks
        one.records.msg.data = json.dumps({'seq': seq, 'alarm': 'a', 'state': {}})
        one.records.publish(seq)
    one.device.receive(20, False)
    one.until(lambda: {'resend': True} in one.said)
    assert one.device.statistics().more['resends'] == 1
    assert not any('stored' in each for each in one.said)


@pytest.mark.parametrize('said', [
    b'\x04', b'\x05{', b'\x06\xff', b'\x63abc', b'\x07full', b'\x00' * 30])
def test_a_process_that_talks_nonsense_is_a_fault_and_nothing_more(
        rig: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch, said: bytes) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    monkeypatch.setattr(driver, 'spawn_worker', lambda worker: (ours, lambda: None))
    one = rig()
    one.device.open()
    with theirs:
        theirs.send(said)
        try:
            one.device.read(1)
        except DeviceError as error:
            assert str(error).startswith('journal: ')


def test_a_process_that_hangs_is_given_up(
        rig: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    monkeypatch.setattr(driver, 'spawn_worker', lambda worker: (ours, lambda: None))
    one = rig()
    one.device.open()
    with theirs, pytest.raises(DeviceError, match='takes nothing more'):
        theirs.send(b'\x05{"restored": 0, "torn_bytes": 0, "damaged": 0}')
        one.device.read(1)
        for seq in range(1, 100_000):
            one.keep(seq)


def test_the_last_words_of_a_process_that_ends_with_packets_unread_are_heard(
        rig: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    monkeypatch.setattr(driver, 'spawn_worker', lambda worker: (ours, None))
    a_rig = rig()
    a_rig.device.open()
    theirs.send(packet(JournalPacket.FAULT, 'the disk is broken'))
    theirs.close()  # the request to open was not read
    with pytest.raises(DeviceError, match='the disk is broken'):
        a_rig.until(lambda: False)
    assert [each['fault'] for each in a_rig.said] == ['the disk is broken']


def test_a_host_of_journals_that_is_killed_is_started_again(tmp_path: Path) -> None:
    service = JournalService()
    path = service.start(tmp_path / 'robot.journals')
    said: list[str] = []

    def restarted() -> bool:
        said.extend(filter(None, (service.check(),)))
        return 'the process that starts writers of journals was started again (restart 1)' in said

    try:
        a_rig = Rig(tmp_path / 'alarms')
        a_rig.device.services = {'journals': path}
        a_rig.begin()
        a_rig.keep(1)
        a_rig.until_stored(1)
        os.kill(int(parent_of(worker_of(a_rig))), signal.SIGKILL)
        with pytest.raises(DeviceError):
            a_rig.until(lambda: False)
        wait_until(restarted, 'the host runs again')
        wait_until(lambda: begun(a_rig) == ['1'], 'the journal is open')
        a_rig.keep(2)
        a_rig.until_stored(2)
        a_rig.device.close()
    finally:
        service.stop()
    assert not path.exists()


def begun(a_rig: Rig) -> list[str] | None:
    """Open the journal, if there is somebody who writes it already."""
    with contextlib.suppress(DeviceError):
        return a_rig.begin()
    return None

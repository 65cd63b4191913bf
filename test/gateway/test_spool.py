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

"""Files on their way to the server: none lost, none from elsewhere, none twice."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
import json
import os
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('websockets', reason='websockets is not installed')

from rt_robot_os.base.errors import RecordingError  # noqa: E402
from rt_robot_os.devices.capture.observation_folder import ObservationFolder  # noqa: E402
from rt_robot_os.gateway.file_sender import FileSender  # noqa: E402
from rt_robot_os.gateway.media import camera_name  # noqa: E402
from rt_robot_os.gateway.server_clock import ServerClock  # noqa: E402
from rt_robot_os.gateway.spool import Spool  # noqa: E402
from rt_robot_os.messages.uplink.frames import decode_frame  # noqa: E402
from rt_robot_os.messages.uplink.kinds import MEDIA_DOWN  # noqa: E402
from rt_robot_os.messages.uplink.kinds import read  # noqa: E402
from rt_robot_os.messages.uplink.media import FileProgress  # noqa: E402
from rt_robot_os.messages.uplink.media import FileRefusal  # noqa: E402
from rt_robot_os.messages.uplink.messages import decode  # noqa: E402
from rt_robot_os.messages.uplink.messages import encode  # noqa: E402

CONTENT = b'\xff\xd8\xff\xe0' + bytes(150_000)


@pytest.fixture
def observations(tmp_path: Path) -> ObservationFolder:
    return ObservationFolder(tmp_path / 'observations', 100, 10**8)


def observed(folder: ObservationFolder, alarm: str = 'a1', suffix: str = '.jpg',
             content: bytes = CONTENT) -> dict[str, Any]:
    """Have the camera keep a file, and say what it tells of it."""
    kind = {'.jpg': 'picture', '.avi': 'clip'}[suffix]
    kept = folder.store(('anna', alarm, kind), suffix, len(content),
                        lambda file: file.write(content))
    return {'file': str(kept.path), 'alarm': alarm, 'subject': 'anna', 'kind': kind,
            'camera': 'hall', 'width': 640, 'height': 480, 't_ns': 5}


def spool_of(folder: ObservationFolder, tmp_path: Path, most_bytes: int = 10**8) -> Spool:
    return Spool(tmp_path / 'spool', folder.folder, most_bytes)


def test_a_file_waits_over_a_restart_and_outlives_its_original(
        observations: ObservationFolder, tmp_path: Path) -> None:
    told = observed(observations)
    item = spool_of(observations, tmp_path).take(told)
    Path(told['file']).unlink()  # to make room for others
    spool = spool_of(observations, tmp_path)
    assert spool.waiting() == [item]
    assert spool.part(spool.waiting()[0], 100_000, 10**6) == CONTENT[100_000:]
    assert spool.take(told) is None  # told of again
    spool.done(spool.waiting()[0]['id'])
    assert spool_of(observations, tmp_path).waiting() == []
    assert sorted(path.name for path in (tmp_path / 'spool').iterdir()) == ['known.json']


def test_what_was_observed_without_a_gateway_is_found_by_its_name(
        observations: ObservationFolder, tmp_path: Path) -> None:
    observed(observations, 'before')
    spool = spool_of(observations, tmp_path)
    assert list(spool.missed()) == []  # from before there was ever a gateway
    spool.take(observed(observations, 'heard'))
    observed(observations, 'unheard', '.avi', b'RIFF1234AVI ')
    again = spool_of(observations, tmp_path)
    found = list(again.missed())
    assert [(each['alarm'], each['subject'], each['kind']) for each in found] == [
        ('unheard', 'anna', 'clip')]
    assert again.take(found[0]) is not None


def test_pictures_go_first(observations: ObservationFolder, tmp_path: Path) -> None:
    spool = spool_of(observations, tmp_path)
    for alarm, suffix in (('a1', '.avi'), ('a1', '.jpg'), ('a2', '.avi'), ('a2', '.jpg')):
        spool.take(observed(observations, alarm, suffix))
    assert [(each['alarm'], each['kind']) for each in spool.waiting()] == [
        ('a1', 'picture'), ('a2', 'picture'), ('a1', 'clip'), ('a2', 'clip')]


def test_nothing_from_elsewhere_is_ever_taken(observations: ObservationFolder, tmp_path: Path
                                              ) -> None:
    name = 'observed_20261122T184408_253762Z_anna_a1_picture.jpg'
    secret = tmp_path / 'secret'
    secret.write_bytes(b'the key of the door')
    good = observed(observations)
    folder = observations.folder
    (folder / name).symlink_to(secret)
    os.mkfifo(folder / name.replace('a1', 'a2'))
    (folder / name.replace('a1', 'a3')).mkdir()
    (folder / name.replace('a1', 'a4')).touch()
    (tmp_path / name).write_bytes(CONTENT)
    spool = spool_of(observations, tmp_path)
    for odd in (str(secret), '/etc/passwd', f'{folder}/../secret', f'{folder}/../{name}',
                str(tmp_path / name), str(folder / name), str(folder / name.replace('a1', 'a2')),
                str(folder / name.replace('a1', 'a3')), str(folder / name.replace('a1', 'a4')),
                f'{folder}/.{name}.part', '', '\0', name):
        with pytest.raises(RecordingError):
            spool.take({**good, 'file': odd})
    assert spool.waiting() == []
    assert spool.take(good) is not None
    names = [path.name for path in (tmp_path / 'spool').iterdir()]
    assert len(names) == 3, names


def test_what_is_too_much_gives_way_the_oldest_first_and_is_counted(
        observations: ObservationFolder, tmp_path: Path) -> None:
    spool = spool_of(observations, tmp_path, 2 * len(CONTENT))
    for alarm in ('a1', 'a2', 'a3'):
        spool.take(observed(observations, alarm, content=CONTENT[:-1] + alarm[-1:].encode()))
    assert [each['alarm'] for each in spool.waiting()] == ['a2', 'a3']
    assert spool.given_up == 1


def test_a_spool_that_was_damaged_is_read_as_far_as_it_is_whole(
        observations: ObservationFolder, tmp_path: Path) -> None:
    spool = spool_of(observations, tmp_path)
    spool.take(observed(observations, 'a1'))
    spool.take(observed(observations, 'a2', content=CONTENT[:-9]))
    data = sorted((tmp_path / 'spool').glob('*.data'), key=lambda path: path.stat().st_size)
    data[0].write_bytes(b'cut')
    (tmp_path / 'spool' / 'odd.json').write_text('[')
    (tmp_path / 'spool' / 'known.json').write_text('{')
    again = spool_of(observations, tmp_path)
    assert [each['alarm'] for each in again.waiting()] == ['a1']


class Server:
    """The other end of a connection: it takes files until it is cut, as the server does."""

    def __init__(self) -> None:
        self.content: dict[str, bytes] = {}
        self.whole: dict[str, bytes] = {}
        self.parts = self.cut_after = 0
        self.refusals: list[float] = []
        self.sender: FileSender | None = None

    async def send(self, packet: str | bytes) -> None:
        if isinstance(packet, str):
            message = decode(packet)
            self.say(message['kind'], message, b'')
            return
        header, payload = decode_frame(packet)
        self.parts += 1
        if self.parts == self.cut_after:
            raise ConnectionResetError('cut')
        self.say(header['kind'], header, bytes(payload))

    def say(self, kind: str, message: Mapping[str, Any], payload: bytes) -> None:
        name = message['id']
        assert self.sender is not None
        if kind == 'offer' and self.refusals:
            self.answer('refused', {'id': name, 'text': 'no', 'retry_s': self.refusals.pop(0)})
            return
        there = self.whole.get(name, self.content.setdefault(name, b''))
        if kind == 'part' and message['offset'] == len(there):
            there = self.content[name] = there + payload
        if len(there) == len(CONTENT):
            self.whole[name] = there
        self.answer('have', {'id': name, 'offset': len(there)})

    def answer(self, kind: str, content: dict[str, Any]) -> None:
        assert self.sender is not None
        message = read(MEDIA_DOWN, decode(encode(kind, content)))
        assert isinstance(message, (FileProgress, FileRefusal))
        self.sender.receive(message)


async def sends(sender: FileSender, server: Server, spool: Spool) -> None:
    """Send over connection after connection until nothing waits."""
    server.sender = sender
    while spool.waiting():
        sender.begin()
        running = asyncio.ensure_future(sender.run(server.send))
        while spool.waiting() and not running.done():
            await asyncio.sleep(0.001)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def test_a_file_goes_on_where_the_server_is_after_each_break(
        observations: ObservationFolder, tmp_path: Path) -> None:
    spool, server = spool_of(observations, tmp_path), Server()
    spool.take(observed(observations))
    server.cut_after = 2

    async def go() -> int:
        sender = FileSender(spool, lambda line: None)
        await asyncio.wait_for(sends(sender, server, spool), 30)
        return sender.sent

    assert asyncio.run(go()) == 1
    assert list(server.whole.values()) == [CONTENT]
    assert server.parts == 4  # of 64 KB; the one that was cut went again


def test_what_the_server_never_takes_is_given_up_and_what_waits_for_its_disk_is_not(
        observations: ObservationFolder, tmp_path: Path) -> None:
    spool, server = spool_of(observations, tmp_path), Server()
    spool.take(observed(observations))
    server.refusals = [0.01, 0.01]
    told: list[str] = []

    async def go() -> None:
        await asyncio.wait_for(sends(FileSender(spool, told.append), server, spool), 30)

    asyncio.run(go())
    assert len(server.whole) == 1 and spool.given_up == 0
    spool.take(observed(observations, 'a2'))
    server.refusals = [0.0]
    asyncio.run(go())
    assert len(server.whole) == 1 and spool.given_up == 1
    assert 'is refused by the server' in told[-1]


def test_the_clock_of_the_server_is_known_to_half_the_quickest_answer() -> None:
    clock = ServerClock()
    assert clock.server_ns(5) == 0
    offset_ns = 10**18
    for asked_ns, there_ns, back_ns in ((0, 900, 1000), (2000, 2005, 2010), (3000, 3900, 4000)):
        clock.heard(asked_ns, there_ns + offset_ns, back_ns)
    assert abs(clock.server_ns(7000) - (7000 + offset_ns)) <= 5
    clock.heard(9000, 1, 8000)  # an answer to nothing
    assert abs(clock.server_ns(7000) - (7000 + offset_ns)) <= 5


def test_cameras_are_called_by_what_people_know() -> None:
    assert camera_name('camera/image_raw/compressed') == 'camera'
    assert camera_name('hall/left/image_raw/compressed') == 'hall/left'
    assert camera_name('front/compressed') == 'front'
    assert camera_name('pictures') == 'pictures'


def test_what_is_written_can_be_read_by_its_owner_alone(
        observations: ObservationFolder, tmp_path: Path) -> None:
    spool_of(observations, tmp_path).take(observed(observations))
    assert (tmp_path / 'spool').stat().st_mode & 0o777 == 0o700
    known = json.loads((tmp_path / 'spool' / 'known.json').read_text())
    assert len(known['names']) == 1

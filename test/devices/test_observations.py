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

"""Stills and clips: the ring, the file, the folder, the orders, and a camera's real process."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from datetime import datetime
from datetime import timezone
import errno
import io
import json
import os
from pathlib import Path
import select
import struct
import time
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.camera.requests import ObservationRequests
from rt_robot_os.devices.camera.requests import OBSERVED_BYTES
from rt_robot_os.devices.camera.requests import parse_request
from rt_robot_os.devices.capture.avi import AviFrame
from rt_robot_os.devices.capture.avi import laid_out
from rt_robot_os.devices.capture.avi import write_avi
from rt_robot_os.devices.capture.observation_folder import file_name
from rt_robot_os.devices.capture.observation_folder import ObservationFolder
from rt_robot_os.devices.capture.observations import ClipRing
from rt_robot_os.devices.capture.observations import Observations
from rt_robot_os.devices.capture.pattern import number_of
from rt_robot_os.devices.capture.pictures import RoomPictures
from rt_robot_os.devices.capture.room_view import RoomView
from rt_robot_os.devices.capture.scene_memory import SceneMemory
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus

Image = pytest.importorskip('PIL.Image', reason='Pillow is not installed')
STRING = 'std_msgs/msg/String'
ROOT = Path(__file__).resolve().parents[2]


def chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Take a RIFF file or list apart."""
    at = 0
    while at < len(data):
        kind, length = struct.unpack_from('<4sI', data, at)
        content = data[at + 8:at + 8 + length]
        assert len(content) == length
        yield kind, content
        at += 8 + length + length % 2


def movie(data: bytes) -> tuple[list[bytes], bytes, bytes]:
    """Return the pictures of an AVI, its main header and its index."""
    (kind, content), = chunks(data)
    assert kind == b'RIFF' and content[:4] == b'AVI '
    found = dict((key if key != b'LIST' else part[:4], part) for key, part in chunks(content[4:]))
    pictures = [part for key, part in chunks(found[b'movi'][4:])]
    head = dict(chunks(found[b'hdrl'][4:]))
    return pictures, head[b'avih'], found[b'idx1']


# ---- the file --------------------------------------------------------------------------------

@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 400), st.binary(min_size=1, max_size=40)), min_size=1,
                max_size=30), st.floats(0.5, 60.0))
def test_a_clip_holds_each_picture_at_its_time(steps: list[tuple[int, bytes]], rate_hz: float
                                               ) -> None:
    frames, at_ms = [], 5
    for step_ms, jpeg in steps:
        at_ms += step_ms
        frames.append(AviFrame(at_ms * NS_PER_MS, jpeg))
    file = io.BytesIO()
    count = write_avi(file, frames, 64, 48, rate_hz)
    pictures, head, index = movie(file.getvalue())
    assert pictures == laid_out(frames, rate_hz) and len(pictures) == count
    assert struct.unpack_from('<I', head, 16)[0] == count
    for place, picture in enumerate(pictures):
        if picture:  # within half a frame of when it was taken
            at_s = place / rate_hz
            assert min(abs((each.stamp_ns - frames[0].stamp_ns) / NS_PER_S - at_s)
                       for each in frames if each.jpeg == picture) <= 0.5 / rate_hz + 1e-6
    # The index says where each is, from the word movi on.
    body = file.getvalue()
    start = body.index(b'movi')
    for row, (_, _, at, length) in enumerate(struct.iter_unpack('<4sIII', index)):
        assert body[start + at + 8:start + at + 8 + length] == pictures[row]


def test_no_picture_makes_no_file() -> None:
    with pytest.raises(ValueError, match='0 pictures'):
        write_avi(io.BytesIO(), [], 64, 48, 5.0)


# ---- the ring --------------------------------------------------------------------------------

@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 900), st.integers(1, 500)), max_size=60),
       st.floats(0.0, 3.0), st.integers(100, 1500))
def test_the_ring_keeps_no_more_than_it_may(steps: list[tuple[int, int]], seconds: float,
                                            most: int) -> None:
    ring, at_ms, given_frames = ClipRing(seconds, most), 0, []
    for step_ms, size in steps:
        at_ms += step_ms
        frame = AviFrame(at_ms * NS_PER_MS, bytes(size))
        ring.add(frame)
        given_frames.append(frame)
        kept = ring.since(0)
        assert sum(len(each.jpeg) for each in kept) <= most
        assert all(frame.stamp_ns - each.stamp_ns <= seconds * NS_PER_S for each in kept)
        assert kept == given_frames[len(given_frames) - len(kept):]


# ---- the folder ------------------------------------------------------------------------------

def keep(folder: ObservationFolder, size: int = 10, **more: Any) -> Any:
    return folder.store(('anna', 'a1', 'picture'), '.jpg', size,
                        more.get('write', lambda file: file.write(bytes(size))))


def test_the_oldest_files_make_room_and_no_others(tmp_path: Path) -> None:
    for foreign in ('holiday.jpg', 'observed_.jpg', 'observed_x.avi'):
        (tmp_path / foreign).write_bytes(bytes(1000))
    folder = ObservationFolder(tmp_path, 3, 100)
    kept = [keep(folder).path for _ in range(5)]
    assert [path.exists() for path in kept] == [False, False, True, True, True]
    assert keep(folder, 85).deleted == 2 and kept[4].exists()
    assert folder.deleted == 4
    assert (tmp_path / 'holiday.jpg').exists() and (tmp_path / 'observed_x.avi').exists()
    assert oct(kept[4].stat().st_mode)[-3:] == '600'


def test_names_sort_by_time_and_lead_nowhere() -> None:
    moments = [datetime(2026, 1, 2, 3, 4, 5, micro, timezone.utc) for micro in (7, 1000, 999_999)]
    names = [file_name(('../../etc/passwd', 'a/1', 'clip'), '.avi', each) for each in moments]
    assert names == sorted(names)
    assert names[0] == 'observed_20260102T030405_000007Z_etc_passwd_a_1_clip.avi'
    assert '/' not in file_name(('\0\n' * 90, 'ä' * 90), '.jpg', moments[0])


def full(file: Any) -> None:
    file.write(b'half')
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_is_a_problem_that_leaves_nothing_behind(tmp_path: Path) -> None:
    folder = ObservationFolder(tmp_path, 3, 100)
    with pytest.raises(DeviceError, match='No space left on device; free space'):
        keep(folder, write=full)
    assert list(tmp_path.iterdir()) == []
    assert keep(folder).path.exists()  # and the next one goes


def test_a_folder_that_cannot_be_is_named(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(DeviceError, match='observations_folder'):
        keep(ObservationFolder(tmp_path / 'file', 3, 100))
    with pytest.raises(DeviceError, match='observations_mb'):
        keep(ObservationFolder(tmp_path, 3, 100), 101)


def test_what_a_killed_process_left_goes_and_what_is_being_written_stays(tmp_path: Path) -> None:
    old, new = (tmp_path / f'.observed_{name}.jpg.part' for name in ('old', 'new'))
    old.write_bytes(b'1')
    new.write_bytes(b'2')
    os.utime(old, (1.0, 1.0))
    keep(ObservationFolder(tmp_path, 3, 100))
    assert not old.exists() and new.exists()


# ---- orders ----------------------------------------------------------------------------------

_ANY = st.one_of(st.none(), st.booleans(), st.floats(), st.integers(), st.text(max_size=9),
                 st.just([]))


@settings(max_examples=60, deadline=None)
@given(st.one_of(st.text(max_size=40), st.dictionaries(
    st.sampled_from(['order', 'alarm', 'subject', 'before_s', 'after_s', 'id', 'x']),
    _ANY | st.sampled_from(['clip', 'picture', 2.5])).map(json.dumps)))
def test_whatever_is_ordered_is_answered(text: str) -> None:
    desk = ObservationRequests('eye', {'observe_topic': 'x', 'clip_s': 5.0})
    handed: list[dict[str, Any]] = []
    told = desk.handle(text, 1, 2, lambda order: handed.append(order) or '')  # type: ignore
    assert (told is None) == bool(handed)
    if told is not None:
        assert told['problem'] and len(desk.answer(told)) <= OBSERVED_BYTES


def test_an_order_is_bounded() -> None:
    order = parse_request(json.dumps({'order': 'clip', 'alarm': 'a' * 99, 'before_s': 99,
                                      'after_s': 1e9, 'id': -1}), 5.0)
    assert (order['before_s'], order['after_s'], len(order['alarm']), order['id']) == (
        5.0, 60.0, 64, 0)
    for odd in ({'before_s': True}, {'after_s': 'x'}, {'after_s': float('nan')}):
        with pytest.raises(ValueError, match='seconds'):
            parse_request(json.dumps({'order': 'clip', **odd}), 5.0)


def test_an_order_of_long_ago_is_not_carried_out() -> None:
    desk = ObservationRequests('eye', {'observe_topic': 'x', 'clip_s': 5.0})
    told = desk.handle('{"order":"picture"}', 1, 11 * NS_PER_S, lambda order: pytest.fail())
    assert told is not None and 'was not available' in told['problem']
    assert desk.statistics()['orders_late'] == 1


# ---- what the process keeps ------------------------------------------------------------------

class Eye:
    """A camera without a camera."""

    def __init__(self) -> None:
        self.broken = False

    def still(self) -> tuple[Any, int]:
        if self.broken:
            raise DeviceError('it is dark')
        return np.zeros((48, 64, 3), np.uint8), 77

    def packed(self, pixels: Any, quality: int) -> bytes:
        return b'still'


class Seen:
    def __init__(self, at_s: float) -> None:
        self.stamp_ns = round(at_s * NS_PER_S)

    def jpeg(self) -> bytes:
        return str(self.stamp_ns // NS_PER_MS).encode()


def observations(tmp_path: Path, **changes: Any) -> tuple[Observations, list[dict[str, Any]], Eye]:
    told: list[dict[str, Any]] = []
    camera = Eye()
    made = Observations({
        'clip_s': 2.0, 'clip_mb': 1.0, 'clip_rate_hz': 5.0, 'output_rate_hz': 30.0, 'width': 64,
        'height': 48, 'observations_folder': str(tmp_path), 'observations_files': 9,
        'observations_mb': 9.0, **changes}, camera, told.append)
    return made, told, camera


def order(kind: str, at_s: float, before_s: float = 0.0, after_s: float = 0.0) -> dict[str, Any]:
    return {'order': kind, 'alarm': 'a1', 'subject': 'anna', 'id': 3, 'before_s': before_s,
            'after_s': after_s, 't_ns': round(at_s * NS_PER_S)}


@pytest.mark.parametrize('rate_hz', [5.0, 7.0, 30.0])
def test_a_clip_has_the_seconds_before_and_after(tmp_path: Path, rate_hz: float) -> None:
    made, told, _ = observations(tmp_path)
    for number in range(round(10 * rate_hz)):
        at_s = number / rate_hz
        made.add(Seen(at_s))
        if abs(at_s - 5.0) < 0.4 / rate_hz:
            made.request(order('clip', at_s, 1.5, 2.0), 0)
    made.close()
    answer, = told
    assert (answer['kind'], answer['id'], answer['subject']) == ('clip', 3, 'anna')
    assert answer['t_ns'] / NS_PER_S == pytest.approx(3.5, abs=0.35)
    assert answer['end_ns'] / NS_PER_S == pytest.approx(7.0, abs=0.35)
    pictures = [each for each in movie(Path(answer['file']).read_bytes())[0] if each]
    times = [int(each) for each in pictures]
    assert times == sorted(times) and 15 <= len(times) <= 19 and answer['frames'] >= len(times)


def test_a_clip_without_a_past_has_the_seconds_after(tmp_path: Path) -> None:
    made, told, _ = observations(tmp_path, clip_s=0.0)
    made.add(Seen(1.0))
    made.request(order('clip', 1.0, 2.0, 1.0), 0)
    for number in range(12):
        made.add(Seen(1.0 + 0.2 * number))
    made.close()
    assert told[0]['t_ns'] >= NS_PER_S and told[0]['frames'] in (5, 6)


def test_a_camera_that_ends_leaves_the_clip_that_it_has(tmp_path: Path) -> None:
    made, told, _ = observations(tmp_path)
    for number in range(10):
        made.add(Seen(0.2 * number))
    made.request(order('clip', 1.8, 2.0, 30.0), 0)
    made.close()
    assert told[0]['frames'] == 10 and Path(told[0]['file']).exists()


def test_what_cannot_be_is_answered_with_its_problem(tmp_path: Path) -> None:
    made, told, camera = observations(tmp_path, observations_mb=1e-6)
    made.request(order('picture', 1.0), 0)
    made.request(order('dance', 1.0), 0)
    for _ in range(5):
        made.request(order('clip', 1.0, 1.0, 1.0), 0)
    camera.broken = True
    made.request(order('picture', 1.0), 0)
    made.close()
    problems = ' '.join(answer['problem'] for answer in told)
    for part in ('observations_mb', "'dance'", '4 clips', 'it is dark', 'no picture has arrived'):
        assert part in problems


def test_the_still_of_a_simulated_room_shows_the_same_in_more_pixels() -> None:
    scene = {'map': str(ROOT / 'config' / 'maps' / 'flat.yaml'), 'ceiling': 2.5, 'lux': 400.0,
             'camera': (2.45, 4.9, 0.6, 1.2, 0.0), 'people': [(2.6, 6.9, 0.3, 0.0, 1.0, 1.2)]}
    memory = SceneMemory.create()
    try:
        memory.write(scene)
        source = RoomPictures({'width': 160, 'height': 120, 'camera_info': '',
                               'output_rate_hz': 1000.0}, memory)
        grabbed = source.grab()
        assert grabbed is not None
        still, _ = source.still(640, 480)
    finally:
        memory.close()
    small = still.reshape(120, 4, 160, 4, 3).mean(axis=(1, 3))
    assert np.abs(small - grabbed[0]).mean() < 4.0

    def edges(picture: Any) -> int:
        shirt = (picture[:, :, 0] > 120) & (picture[:, :, 1] < 60)
        return int((shirt[1:] != shirt[:-1]).sum())

    # Who lies there has no gaps between slices, which the pictures of every day do have.
    assert 0 < edges(still) < 0.8 * edges(RoomView(640, 480).picture(scene))


# ---- a camera with its process ---------------------------------------------------------------

class Camera:
    """A camera of the moving pattern, and who orders."""

    def __init__(self, folder: Path, **changes: Any) -> None:
        driver = DRIVERS.load('camera')
        values = {**{field.name: field.default for field in driver.fields()},
                  'port': 'synthetic', 'width': 64, 'height': 48, 'output_rate_hz': 50.0,
                  'clip_rate_hz': 50.0, 'still_width': 320, 'still_height': 240,
                  'observe_topic': 'camera/observe', 'observed_topic': 'camera/observed',
                  'observations_folder': str(folder), **changes}
        kernel = Kernel(VirtualClock())
        bus = Bus(kernel)
        bus.declare('camera/observe', STRING, tail=500)
        self.device: Any = driver('eye', values)
        self.device.check = lambda: None
        for each in self.device.publications():
            bus.add(each, 8)
        task = kernel.add_task('eye', lambda: None, priority=20)
        self.device.bind([bus.publisher(each.topic) for each in self.device.publications()])
        self.device.connect(bus, task)
        self._orders = bus.publisher('camera/observe')
        self._observed = bus.subscribe('camera/observed', 'test')
        self._image = bus.subscribe('camera/image_raw', 'test')
        self.device.open()

    def order(self, **order: Any) -> None:
        self._orders.msg.data = json.dumps(order)
        self._orders.publish(time.monotonic_ns())

    def pictures(self, count: int) -> None:
        wanted = self.device.statistics().frames + count
        self.until(lambda: self.device.statistics().frames >= wanted)

    def answers(self, count: int) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = []

        def take() -> bool:
            while self._observed.take():
                found.append(json.loads(self._observed.msg.data))
            return len(found) >= count

        self.until(take)
        return found

    def until(self, done: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 60
        while not done():
            assert time.monotonic() < deadline
            select.select([self.device.fileno()], [], [], 1.0)
            self.device.read(time.monotonic_ns())


pytest.importorskip('sensor_msgs.msg', reason='the ROS 2 messages are not installed')


def test_a_camera_saves_a_still_and_a_clip_while_it_goes_on(tmp_path: Path) -> None:
    camera = Camera(tmp_path)
    try:
        camera.pictures(12)
        camera.order(order='picture', alarm='a1', subject='anna', id=1)
        camera.order(order='clip', alarm='a1', subject='anna', id=2, before_s=0.2, after_s=0.3)
        camera.order(order='nonsense')
        answers = {answer['id']: answer for answer in camera.answers(3)}
        statistics = camera.device.statistics().more
    finally:
        camera.device.close()
    still, clip, refused = answers[1], answers[2], answers[0]
    with Image.open(still['file']) as picture:
        assert picture.size == (320, 240) == (still['width'], still['height'])
        assert picture.format == 'JPEG' and number_of(np.asarray(picture)) > 0
    pictures, _, _ = movie(Path(clip['file']).read_bytes())
    numbers = [number_of(np.asarray(Image.open(io.BytesIO(each)))) for each in pictures if each]
    assert numbers == sorted(numbers) and len(numbers) > 1
    # Pictures of before the order are in it, and of after.
    assert clip['t_ns'] < still['t_ns'] < clip['end_ns']
    assert 'is not a request' in refused['problem'] and refused['camera'] == 'eye'
    assert statistics['observations'] == 2 and statistics['orders_refused'] == 1
    assert sorted(path.suffix for path in tmp_path.iterdir()) == ['.avi', '.jpg']


def test_a_still_that_holds_the_pictures_up_is_no_silence(tmp_path: Path) -> None:
    camera = Camera(tmp_path, still_width=1280, still_height=960)
    try:
        camera.pictures(2)
        assert camera.device.quiet_s() == 0.0
        camera.order(order='picture', id=1)
        camera.device.read(time.monotonic_ns())
        assert camera.device.quiet_s() > 5.0
        assert camera.answers(1)[0]['width'] == 1280
        camera.pictures(2)  # they come again: from now on silence is silence
        assert camera.device.quiet_s() == 0.0
    finally:
        camera.device.close()


def test_a_camera_that_is_not_open_says_so(tmp_path: Path) -> None:
    camera = Camera(tmp_path)
    camera.device._ready = False
    camera.order(order='picture', id=4)
    try:
        assert 'not open' in camera.answers(1)[0]['problem']
    finally:
        camera.device.close()


def test_a_full_folder_is_told_and_the_camera_goes_on(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    camera = Camera(tmp_path / 'file')
    try:
        camera.pictures(2)
        camera.order(order='picture', id=5)
        answer, = camera.answers(1)
        assert 'a file cannot be written' in answer['problem'] and 'file' not in answer
        camera.pictures(2)
        assert 'no picture could be stored' in camera.device.statistics().more['warning']
    finally:
        camera.device.close()


def test_settings_that_do_not_fit_are_named() -> None:
    driver = DRIVERS.load('camera')
    values = {field.name: field.default for field in driver.fields()}
    with pytest.raises(ConfigError, match='go together'):
        driver('eye', {**values, 'port': 'sim', 'observe_topic': 'camera/observe'})

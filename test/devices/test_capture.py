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

"""Captures: packets, sources, calibration, and the device with real processes and false ones."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import io
import os
from pathlib import Path
import select
import signal
import socket
import sys
import time
from typing import Any
import wave

from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.camera.camera_info import load_calibration
from rt_robot_os.devices.capture import packets
from rt_robot_os.devices.capture.camera import open_camera
from rt_robot_os.devices.capture.device import CaptureDevice
from rt_robot_os.devices.capture.packets import CapturedFrame
from rt_robot_os.devices.capture.pattern import number_of
from rt_robot_os.devices.capture.pattern import Pattern
from rt_robot_os.devices.capture.sound import open_sound
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.linux.file_urls import path_of
from rt_robot_os.topics import Bus

pytest.importorskip('sensor_msgs.msg', reason='the ROS 2 messages are not installed')


def values(kind: str, **given: Any) -> dict[str, Any]:
    return {**{f.name: f.default for f in DRIVERS.load(kind).SETTINGS}, 'port': 'synthetic',
            **given}


SMALL = {'width': 64, 'height': 48, 'output_rate_hz': 1000.0}


class Rig:
    """A device with its topics."""

    def __init__(self, kind: str, **given: Any) -> None:
        self.bus = Bus(Kernel(VirtualClock()))
        self.device: Any = DRIVERS.load(kind)('dut', values(kind, **given))
        publications = self.device.publications()
        for p in publications:
            self.bus.declare(p.topic, p.message, p.fixed, tail=p.tail, depth=p.depth)
        self.device.bind([self.bus.publisher(p.topic) for p in publications])
        self.readers = {p.topic: self.bus.subscribe(p.topic, 'test') for p in publications}

    def read_until(self, done: Callable[[], object]) -> None:
        deadline = time.monotonic() + 60
        while not done():
            assert time.monotonic() < deadline
            select.select([self.device.fileno()], [], [], 1.0)
            self.device.read(time.monotonic_ns())


@pytest.fixture
def rig() -> Iterator[Callable[..., Rig]]:
    made: list[Rig] = []

    def make(kind: str, **given: Any) -> Rig:
        made.append(Rig(kind, **given))
        if given.get('port', 'synthetic') == 'synthetic':
            made[-1].device.check = lambda: None
        return made[-1]

    yield make
    for each in made:
        each.device.close()


# ---- packets ---------------------------------------------------------------------------------

@given(st.binary(max_size=80))
def test_no_packet_raises(packet: bytes) -> None:
    packets.parse_frame(packet)
    packets.parse_release(packet)


@given(st.integers(0, 9), st.integers(-(1 << 62), 1 << 62), st.integers(0, 1 << 63))
def test_a_frame_comes_back_as_it_was(slot: int, stamp_ns: int, seq: int) -> None:
    frame = CapturedFrame(slot, stamp_ns, seq, 5, 6, 7, 8, -1.5, -0.25)
    assert packets.parse_frame(frame.encode()) == frame
    assert packets.parse_release(packets.encode_release(slot)) == slot


def test_the_last_words_of_a_process_that_has_not_read_everything_are_told() -> None:
    rig = Rig('camera', width=64, height=48)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    rig.device.check = lambda: None
    rig.device._start = lambda path: ours
    rig.device.open()  # the process ends before it reads what it is asked
    theirs.send(packets.problem('no such camera'))
    theirs.close()
    with pytest.raises(DeviceError, match='dut: no such camera'):
        rig.device.read(1)
    rig.device.close()


@examples(max_examples=60, deadline=None)
@given(st.lists(st.one_of(
    st.binary(min_size=1, max_size=90),
    st.builds(lambda slot, first, second: CapturedFrame(slot, 1, 2, first, second).encode(),
              st.integers(0, 5), st.sampled_from([0, 9216, 9217, 1 << 31]),
              st.sampled_from([0, 1, 100_000])),
    st.text(max_size=9).map(packets.problem)), max_size=8))
def test_a_process_that_talks_nonsense_is_a_fault_and_nothing_more(said: list[bytes]) -> None:
    rig = Rig('camera', width=64, height=48)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    rig.device.check = lambda: None
    rig.device._start = lambda path: ours
    rig.device.open()
    with theirs:
        for packet in said:
            theirs.send(packet)
            try:
                rig.device.read(1)
            except DeviceError as error:
                assert str(error).startswith('dut: ')
    rig.device.close()
    counters = rig.device.statistics()
    assert counters.frames + counters.rejected_frames <= len(said)


# ---- the pattern -----------------------------------------------------------------------------

@given(st.integers(0, (1 << 32) - 1), st.sampled_from([(64, 48), (320, 240), (641, 97)]))
@examples(max_examples=40, deadline=None)
def test_the_number_is_in_the_pixels(number: int, size: tuple[int, int]) -> None:
    picture = Pattern(*size).frame(number)
    assert picture.shape == (size[1], size[0], 3)
    assert number_of(picture) == number_of(picture[:, :, 1]) == number


@pytest.mark.parametrize('compression', ['jpeg', 'png'])
@pytest.mark.parametrize('encoding', ['rgb8', 'bgr8', 'mono8'])
def test_every_encoding_shows_the_same(encoding: str, compression: str) -> None:
    image = pytest.importorskip('PIL.Image', reason='Pillow is not installed')
    source = open_camera(values('camera', **{
        **SMALL, 'width': 320, 'height': 240}, encoding=encoding, compression=compression,
        compressed_topic='c'))
    slot = bytearray(2 * 320 * 240 * 3 + 20_000)
    frames = source.frames()
    for number in range(3):
        first, second = next(frames).store(memoryview(slot))
        shape = (240, 320) if encoding == 'mono8' else (240, 320, 3)
        raw = np.frombuffer(slot, np.uint8, first).reshape(shape)
        assert number_of(raw) == number
        unpacked = np.asarray(image.open(io.BytesIO(slot[first:first + second])))
        assert number_of(unpacked) == number
        if encoding != 'mono8':
            wanted = Pattern(320, 240).frame(number)
            assert (raw[:, :, ::-1] if encoding == 'bgr8' else raw).tolist() == wanted.tolist()
            assert np.abs(unpacked.astype(int) - wanted).mean() < 4


# ---- folders, videos, WAV files --------------------------------------------------------------

def write_pictures(folder: Path, shape: tuple[int, ...] = (48, 64, 3)) -> None:
    image = pytest.importorskip('PIL.Image', reason='Pillow is not installed')
    for value in range(11):
        image.fromarray(np.full(shape, 20 * value, np.uint8)).save(folder / f'p{value}.png')


def test_pictures_come_in_their_order_and_begin_anew(tmp_path: Path) -> None:
    write_pictures(tmp_path)
    frames = open_camera(values('camera', **SMALL, port=str(tmp_path))).frames()
    shown = [int(next(frames).pixels[0, 0, 0]) // 20 for _ in range(13)]
    assert shown == [*range(11), 0, 1]
    once = open_camera(values('camera', **SMALL, port=str(tmp_path), loop=False)).frames()
    with pytest.raises(DeviceError, match='is at its end: set loop: true'):
        for _ in range(12):
            next(once)


def test_pictures_that_do_not_fit_or_are_damaged_are_named(tmp_path: Path) -> None:
    pytest.importorskip('PIL.Image', reason='Pillow is not installed')
    with pytest.raises(DeviceError, match='contains no pictures'):
        open_camera(values('camera', **SMALL, port=str(tmp_path)))
    write_pictures(tmp_path, (24, 32, 3))
    with pytest.raises(DeviceError, match='gives 32x24 pixels, not 64x48: set width and height'):
        next(open_camera(values('camera', **SMALL, port=str(tmp_path))).frames())
    (tmp_path / 'p0.png').write_bytes((tmp_path / 'p0.png').read_bytes()[:40])
    with pytest.raises(DeviceError, match='p0.png is not a readable picture'):
        next(open_camera(values('camera', **SMALL, port=str(tmp_path))).frames())


@pytest.mark.parametrize('module, port, said', [
    ('cv2', '/dev/null', r'needs opencv-python-headless \S+ or newer \(not installed\): \S'),
    ('PIL', '.', r'needs pillow \S+ or newer \(not installed\): \S'),
])
def test_a_missing_library_is_named(
        module: str, port: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(DeviceError, match=said):
        open_camera(values('camera', **SMALL, port=port))


def test_a_missing_sound_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'sounddevice', None)
    with pytest.raises(DeviceError, match=r'needs sounddevice \S+ or newer'):
        open_sound(values('microphone', port='default'))


def test_a_video_is_read_by_opencv(tmp_path: Path) -> None:
    cv2 = pytest.importorskip('cv2', reason='OpenCV is not installed (an extra of 50 MB)')
    path = tmp_path / 'pattern.avi'
    pattern = Pattern(320, 240)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 30, (320, 240))
    for number in range(5):
        writer.write(np.ascontiguousarray(pattern.frame(number)[:, :, ::-1]))
    writer.release()
    settings = values('camera', width=320, height=240, output_rate_hz=500.0, port=str(path))
    source = open_camera(settings)
    frames = source.frames()
    shown = [next(frames) for _ in range(7)]
    assert [number_of(each.pixels) for each in shown] == [0, 1, 2, 3, 4, 0, 1]
    assert np.abs(shown[0].pixels.astype(int) - pattern.frame(0)).mean() < 8, 'red is red'
    source.close()
    path.write_bytes(b'RIFF' + bytes(300))
    with pytest.raises(DeviceError, match='is not a video that OpenCV can read'):
        open_camera(settings)


def write_wav(path: Path, samples: Any, rate_hz: int = 48000, width: int = 2) -> None:
    with wave.open(str(path), 'wb') as out:
        out.setnchannels(samples.shape[1])
        out.setsampwidth(width)
        out.setframerate(rate_hz)
        out.writeframes(samples.astype({1: 'u1', 2: '<i2'}[width]).tobytes())


def test_a_wav_file_is_played_sample_by_sample(tmp_path: Path) -> None:
    path = tmp_path / 'a.wav'
    samples = np.arange(2 * 250).reshape(250, 2) * 50
    write_wav(path, samples)
    frames = open_sound(values('microphone', port=str(path), channels=2, block=100)).frames()
    blocks = [next(frames) for _ in range(4)]
    played = np.concatenate([b.samples for b in blocks])
    assert (played[:250] == samples).all() and (played[250:300] == 0).all()
    assert (played[300:] == samples[:100]).all(), 'it begins anew'
    stamps = [b.stamp_ns for b in blocks]
    assert all(b > a and (b - a) % (100 * 10**9 // 48000) == 0 for a, b in zip(stamps, stamps[1:]))


@pytest.mark.parametrize('rate_hz, width, said', [
    (44100, 2, 'set sample_rate_hz: 44100'), (48000, 1, 'convert it to 16 bit')])
def test_another_wav_file_is_named(rate_hz: int, width: int, said: str, tmp_path: Path) -> None:
    path = tmp_path / 'a.wav'
    write_wav(path, np.zeros((10, 1)), rate_hz, width)
    with pytest.raises(DeviceError, match=said):
        open_sound(values('microphone', port=str(path)))
    path.write_bytes(path.read_bytes()[:20])
    with pytest.raises(DeviceError, match='is not a WAV file'):
        open_sound(values('microphone', port=str(path)))


def test_levels_are_those_of_the_samples() -> None:
    block = next(open_sound(values('microphone')).frames())
    level, peak = block.levels()
    assert level == pytest.approx(-12.0, abs=0.2)
    assert peak == pytest.approx(-9.0, abs=0.2)
    silent = type(block)(np.zeros((9, 1), np.int16), 0, 0)
    assert silent.levels() == (-120.0, -120.0)
    full = type(block)(np.full((9, 1), -32768, np.int16), 0, 0)
    assert full.levels() == (0.0, 0.0)


# ---- calibration -----------------------------------------------------------------------------

CALIBRATION = """
image_width: 64
image_height: 48
camera_name: head
camera_matrix: {rows: 3, cols: 3, data: [50, 0, 32, 0, 51, 24, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -0.2, 0.003, 0.004, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [52, 0, 31, 0, 0, 53, 23, 0, 0, 0, 1, 0]}
"""


def test_a_calibration_is_published(tmp_path: Path, rig: Callable[..., Rig]) -> None:
    path = tmp_path / 'head.yaml'
    path.write_text(CALIBRATION)
    made = rig('camera', **SMALL, camera_info=f'file://{path}')
    made.device.open()
    reader = made.readers['camera/camera_info']
    made.read_until(reader.take)
    info = reader.msg
    assert (info.width, info.height, info.distortion_model) == (64, 48, 'plumb_bob')
    assert info.d.tolist() == [0.1, -0.2, 0.003, 0.004, 0]
    assert info.k.tolist() == [50, 0, 32, 0, 51, 24, 0, 0, 1]
    assert info.p.tolist() == [52, 0, 31, 0, 0, 53, 23, 0, 0, 0, 1, 0]


@pytest.mark.parametrize('old, new, said', [
    ('image_width: 64', 'image_width: 640', 'are 640x48, the camera has 64x48'),
    ('plumb_bob', 'curly', "distortion_model is 'curly': use one of plumb_bob"),
    ('-0.2, 0.003, 0.004, 0]', '0]', 'plumb_bob takes 4 or 5 distortion_coefficients, not 2'),
    ('data: [50, 0,', 'data: [', 'camera_matrix.data must be a list of 9 numbers'),
    ('[52,', '[.nan,', 'projection_matrix.data must be'),
    ('camera_name', '{', 'is no YAML'),
])
def test_a_calibration_that_does_not_fit_is_named(
        old: str, new: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / 'head.yaml'
    path.write_text(CALIBRATION.replace(old, new))
    with pytest.raises(ConfigError, match=said):
        load_calibration(str(path), 64, 48)


@given(st.recursive(st.none() | st.integers() | st.floats() | st.text(max_size=5), lambda inner:
       st.lists(inner, max_size=9) | st.dictionaries(st.sampled_from(
           ['image_width', 'image_height', 'camera_matrix', 'data', 'distortion_model',
            'distortion_coefficients', 'projection_matrix']), inner, max_size=5), max_leaves=20))
@examples(max_examples=80, deadline=None)
def test_no_calibration_raises_anything_else(content: Any) -> None:
    import tempfile

    import yaml
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as file:
        yaml.safe_dump(content, file)
        file.flush()
        try:
            load_calibration(file.name, 64, 48)
        except ConfigError as error:
            assert file.name in str(error)


def test_urls_of_calibrations() -> None:
    assert path_of('file:///a/b%20c.yaml', 'camera_info') == Path('/a/b c.yaml')
    with pytest.raises(ConfigError, match="package 'no_such_package' is not found"):
        path_of('package://no_such_package/camera.yaml', 'camera_info')
    with pytest.raises(ConfigError, match='give a path, file:// or package://'):
        path_of('https://example.org/a.yaml', 'camera_info')


# ---- the device with real processes ----------------------------------------------------------

def test_pictures_arrive_whole_and_numbered(rig: Callable[..., Rig]) -> None:
    made = rig('camera', width=320, height=240, output_rate_hz=100.0)
    made.device.open()
    reader = made.readers['camera/image_raw']
    numbers: list[int] = []

    def look() -> bool:
        while reader.take():
            numbers.append(number_of(reader.msg.data.reshape(240, 320, 3)))
            assert (reader.msg.height, reader.msg.step) == (240, 960)
            assert 0 < reader.stamp_ns <= time.monotonic_ns()
        return len(numbers) > 8

    made.read_until(look)
    assert numbers == sorted(set(numbers))
    counters = made.device.statistics()
    assert counters.frames >= 8 and counters.rejected_frames == 0
    assert counters.samples == 2 * counters.frames


def test_blocks_of_sound_follow_each_other(rig: Callable[..., Rig]) -> None:
    made = rig('microphone', channels=2, block=480)
    made.device.open()
    places: list[tuple[int, int]] = []
    clock, sound = made.readers['sound/time'], made.readers['sound/samples']

    def look() -> bool:
        while clock.take() and sound.take():
            place = clock.msg.time_ref.sec * 10**9 + clock.msg.time_ref.nanosec
            places.append((place, clock.stamp_ns))
            assert clock.stamp_ns == sound.stamp_ns
            assert np.abs(sound.msg.data).max() > 3000
        return len(places) > 5

    made.read_until(look)
    assert all((b[0] - a[0]) % 10_000_000 == 0 for a, b in zip(places, places[1:]))


def test_a_process_that_is_killed_is_a_fault_and_opening_starts_another(
        rig: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch) -> None:
    from rt_robot_os.devices.capture import spawn
    started: list[Any] = []
    real = spawn.start_worker

    def start(connection: socket.socket, **given: Any) -> Any:
        started.append(real(connection, **given))
        return started[-1]

    monkeypatch.setattr(spawn, 'start_worker', start)
    made = rig('camera', **SMALL)
    device: CaptureDevice = made.device
    for turn in range(2):
        device.open()
        made.read_until(lambda: device.statistics().frames > 3 * turn + 2)
        os.kill(started[-1].pid, signal.SIGKILL)
        started[-1].wait()
        with pytest.raises(DeviceError, match='ended without a message'):
            made.read_until(lambda: False)
        device.close()
        device.close()
    assert len(started) == 2


def test_a_core_that_takes_nothing_loses_frames_and_they_are_counted(
        rig: Callable[..., Rig]) -> None:
    made = rig('camera', **SMALL)
    device = made.device
    device.open()
    made.read_until(lambda: device.statistics().frames > 0)
    deadline = time.monotonic() + 60
    while not device.statistics().lost_samples:
        assert time.monotonic() < deadline
        time.sleep(0.05)  # a thousand pictures a second into three slots
        device.read(time.monotonic_ns())
    before = device.statistics().lost_samples
    device.close()
    assert device.statistics().lost_samples == before


@pytest.mark.parametrize('kind, port, said', [
    ('camera', '/dev/video991', '/dev/video991 does not exist: check the cable'),
    ('microphone', '/nowhere/a.wav', '/nowhere/a.wav does not exist'),
])
def test_a_port_that_is_not_there_is_named_before_anything_starts(
        kind: str, port: str, said: str, rig: Callable[..., Rig]) -> None:
    with pytest.raises(DeviceError, match=f'dut: {said}'):
        rig(kind, port=port).device.open()


def test_what_the_process_finds_wrong_is_told(tmp_path: Path, rig: Callable[..., Rig]) -> None:
    write_pictures(tmp_path, (24, 32, 3))
    made = rig('camera', **SMALL, port=str(tmp_path))
    made.device.open()
    with pytest.raises(DeviceError, match='dut: .* gives 32x24 pixels, not 64x48'):
        made.read_until(lambda: False)


def test_settings_that_publish_nothing_are_refused() -> None:
    with pytest.raises(ConfigError, match='topic and compressed_topic are both empty'):
        Rig('camera', topic='')
    with pytest.raises(ConfigError, match='are all empty: name one'):
        Rig('microphone', topic='', level_topic='', peak_topic='', time_topic='')

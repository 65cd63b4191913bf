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

"""The view of cameras in a real browser: live pictures, their age, clips, and who sees none."""

from __future__ import annotations

import base64
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import closing
import hashlib
import io
import itertools
import random
from typing import Any

from fake_robot import FakeRobot
from fake_robot import RobotScript
from fake_robot import token_of
from processes import wait_until
import pytest
from rt_robot_os.devices.capture.avi import AviFrame
from rt_robot_os.devices.capture.avi import write_avi

Image = pytest.importorskip('PIL.Image', reason='Pillow is not installed')

PARSE = """async (clips) => {
  const {parseAvi} = await import('/lib/avi.js');
  return clips.map((text) => {
    const bytes = Uint8Array.from(atob(text), (each) => each.charCodeAt(0));
    try {
      const {width, height, rateHz, frames} = parseAvi(bytes.buffer);
      return {width, height, rateHz, frames: frames.map((each) => [each.length, each[0] ?? -1])};
    } catch (error) {
      return String(error.message);
    }
  });
}"""


def jpeg(level: int) -> bytes:
    found = io.BytesIO()
    Image.new('L', (64, 48), level).save(found, 'JPEG')
    return found.getvalue()


def avi(frames: list[bytes], rate_hz: float = 5.0) -> bytes:
    found = io.BytesIO()
    write_avi(found, [AviFrame(round(n * 1e9 / rate_hz), each) for n, each in enumerate(frames)
                      if each], 64, 48, rate_hz)
    return found.getvalue()


@pytest.fixture
def peer(server: Any) -> Iterator[Any]:
    """Connect a robot with a camera; give its connection for media."""
    from media_peer import MediaPeer
    script = RobotScript('robot', ('anna', 'bob'), cameras=['hall'], capabilities=['snapshot'])
    with FakeRobot(f'ws://{server.address}', script=script), closing(MediaPeer(
            server.address, '/robot/media',
            {'Authorization': f"Bearer {token_of('robot')}"})) as found:
        found.say('hello', version=1, cameras=['hall'])
        yield found


def test_a_live_picture_has_its_age_and_is_grey_when_it_is_old(
        peer: Any, signed_in: Callable[..., Any]) -> None:
    page = signed_in('carer', '#/camera')
    while not peer.next('want')['cameras']:
        pass
    numbers = itertools.count(1)

    def shows(level: int) -> bool:
        """Send a picture; tell whether one is live: on a busy machine the first may be old."""
        peer.frame('picture', jpeg(level), camera='hall', n=next(numbers), age_ns=0)
        peer.next('taken')
        page.wait_for_timeout(20)
        return 'picture-live' in (page.locator('.picture').get_attribute('class') or '')

    wait_until(lambda: shows(200), 'a live picture')
    assert page.locator('.picture-age').text_content().endswith('s old')
    middle = page.evaluate("""() => [...document.querySelector('.picture-canvas')
        .getContext('2d').getImageData(32, 24, 1, 1).data]""")
    assert all(abs(each - 200) < 8 for each in middle[:3])
    # Nothing comes any more: within a second it is no live picture, and says since when.
    page.locator('.picture-stale').wait_for()
    assert 'No picture since' in page.locator('.picture-note').text_content()
    assert 'grayscale' in page.evaluate(
        "() => getComputedStyle(document.querySelector('.picture-canvas')).filter")
    # It comes back by itself.
    wait_until(lambda: shows(90), 'a live picture again')
    page.goto(page.url.replace('camera', 'overview'))
    while peer.next('want')['cameras']:
        pass  # nobody looks: the camera rests


def test_a_camera_without_pictures_says_why_in_the_words_of_the_reader(
        peer: Any, signed_in: Callable[..., Any]) -> None:
    page = signed_in('carer', '#/camera', locale='de-DE')
    while not peer.next('want')['cameras']:
        pass
    note = page.locator('.picture-note')
    for text, shown, language in (
            ('Pillow is not installed: pip install pillow', 'fehlt die Bibliothek Pillow', None),
            ('the lens is covered with jam', 'the lens is covered with jam', 'en')):
        peer.say('trouble', camera='hall', text=text, codes={})
        page.wait_for_function(
            "shown => document.querySelector('.picture-note').textContent.includes(shown)",
            arg=shown)
        assert note.get_attribute('lang') == language


def test_who_may_not_see_everybody_there_sees_no_live_picture(
        peer: Any, signed_in: Callable[..., Any]) -> None:
    page = signed_in('carer', '#/camera', people=('anna',))
    page.get_by_text('you may not look through it').wait_for()


def test_a_clip_is_played_picture_by_picture(server: Any, peer: Any,
                                             signed_in: Callable[..., Any]) -> None:
    content = avi([jpeg(0), b'', jpeg(120), jpeg(250)])
    sha256 = hashlib.sha256(content).hexdigest()
    script = RobotScript('robot')
    server.services.store.add('robot', script.boot, [
        script.alarm('clip-alarm'), script.record('media', {
            'id': sha256[:8], 'alarm': 'clip-alarm', 'kind': 'clip', 'file': 'c.avi',
            'sha256': sha256, 'size': len(content), 'width': 64, 'height': 48, 't_ns': 9})])
    peer.say('offer', id='c', sha256=sha256, size=len(content))
    peer.next('have')
    peer.frame('part', content, id='c', offset=0)
    assert peer.next('have')['offset'] == len(content)
    page = signed_in('carer', '#/camera/robot%2Fclip-alarm')
    page.locator('.clip-controls').wait_for()
    bar = page.locator('.clip-bar')
    assert (bar.get_attribute('max'), bar.input_value()) == ('3', '0')

    def is_at(place: str, wanted: int) -> None:
        page.wait_for_function("""([place, wanted]) => {
            const level = document.querySelector('.clip-canvas').getContext('2d')
                .getImageData(30, 20, 1, 1).data[0];
            return document.querySelector('.clip-bar').value === place
                && Math.abs(level - wanted) < 8;
        }""", arg=[place, wanted])

    bar.focus()
    page.keyboard.press('ArrowRight')
    is_at('1', 0)  # an empty frame: the one before still stands
    page.keyboard.press('ArrowRight')
    is_at('2', 120)
    page.keyboard.press('End')
    is_at('3', 250)
    page.keyboard.press('Home')
    is_at('0', 0)
    page.get_by_role('button', name='Play').click()
    is_at('3', 250)


def test_the_page_reads_each_clip_that_the_robot_writes_and_no_other(
        signed_in: Callable[..., Any]) -> None:
    chance = random.Random(7)
    clips, expected = [], []
    for _ in range(60):
        frames = [chance.choice([b'', chance.randbytes(chance.randint(1, 400))])
                  for _ in range(chance.randint(1, 40))]
        frames[0] = frames[0] or b'x'
        while not frames[-1]:
            frames.pop()
        rate_hz = chance.choice([0.5, 1.0, 4.9, 5.0, 12.5, 30.0])
        clips.append(avi(frames, rate_hz))
        expected.append((rate_hz, [[len(each), each[0] if each else -1] for each in frames]))
    damaged = []
    for clip in clips[:30]:
        damaged.append(clip[:chance.randint(0, len(clip) - 1)])
        odd = bytearray(clip)
        for _ in range(8):
            odd[chance.randrange(len(odd))] = chance.randrange(256)
        damaged.append(bytes(odd))
    page = signed_in('carer')
    found = page.evaluate(PARSE, [base64.b64encode(each).decode() for each in clips + damaged])
    for (rate_hz, frames), one in zip(expected, found):
        assert one['frames'] == frames
        assert (one['width'], one['height']) == (64, 48)
        assert abs(one['rateHz'] - rate_hz) < 0.01 * rate_hz
    for one, clip in zip(found[len(clips):], damaged):
        assert isinstance(one, str) or sum(size for size, _ in one['frames']) <= len(clip) * 41

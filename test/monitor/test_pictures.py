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

"""The newest picture for each viewer, whatever the others do; no network."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.monitor.live.pictures import CAMERAS_MOST
from rt_robot_os.monitor.live.pictures import Gallery
from rt_robot_os.monitor.live.pictures import ViewedPicture
from rt_robot_os.monitor.live.pictures import Viewer

KEY = ('robot', 'camera')


def show(gallery: Gallery, n: int, key: tuple[str, str] = KEY) -> None:
    gallery.put(ViewedPicture(key, n, str(n).encode()))


def gallery_of(*rates: float) -> tuple[Gallery, list[Viewer]]:
    gallery = Gallery(lambda robot: None)
    viewers = []
    for rate_hz in rates:
        viewers.append(gallery.open_viewer(lambda: None))
        viewers[-1].watch(KEY, rate_hz)
    return gallery, viewers


def numbers(viewer: Viewer, now_ns: int) -> list[int]:
    found = []
    while (picture := viewer.next_picture(now_ns)[0]) is not None:
        found.append(picture.n)
    return found


def test_the_newest_picture_wins_and_one_is_on_its_way_at_a_time() -> None:
    gallery, (viewer,) = gallery_of(30.0)
    for n in (1, 2, 3):
        show(gallery, n)
    assert numbers(viewer, 0) == [3]
    show(gallery, 4)
    show(gallery, 5)
    assert numbers(viewer, 10**9) == []  # it has not said that it drew the third
    viewer.taken(KEY, 3)
    assert numbers(viewer, 10**9) == [5]
    assert (viewer.sent, viewer.skipped) == (2, 1)


def test_a_viewer_that_never_answers_changes_nothing_for_the_others() -> None:
    gallery, (dead, quick) = gallery_of(30.0, 30.0)
    got = []
    for n in range(1, 100):
        show(gallery, n)
        dead.next_picture(n * 40 * NS_PER_MS)
        for each in numbers(quick, n * 40 * NS_PER_MS):
            got.append(each)
            quick.taken(KEY, each)
    assert got == list(range(1, 100))
    assert dead.sent == 1


def test_a_viewer_gets_no_more_pictures_a_second_than_it_asked_for() -> None:
    gallery, (slow,) = gallery_of(5.0)
    got = 0
    for n in range(1, 301):  # ten seconds of thirty pictures
        show(gallery, n)
        for each in numbers(slow, n * 10**9 // 30):
            got += 1
            slow.taken(KEY, each)
    assert 48 <= got <= 52


def test_a_picture_that_waits_for_its_time_is_announced() -> None:
    gallery, (viewer,) = gallery_of(5.0)
    show(gallery, 1)
    assert numbers(viewer, 1000 * NS_PER_MS) == [1]
    viewer.taken(KEY, 1)
    show(gallery, 2)
    picture, wait_ns = viewer.next_picture(1010 * NS_PER_MS)
    assert picture is None
    assert 100 * NS_PER_MS < wait_ns <= 200 * NS_PER_MS
    assert numbers(viewer, 1010 * NS_PER_MS + wait_ns) == [2]


def test_what_is_wanted_is_the_most_that_anybody_wants_and_nothing_when_nobody_looks() -> None:
    changes: list[str] = []
    gallery = Gallery(changes.append)
    one, two = gallery.open_viewer(lambda: None), gallery.open_viewer(lambda: None)
    one.watch(KEY, 2.0)
    two.watch(KEY, 8.0)
    assert gallery.wanted('robot') == {'camera': 8.0}
    gallery.close_viewer(two)
    assert gallery.wanted('robot') == {'camera': 2.0}
    show(gallery, 1)
    one.leave(KEY)
    assert (gallery.wanted('robot'), gallery.newest(KEY)) == ({}, None)
    show(gallery, 2)
    assert gallery.newest(KEY) is None  # pictures of people stay nowhere
    assert changes.count('robot') == 4


def test_why_no_picture_comes_is_said_once_to_each_who_looks() -> None:
    gallery = Gallery(lambda robot: None)
    key, why = ('robot', 'hall'), {'text': 'unplugged', 'codes': {}}
    gallery.trouble(key, why)  # without a viewer
    early, other = gallery.open_viewer(lambda: None), gallery.open_viewer(lambda: None)
    early.watch(key, 10.0)
    other.watch(('robot', 'door'), 10.0)
    assert early.next_trouble() is None
    gallery.trouble(key, why)
    late = gallery.open_viewer(lambda: None)
    late.watch(key, 10.0)
    assert [each.next_trouble() for each in (early, late, other)] == [(key, why)] * 2 + [None]
    assert early.next_trouble() is None
    gallery.trouble(key, {'text': '', 'codes': {}})  # there are pictures again
    again = gallery.open_viewer(lambda: None)
    again.watch(key, 10.0)
    assert again.next_trouble() is None


def test_cameras_take_turns() -> None:
    gallery, (viewer,) = gallery_of(30.0)
    other = 'robot', 'other'
    viewer.watch(other, 30.0)
    got = []
    for n in range(1, 21):
        show(gallery, n)
        show(gallery, n, other)
        picture, _ = viewer.next_picture(n * 100 * NS_PER_MS)
        assert picture is not None
        got.append(picture.key)
        viewer.taken(picture.key, picture.n)
    assert abs(got.count(KEY) - got.count(other)) <= 1


def test_nobody_looks_at_any_number_of_cameras() -> None:
    gallery, (viewer,) = gallery_of(30.0)
    with pytest.raises(ValueError, match='16 cameras'):
        for n in range(CAMERAS_MOST + 1):
            viewer.watch(('robot', str(n)), 1.0)


@given(st.lists(st.tuples(st.sampled_from(['put', 'next', 'taken', 'odd']),
                          st.integers(0, 300)), max_size=80))
def test_numbers_only_rise_and_only_what_is_answered_is_followed(
        events: list[tuple[str, int]]) -> None:
    gallery, (viewer,) = gallery_of(30.0)
    now_ns, put, sent, awaited = 0, 0, 0, False
    for what, ms in events:
        now_ns += ms * NS_PER_MS
        if what == 'put':
            put += 1
            show(gallery, put)
        elif what == 'taken':
            viewer.taken(KEY, sent)
            awaited = False
        elif what == 'odd':
            viewer.taken(KEY, sent + 1)
        else:
            picture, _ = viewer.next_picture(now_ns)
            if picture is not None:
                assert not awaited
                assert sent < picture.n == put
                sent, awaited = picture.n, True

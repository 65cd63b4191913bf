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

"""
The newest picture of each camera and its viewers; each viewer gets the newest one independently.

This module has no network access. At most one picture of a camera is in flight to a viewer, which
gets the next after it has acknowledged that one: a slow viewer never gets pictures older than its
last acknowledgement, and does not affect other viewers.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S

#: Robot and camera.
Key = tuple[str, str]

#: Most pictures per second of one camera for a viewer.
RATE_MOST_HZ: Final = 30.0
RATE_LEAST_HZ: Final = 0.1
#: Most cameras that a viewer watches; more are refused.
CAMERAS_MOST: Final = 16


class ViewedPicture(NamedTuple):
    """
    A picture as viewers get it.

    :ivar n: counts the pictures of its camera, here.
    :ivar frame: header and JPEG; encoded once for all viewers.
    """

    key: Key
    n: int
    frame: bytes


@dataclass
class _CameraWatch:
    """A camera that a viewer watches; ``awaited`` is the number on its way, 0 for none."""

    period_ns: int
    next_ns: int = 0
    sent: int = 0
    awaited: int = 0


class Viewer:
    """
    A page that shows cameras.

    :param gallery: where the pictures are.
    :param wake: called when there may be something for :meth:`next_picture`.
    :ivar sent: pictures so far.
    :ivar skipped: pictures that it never got, because a newer one was there first.
    """

    def __init__(self, gallery: Gallery, wake: Callable[[], None]) -> None:
        self.sent = self.skipped = 0
        self.wake = wake
        self._gallery = gallery
        self._watched: dict[Key, _CameraWatch] = {}
        self._turn = 0
        self._asked_ns = 0
        self._troubles: dict[Key, Mapping[str, Any]] = {}

    def watch(self, key: Key, rate_hz: float) -> None:
        """
        Watch a camera, or change the rate.

        :raises ValueError: these are too many.
        """
        if key not in self._watched and len(self._watched) >= CAMERAS_MOST:
            raise ValueError(f'at most {CAMERAS_MOST} cameras at a time')
        period_ns = round(NS_PER_S / min(RATE_MOST_HZ, max(RATE_LEAST_HZ, rate_hz)))
        known = self._watched.get(key)
        if known is None:
            self._watched[key] = _CameraWatch(period_ns)
            if (why := self._gallery.troubles.get(key)) is not None:
                self._troubles[key] = why
        else:
            known.period_ns = period_ns
        self._gallery.changed(key[0])
        self.wake()

    def leave(self, key: Key) -> None:
        """Stop watching a camera; may be called twice."""
        if self._watched.pop(key, None) is not None:
            self._gallery.changed(key[0])

    def taken(self, key: Key, n: int) -> None:
        """Note that it has drawn a picture; the next may go."""
        watch = self._watched.get(key)
        if watch is not None and watch.awaited and n == watch.awaited:
            watch.awaited = 0
            self.wake()

    def trouble(self, key: Key, why: Mapping[str, Any]) -> None:
        """Note why no picture comes of what it looks at; the newest counts."""
        if key in self._watched:
            self._troubles[key] = why
            self.wake()

    def next_trouble(self) -> tuple[Key, Mapping[str, Any]] | None:
        """Return why no picture comes of one camera, once."""
        return self._troubles.popitem() if self._troubles else None

    def keys(self) -> tuple[Key, ...]:
        """Return the cameras that it watches."""
        return tuple(self._watched)

    def rate_hz(self, key: Key) -> float:
        """Return how often it wants a picture; 0 for not at all."""
        watch = self._watched.get(key)
        return NS_PER_S / watch.period_ns if watch is not None else 0.0

    def waiting(self, now_ns: int) -> int:
        """Return for how long it has left a picture without an answer; 0: it has not."""
        awaited = any(watch.awaited for watch in self._watched.values())
        return now_ns - self._asked_ns if awaited else 0

    def next_picture(self, now_ns: int) -> tuple[ViewedPicture | None, int]:
        """
        Return what it gets now, and then when to ask again.

        :param now_ns: of any clock that never goes back.
        :return: a picture or None; of None also in how many nanoseconds something is due that is
            there already, 0 for nothing.
        """
        keys = list(self._watched)
        soonest_ns = 0
        for place in range(len(keys)):
            # Each in turn, so that one quick camera does not starve the others.
            key = keys[(self._turn + place) % len(keys)]
            watch, picture = self._watched[key], self._gallery.newest(key)
            if picture is None or watch.awaited or picture.n <= watch.sent:
                continue
            # A little early is in time: pictures come with a jitter of their own.
            early_ns = watch.next_ns - now_ns - watch.period_ns // 8
            if early_ns > 0:
                soonest_ns = min(soonest_ns or early_ns, early_ns)
                continue
            self._turn = (self._turn + place + 1) % len(keys)
            if watch.sent:
                self.skipped += picture.n - watch.sent - 1
            watch.sent = watch.awaited = picture.n
            # On a grid while pictures keep up; after a pause the grid begins again.
            watch.next_ns = watch.period_ns + (
                watch.next_ns if watch.next_ns + watch.period_ns > now_ns else now_ns)
            self._asked_ns = now_ns
            self.sent += 1
            return picture, 0
        return None, soonest_ns


class Gallery:
    """
    The newest picture of each camera.

    :param on_wanted: called with a robot when what is wanted of its cameras may have changed.
    :ivar pictures: taken so far.
    :ivar troubles: why no picture comes of a camera.
    """

    def __init__(self, on_wanted: Callable[[str], None]) -> None:
        self.pictures = 0
        self.viewers: set[Viewer] = set()
        self._on_wanted = on_wanted
        self.troubles: dict[Key, Mapping[str, Any]] = {}
        self._newest: dict[Key, ViewedPicture] = {}
        self._counts: dict[Key, int] = {}

    def open_viewer(self, wake: Callable[[], None]) -> Viewer:
        """Return a new viewer; end it by :meth:`close_viewer`."""
        viewer = Viewer(self, wake)
        self.viewers.add(viewer)
        return viewer

    def close_viewer(self, viewer: Viewer) -> None:
        """Remove a viewer; may be called twice."""
        self.viewers.discard(viewer)
        for robot in {robot for robot, _ in viewer.keys()}:
            self.changed(robot)

    def changed(self, robot: str) -> None:
        """Notify that the watched cameras have changed."""
        looked_at = {key for viewer in self.viewers for key in viewer.keys()}
        for key in [key for key in self._newest if key[0] == robot and key not in looked_at]:
            # A later viewer would treat it as new; besides, it shows people.
            del self._newest[key]
        for key in [key for key in self.troubles if key[0] == robot and key not in looked_at]:
            del self.troubles[key]
        self._on_wanted(robot)

    def wanted(self, robot: str) -> dict[str, float]:
        """Return the requested pictures per second of each camera of a robot."""
        rates: dict[str, float] = {}
        for viewer in self.viewers:
            for key in viewer.keys():
                if key[0] == robot:
                    rates[key[1]] = max(rates.get(key[1], 0.0), round(viewer.rate_hz(key), 3))
        return rates

    def next_n(self, key: Key) -> int:
        """Return the number of the next picture of a camera."""
        return self._counts.get(key, 0) + 1

    def put(self, picture: ViewedPicture) -> int:
        """
        Store a picture in place of the one before.

        :return: the number of viewers; with none it is not stored.
        """
        self.pictures += 1
        self.troubles.pop(picture.key, None)
        looking = [viewer for viewer in self.viewers if picture.key in viewer.keys()]
        if looking:
            self._counts[picture.key] = picture.n
            self._newest[picture.key] = picture
        for viewer in looking:
            viewer.wake()
        return len(looking)

    def trouble(self, key: Key, why: Mapping[str, Any]) -> None:
        """
        Notify the viewers of a camera why there are no pictures.

        :param why: ``text`` and its ``codes``; an empty text means that pictures arrive again.
        """
        if not why['text'] or not any(key in viewer.keys() for viewer in self.viewers):
            self.troubles.pop(key, None)
            return
        self.troubles[key] = why
        for viewer in self.viewers:
            viewer.trouble(key, why)

    def newest(self, key: Key) -> ViewedPicture | None:
        """Return the newest picture of a camera."""
        return self._newest.get(key)

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

"""The camera in the simulated world: what its pictures show."""

from __future__ import annotations

from collections.abc import Iterator
import math
import os
from pathlib import Path
import select
import struct
import time
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.devices.camera.driver import Camera
from rt_robot_os.devices.camera.simulated import SimulatedCamera
from rt_robot_os.devices.capture.room_view import RoomView
from rt_robot_os.devices.capture.scene_memory import SceneMemory
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing.fakes import bind
from rt_robot_os.testing.fakes import settings_of

SHIRT, OTHER_SHIRT = (196, 52, 48), (48, 92, 176)


@pytest.fixture
def room(tmp_path: Path) -> str:
    """Give a room of 6 x 4 m with a pillar of 1 x 1 m at (2, 1.5)."""
    cells = np.full((82, 122), 100, dtype=np.int8)
    cells[1:-1, 1:-1] = 0
    cells[61:81, 91:111] = 100
    GridMap(cells, 0.05, (-3.05, -2.05, 0.0)).save(tmp_path / 'room.yaml')
    return str(tmp_path / 'room.yaml')


def scene(room: str = '', **changes: Any) -> dict[str, Any]:
    return {'map': room, 'camera': [-2.0, 0.0, 0.9, 0.0, 0.0], 'ceiling': 2.4, 'lux': 400.0,
            'people': [], **changes}


def of_colour(picture: Any, colour: tuple[int, int, int]) -> Any:
    """Find the pixels of a hue, however bright."""
    bright = picture.astype(float) / max(colour)
    share = np.array(colour) / max(colour)
    level = picture.max(axis=2, keepdims=True) / 255.0 + 1e-9
    return np.abs(bright * max(colour) / 255.0 / level - share).max(axis=2) < 0.04


def test_the_room_has_walls_between_ceiling_and_floor(room: str) -> None:
    picture = RoomView(320, 240).picture(scene(room)).astype(int)
    assert picture.shape == (240, 320, 3)
    ceiling, wall, floor = picture[2, 160], picture[110, 150], picture[236, 160]
    assert abs(ceiling[0] - ceiling[2]) < 10          # white
    assert floor[0] > 1.7 * floor[2]                  # wood
    assert wall[0] > wall[2] and wall[2] > floor[2]   # cream
    # The wall 5 m ahead ends 0.9 m below the eye.
    focal = 160 / math.tan(math.radians(31.0))
    edge = 120 + focal * 0.9 / 5.0
    column = picture[:, 200]
    changes = np.flatnonzero(np.abs(np.diff(column.sum(axis=1))) > 60)
    assert np.abs(changes - edge).min() < 1.6


def test_a_person_is_where_they_stand_and_as_large_as_they_are_near(room: str) -> None:
    view = RoomView(320, 240)
    near, far = (of_colour(view.picture(scene(room, people=[[x, 0.3]])), SHIRT)
                 for x in (0.0, 2.5))
    assert near.sum() > 3 * far.sum() > 100
    columns = np.nonzero(near)[1]
    focal = 160 / math.tan(math.radians(31.0))
    assert columns.mean() == pytest.approx(160 - focal * 0.3 / 2.0, abs=1.5)
    assert not of_colour(view.picture(scene(room)), SHIRT).any()
    assert not of_colour(view.picture(scene(room, people=[[-2.9, 0.0]])), SHIRT).any()


def test_a_wall_hides_a_person_and_a_nearer_person_another(room: str) -> None:
    view = RoomView(320, 240)
    behind = view.picture(scene(room, people=[[2.9, 1.8]]))
    assert (behind == view.picture(scene(room))).all()
    both = view.picture(scene(room, people=[[0.0, 0.0], [2.0, 0.0]]))
    assert of_colour(both, SHIRT).sum() > 10 * of_colour(both, OTHER_SHIRT).sum()


def test_pictures_are_the_same_each_time_and_dark_without_light(room: str) -> None:
    seen = scene(room, people=[[1.0, 0.2]])
    bright, again = (RoomView(160, 120).picture(seen) for _ in range(2))
    assert (bright == again).all()
    dark = RoomView(160, 120).picture({**seen, 'lux': 0.0})
    assert 0.0 < dark.mean() < 0.2 * bright.mean()


def test_a_calibration_and_a_pitch_are_seen(room: str) -> None:
    wide = RoomView(320, 240, (150.0, 0.0, 160.0, 0.0, 150.0, 120.0, 0.0, 0.0, 1.0))
    person = {'people': [[0.0, 0.0]]}
    usual = of_colour(RoomView(320, 240).picture(scene(room, **person)), SHIRT)
    smaller = of_colour(wide.picture(scene(room, **person)), SHIRT)
    assert smaller.sum() < 0.5 * usual.sum()
    down = of_colour(RoomView(320, 240).picture(
        scene(room, camera=[-2.0, 0.0, 0.9, 0.0, 0.2], **person)), SHIRT)
    assert np.nonzero(down)[0].mean() < np.nonzero(usual)[0].mean() - 20


@pytest.mark.parametrize('camera', [
    [0.0, 0.0, 0.9, 9.0, 0.0], [50.0, 50.0, 0.9, 0.0, 0.0], [2.0, 1.5, 0.9, 0.0, 0.0],
    [0.0, 0.0, 5.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.4], [0.0, 0.0, 0.9, 0.0, -1.4]])
def test_from_anywhere_there_is_a_picture(room: str, camera: list[float]) -> None:
    for given_map in (room, ''):
        people = [[camera[0], camera[1]], [camera[0] + 0.2, camera[1]]]
        picture = RoomView(64, 48).picture(scene(given_map, camera=camera, people=people))
        assert picture.shape == (48, 64, 3)


# ---- what its process is told -------------------------------------------------------------------

@pytest.fixture
def memory() -> Iterator[SceneMemory]:
    made = SceneMemory.create()
    yield made
    made.close()
    made.close()


@given(st.lists(st.dictionaries(st.text(max_size=5), st.floats(allow_nan=False), max_size=3),
                min_size=1, max_size=5))
def test_the_last_scene_is_read_by_another(scenes: list[dict[str, float]]) -> None:
    memory = SceneMemory.create()
    other = SceneMemory(os.dup(memory.fd))
    assert other.read() is None
    for each in scenes:
        memory.write(each)
        assert other.read() == each
    other.close()
    memory.close()


def test_half_a_scene_is_none(memory: SceneMemory) -> None:
    memory.write({'a': 1})
    other = SceneMemory(os.dup(memory.fd))
    struct.pack_into('<Q', memory._map, 0, 3)  # its writer is at it, or died there
    assert other.read() is None
    other.close()
    with pytest.raises(ValueError, match='a scene of'):
        memory.write({'a': 'x' * 20_000})


def test_a_camera_driver_gets_pictures_of_the_world(tmp_path: Path, room: str) -> None:
    world = World(WorldSettings(map=room, start=(-2.0, 0.0, 0.0), light_lux=400.0,
                                people=('anna 0 0.5 0.0',)))
    settings = settings_of(Camera, port=str(tmp_path / 'camera'), width=160, height=120,
                           output_rate_hz=200.0, mounting_m=[0.0, 0.0, 0.9])
    simulated = SimulatedCamera.made_for('camera', {}, RobotSite(tmp_path, world), settings)
    driver = Camera('camera', settings)
    publishers = bind(driver)
    began_ns = time.monotonic_ns()
    images = publishers[0].samples

    def until(shown: bool) -> None:
        deadline = time.monotonic() + 60
        del images[:]
        while not (images and bool(of_colour(np.asarray(images[-1].data).reshape(120, 160, 3),
                                             SHIRT).any()) == shown):
            assert time.monotonic() < deadline
            simulated.pump(time.monotonic_ns())
            select.select([driver.fileno()], [], [], 0.02)
            driver.read(time.monotonic_ns())

    try:
        simulated.pump(began_ns)
        driver.open()
        until(True)
        world.inject('person anna 0.5 -1.8'.split())
        until(False)
    finally:
        driver.close()
        simulated.close()


@pytest.mark.parametrize('changes', [
    {'mounting_rad': [0.0, 0.3, 0.5]},
    {'body_frame_id': '', 'mounting_rad': [-math.pi / 2 - 0.3, 0.0, -math.pi / 2 + 0.5]}])
def test_it_looks_where_its_frame_looks(tmp_path: Path, changes: dict[str, Any]) -> None:
    world = World(WorldSettings(map='open', start=(1.0, 2.0, 0.2)))
    settings = settings_of(Camera, port='x', mounting_m=[0.1, 0.0, 0.9], **changes)
    simulated = SimulatedCamera('camera', {}, tmp_path / 'camera', Site(world, settings))
    x, y, height, yaw, pitch = simulated.scene()['camera']
    assert (x, y, height) == pytest.approx((1.0 + 0.1 * math.cos(0.2), 2.0 + 0.1 * math.sin(0.2),
                                            0.9))
    assert (yaw, pitch) == pytest.approx((0.7, 0.3))
    simulated.close()

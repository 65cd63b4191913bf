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

"""A robot with a camera and a microphone as its user starts it: simulated, seen from ROS."""

from __future__ import annotations

from collections.abc import Callable
import io
import os
from pathlib import Path
import signal
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rt_robot_os.devices.capture.pattern import number_of  # noqa: E402, I100
from sensor_msgs.msg import CameraInfo  # noqa: E402
from sensor_msgs.msg import CompressedImage  # noqa: E402
from sensor_msgs.msg import Image  # noqa: E402
from sensor_msgs.msg import TimeReference  # noqa: E402
from std_msgs.msg import Float32  # noqa: E402
from std_msgs.msg import Int16MultiArray  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    devices: [camera, microphone]
    camera:
      type: camera
      port: sim
      width: 320
      height: 240
      output_rate_hz: 20.0
      read: interrupt
      rate_hz: 20.0
      timeout_s: 1.0
      retry_s: 0.1
      sim: {faults: []}
    microphone: {type: microphone, port: sim, channels: 2, read: interrupt, rate_hz: 20.0}
    mirrors: [image, info, samples, level, time]
    image: {topic: camera/image_raw}
    info: {topic: camera/camera_info}
    samples: {topic: sound/samples}
    level: {topic: sound/level}
    time: {topic: sound/time}
"""


def stamp(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def number(message: Any) -> int:
    return number_of(np.array(message.data, np.uint8).reshape(message.height, message.width, 3))


def workers(world: Any) -> list[int]:
    """Give the processes that capture for this robot."""
    found = []
    for each in Path('/proc').iterdir():
        try:
            if (each.name.isdigit() and b'-m\0rt_robot_os.devices.capture.worker' in (
                    each / 'cmdline').read_bytes()
                    and os.fsencode(world.folder) in (each / 'environ').read_bytes()):
                found.append(int(each.name))
        except OSError:
            continue
    return found


def test_pictures_and_sound_are_seen_from_ros(world: Any, until: Until) -> None:
    images, infos = world.listen(Image, '/camera/image_raw'), world.listen(
        CameraInfo, '/camera/camera_info')
    sounds, levels = world.listen(Int16MultiArray, '/sound/samples'), world.listen(
        Float32, '/sound/level')
    times = world.listen(TimeReference, '/sound/time')
    robot = world.robot(ROBOT)
    until(lambda: len(images) > 12 and len(sounds) > 30 and len(times) > 30 and levels,
          'pictures and sound')
    first = images[0]
    assert (first.width, first.height, first.step, first.encoding) == (320, 240, 960, 'rgb8')
    assert first.header.frame_id == 'camera_optical_frame'
    shown = [number(image) for image in list(images)[:12]]
    assert shown == sorted(set(shown)), 'each picture once, and in order'
    taken = [stamp(image) for image in list(images)]
    assert all(a < b for a, b in zip(taken, taken[1:]))
    # Who synchronises them wants equal stamps.
    until(lambda: len({stamp(i) for i in list(infos)} & {stamp(i) for i in list(images)}) > 6,
          'pictures with their calibrations')
    assert infos[0].k[0] == 0.0
    block = sounds[-1]
    assert [(d.label, d.size, d.stride) for d in block.layout.dim] == [
        ('frames', 960, 1920), ('channels', 2, 2)]
    samples = np.array(block.data).reshape(960, 2)
    assert (samples[:, 0] == samples[:, 1]).all()
    assert levels[-1].data == pytest.approx(-12.0, abs=0.1)
    assert times[-1].source == 'microphone_link'
    assert robot.end() == 0
    assert world.leftovers() == []


def test_a_capture_that_crashes_or_is_unplugged_comes_back_and_others_run(
        world: Any, until: Until) -> None:
    images, levels = world.listen(Image, '/camera/image_raw'), world.listen(
        Float32, '/sound/level')
    robot = world.robot(ROBOT.replace(
        'faults: []', "faults: ['crash at 1 for 0.2', 'unplug at 3 for 0.5', "
        "'crash at 12 for 0.2', 'unplug at 18 for 0.5']"))
    robot.wait_for_line('its capture process ended without a message')
    heard = len(levels)
    robot.wait_for_line("active again after 'its capture process ended")
    until(lambda: len(levels) > heard + 10, 'sound')
    robot.wait_for_line('does not exist: check the cable and the path')
    seen = len(images)
    until(lambda: len(images) > seen + 3, 'pictures again')
    assert robot.end() == 0


def test_a_camera_that_is_not_there_is_told_and_the_rest_runs(world: Any, until: Until) -> None:
    levels = world.listen(Float32, '/sound/level')
    robot = world.robot(ROBOT.replace('port: sim\n', 'port: /dev/video991\n').replace(
        '      sim: {faults: []}\n', ''))
    robot.wait_for_line('/dev/video991 does not exist: check the cable and the path')
    until(lambda: len(levels) > 10, 'sound')
    assert robot.end() == 0


def test_a_folder_of_pictures_is_captured_by_a_process_of_its_own(
        world: Any, until: Until) -> None:
    pillow = pytest.importorskip('PIL.Image', reason='Pillow is not installed')
    folder = world.folder / 'pictures'
    folder.mkdir()
    for value in range(12):
        picture = np.full((240, 320, 3), 20 * value, np.uint8)
        pillow.fromarray(picture).save(folder / f'p{value}.png')
    packed = world.listen(CompressedImage, '/camera/jpeg')
    robot = world.robot(ROBOT.replace(
        'port: sim\n', f'port: {folder}\n', 1).replace(
        '      sim: {faults: []}\n',
        "      topic: ''\n      compressed_topic: camera/jpeg\n").replace(
        'image: {topic: camera/image_raw}', 'image: {topic: camera/jpeg}'))
    until(lambda: len(packed) > 15, 'pictures')
    values = [int(np.asarray(pillow.open(io.BytesIO(bytes(m.data)))).mean().round()) // 20
              for m in list(packed)]
    assert packed[0].format == 'jpeg'
    # Numbers in names count as numbers; a picture may be missing where the machine is busy.
    assert set(values) <= set(range(12)) and len(set(values)) > 6
    for pid in workers(world):  # the process is killed: the host starts another one
        os.kill(pid, signal.SIGKILL)
    robot.wait_for_line('its capture process ended without a message')
    seen = len(packed)
    until(lambda: len(packed) > seen + 5, 'pictures again')
    assert robot.end() == 0
    assert [left for left in world.leftovers() if 'pictures' not in left] == []

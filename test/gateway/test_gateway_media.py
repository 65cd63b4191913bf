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

"""From the camera of a core over a gateway to the server: live pictures, and files of alarms."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import closing
import json
from pathlib import Path
import threading
import time
from typing import Any

from fake_robot import token_of
from media_peer import MediaPeer
from monitor_server import logged_in
from monitor_server import quick_services
from monitor_server import served
from processes import in_a_folder
from processes import start_core
from processes import TIMEOUT_S
from processes import wait_until
import pytest

pytest.importorskip('PIL', reason='Pillow is not installed')
pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

from rt_robot_os.gateway.gateway import Gateway  # noqa: E402
from rt_robot_os.gateway.settings import GatewaySettings  # noqa: E402
from rt_robot_os.link.client import LinkClient  # noqa: E402
from rt_robot_os.messages.cdr import string_message  # noqa: E402
from rt_robot_os.sim.commands import send_command  # noqa: E402

YAML = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    devices: [camera]
    camera:
      {type: camera, port: sim, width: 160, height: 120, output_rate_hz: 20.0, topic: '',
       compressed_topic: camera/image_raw/compressed, observe_topic: camera/observe,
       observed_topic: camera/observed, observations_folder: FOLDER/observations, rate_hz: 50.0,
       priority: 20}
    modules: [observer]
    observer: {type: observer, rate_hz: 20.0, priority: 20}
    topics: [order]
    order: {topic: agent/observe, message: std_msgs/msg/String, tail: 800}
"""


class Robot:
    """A core with a camera."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / 'robot.yaml').write_text(YAML.replace('FOLDER', str(folder)))
        self.process = start_core(folder)

    def send_command(self, **command: Any) -> None:
        with LinkClient(self.folder / 'robot.sock', 'test') as client:
            client.publish(client.advertise('agent/observe'),
                           string_message(json.dumps(command)))

    def close(self) -> None:
        self.process.terminate()
        self.process.wait(TIMEOUT_S)


@pytest.fixture(scope='module')
def robot() -> Iterator[Robot]:
    with in_a_folder(Robot) as found:
        yield found


class Running:
    """A gateway in a thread."""

    def __init__(self, robot: Robot, address: str, token: str, folder: Path) -> None:
        path = folder / 'token'
        path.write_text(token)
        path.chmod(0o600)
        self.gateway = Gateway(GatewaySettings(
            server=f'ws://{address}', token_file=str(path), people=('anna',),
            observations_folder=str(robot.folder / 'observations')), 'robot',
            robot.folder / 'robot.sock', folder / 'files', lambda line: None)
        self._ended = threading.Event()
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self.gateway.run(self._ended.is_set)))
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()


@pytest.fixture
def monitor(tmp_path: Path) -> Iterator[Any]:
    folder = tmp_path / 'monitor'
    folder.mkdir()
    services = quick_services(folder)
    with served(services) as address:
        yield address, services, token_of('robot')


def test_pictures_come_while_somebody_looks_and_files_come_once(
        robot: Robot, monitor: Any, tmp_path: Path) -> None:
    address, services, token = monitor
    wait_until(lambda: (robot.folder / 'robot.sock').exists(), 'the core')
    with closing(Running(robot, address, token, tmp_path)) as running:
        wait_until(lambda: any(each.about.get('cameras') == ['camera'] and each.connected
                               for each in services.hub.robots.values()), 'the greeting')
        name = next(iter(services.hub.robots))
        _look(address, name, logged_in(services))
        wait_until(lambda: not services.media.gallery.viewers, 'the end of looking')
        robot.send_command(order='picture', alarm='a1', subject='anna')
        robot.send_command(order='clip', alarm='a1', subject='anna', before_s=1.0, after_s=0.2)
        wait_until(lambda: running.gateway.statistics()['files_sent'] == 2, 'the answers')
        wait_until(lambda: running.gateway.statistics()['files_waiting'] == 0, 'the tidying')
        assert services.media.files.counts().files == 2
    # What is observed while there is no gateway is found by the next, and nothing twice.
    robot.send_command(order='picture', alarm='a2', subject='anna')
    folder = robot.folder / 'observations'
    wait_until(lambda: len(list(folder.glob('observed_*'))) == 3, 'the file')
    with closing(Running(robot, address, token, tmp_path)):
        wait_until(lambda: services.media.files.counts().files == 3, 'the third file')


def test_why_a_camera_gives_no_picture_is_what_its_device_says(
        robot: Robot, monitor: Any, tmp_path: Path) -> None:
    address, services, token = monitor
    wait_until(lambda: (robot.folder / 'robot.sock').exists(), 'the core')
    with closing(Running(robot, address, token, tmp_path)):
        wait_until(lambda: any(each.about.get('cameras') == ['camera'] and each.connected
                               for each in services.hub.robots.values()), 'the greeting')
        send_command(robot.folder / 'robot', 'camera unplug 600')
        with closing(MediaPeer(address, '/camera', logged_in(services))) as browser:
            name = next(iter(services.hub.robots))
            browser.say('look', robot=name, camera='camera', rate_hz=20.0)
            assert browser.next('gone')['text']


def _look(address: str, robot: str, me: dict[str, str]) -> None:
    with closing(MediaPeer(address, '/camera', me)) as browser:
        browser.say('look', robot=robot, camera='camera', rate_hz=20.0)
        numbers, ages_ns = [], []
        for _ in range(5):
            picture = browser.next('picture')
            ages_ns.append(time.time_ns() - picture['utc_ns'])
            numbers.append(picture['n'])
            assert picture['payload'][:3] == b'\xff\xd8\xff'
            browser.say('taken', robot=robot, camera='camera', n=picture['n'])
        assert numbers == sorted(set(numbers))
        # Each has its moment, in the past: a test says nothing of how quick a machine is.
        assert all(0 < age_ns < 60_000_000_000 for age_ns in ages_ns)

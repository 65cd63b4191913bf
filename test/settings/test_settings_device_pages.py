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


"""The pages of the devices: their examples are configurations that load as they stand."""

from __future__ import annotations

from pathlib import Path
import re

import pytest

from rt_robot_os.base import features
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.settings import load

pytest.importorskip('sensor_msgs.msg', reason='the ROS 2 messages are not installed')

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {name: place.partition('.')[2].replace('.', '/') for name, place in
           {**{name: f'rt_robot_os.devices.{name}' for name in DRIVERS.names()},
            **features.devices()}.items()}
INDEX = ROOT / 'docs' / 'devices' / 'README.md'
PAGES = sorted({*(ROOT / 'docs' / 'devices').glob('*.md'),
                *(ROOT / 'rt_robot_os').rglob('page.md')} - {INDEX})
EXAMPLES = [(page, number, text) for page in PAGES for number, text in enumerate(
    re.findall(r'^```yaml\n(.*?)^```', page.read_text(encoding='utf-8'), re.M | re.S))]


@pytest.mark.parametrize('page, number, text', EXAMPLES, ids=lambda v: str(getattr(v, 'stem', '')))
def test_an_example_loads(page: Path, number: int, text: str, tmp_path: Path) -> None:
    path = tmp_path / f'{page.stem}_{number}.yaml'
    path.write_text(text, encoding='utf-8')
    robot = load([path])
    assert robot.devices
    for device in robot.devices:
        assert device.port != 'sim', 'the pages are about real devices'
    # With a simulated device in its place the same example runs on any machine.
    ports = {f'{d.name}.port': 'sim' for d in robot.devices if d.port}
    assert all(d.sim is not None for d in load([path], ports).devices if d.port)


def test_pages_name_drivers_that_exist() -> None:
    for page in PAGES:
        named = set(re.findall(r'`type: (\w+)`', page.read_text(encoding='utf-8')))
        assert named and named <= set(DRIVERS.names()), page.name


def test_every_device_has_a_page_beside_its_driver_and_a_row_in_the_index() -> None:
    named = dict(re.findall(r'^\| `(\w+)` \| \[.*\]\((\S+)\) \|$', INDEX.read_text(), re.M))
    assert sorted(named) == sorted(set(DRIVERS.names()) - set(DRIVERS.foreign_names()))
    for name, link in named.items():
        page = (INDEX.parent / link).resolve()
        assert page == ROOT / 'rt_robot_os' / FOLDERS[name] / 'page.md'
        assert f'`type: {name}`' in page.read_text(encoding='utf-8')

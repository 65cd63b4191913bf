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

"""The way of what a robot says through the server to whoever watches it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fake_robot import FakeRobot
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.monitor.services import Services


@pytest.fixture
def services(tmp_path: Path) -> Services:
    return quick_services(tmp_path)


@pytest.fixture
def address(services: Services) -> Iterator[str]:
    with served(services) as found:
        yield found


def test_a_signal_and_an_alarm_of_a_robot_come_to_a_browser(
        address: str, services: Services) -> None:
    with Page(address, logged_in(services)) as page:
        assert page.next('state')['robots'] == []
        with FakeRobot(f'ws://{address}') as robot:
            assert page.next('robot')['connected'] is True
            page.say(kind='watch', robot='robot', signals=['health/anna/*'], rate_hz=10)
            page.say(kind='ping', t=1)
            page.next('pong')
            robot.live(health__anna__pulse=61, speed={})
            robot.wait_for('taken', n=1)
            signals = page.next('signals')['signals']
            assert {name: value for name, (_, value) in signals.items()} == {
                'health/anna/pulse': 61}
            robot.raise_alarm('a1')
            assert page.next('alarm')['id'] == 'a1'

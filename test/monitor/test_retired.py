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

"""A robot whose token was revoked is away by intention: no page waits for it."""

from __future__ import annotations

from pathlib import Path

from fake_robot import FakeRobot
from fake_robot import RobotScript
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
from rt_robot_os.monitor.server import make_services


def test_a_robot_is_retired_with_its_token_and_comes_back_with_another(tmp_path: Path) -> None:
    services = quick_services(tmp_path)
    headers = logged_in(services)
    with served(services) as address, Page(address, headers) as page:
        with FakeRobot(f'ws://{address}'):
            assert page.next('robot', id='robot', connected=True)['retired'] is False
            services.accounts.revoke_robot('robot')
            assert page.next('robot', id='robot', retired=True)
    again = make_services(services.settings)
    # Also after a restart; one that connects is expected from then on.
    assert again.hub.robots['robot'].retired
    _, token = again.accounts.robots.add('other')
    with served(again) as address, Page(address, headers) as page, \
            FakeRobot(f'ws://{address}', token, RobotScript('other')) as other:
        found = page.next('robot', name='other', connected=True)
        assert found['retired'] is False
        other.disconnect()
        assert page.next('robot', name='other', connected=False)['retired'] is False

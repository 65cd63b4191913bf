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

"""A core, a gateway and a monitor: an alarm gets there, its acknowledgement back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.request import Request
from urllib.request import urlopen

from processes import wait_until
import pytest

pytest.importorskip('fastapi', reason='fastapi is not installed')

from fake_robot import token_of  # noqa: E402, I100
from monitor_server import logged_in  # noqa: E402
from monitor_server import quick_services  # noqa: E402
from monitor_server import served  # noqa: E402
from rt_robot_os.monitor.security.roles import Role  # noqa: E402


def event(number: int, what: str) -> dict[str, Any]:
    return {'seq': number, 't_ns': number, 'alarm': '7', 'event': what, 'state': what,
            'level': 'critical', 'subject': 'anna', 'kinds': ['fall'], 'text': 'anna lies there'}


def test_an_alarm_is_at_the_monitor_and_is_acknowledged_from_there(
        core: Any, gateway: Any, tmp_path: Path) -> None:
    core.answers = lambda text: {'command': text, 'ok': True, 'text': 'acknowledged',
                                 'alarm': '7'}
    (tmp_path / 'monitor').mkdir()
    (tmp_path / 'robot.token').write_text(token_of('robot'))
    (tmp_path / 'robot.token').chmod(0o600)
    services = quick_services(tmp_path / 'monitor')
    with served(services) as address:
        headers = logged_in(services, 'mary', Role.CARER, ('*',))

        def ask(path: str, content: Any = None) -> Any:
            data = None if content is None else json.dumps(content).encode()
            request = Request(f'http://{address}/api/{path}', data, {
                **headers, 'Content-Type': 'application/json'})
            with urlopen(request, timeout=30.0) as answer:
                return json.load(answer)

        with gateway(core, url=f'ws://{address}', people=['anna'],
                     token_file=str(tmp_path / 'robot.token')) as made:
            core.publish('alarms/events', event(1, 'raised'))
            wait_until(lambda: made.robot.connected and made.server.connected, 'both')
            alarm, = wait_until(lambda: ask('alarms?open=true'), 'the alarm')
            assert alarm['level'] == 'critical' and alarm['subject'] == 'anna'
            robot = alarm['robot']
            said = ask(f'robots/{robot}/commands', {
                'do': 'alarm', 'args': {'verb': 'acknowledge', 'alarm': '7', 'reason': ''}})
            assert said == {'ok': True, 'text': 'acknowledged'}
            assert core.heard['alarms/command'][-1] == 'acknowledge 7 by mary'
            core.publish('alarms/events', event(2, 'acknowledged'))
            wait_until(lambda: made.statistics()['waiting'] == 0, 'all at the monitor')
            wait_until(lambda: ask(f'alarms/{robot}/7')['state'] == 'acknowledged', 'the state')

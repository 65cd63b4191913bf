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

"""After a robot has lost its journal its new alarms are seen at once, under names used before."""

from __future__ import annotations

from pathlib import Path
import time
from typing import Any

from fake_robot import FakeRobot
from fake_robot import RobotScript
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.monitor.live.robot_state import RobotState

S = 1_000_000_000
NOW_NS = 1_800_000_000 * S


def event(seq: int, what: str = 'raised', state: str = 'raised', **more: Any) -> dict[str, Any]:
    return {'alarm': '1', 'seq': seq, 'event': what, 'state': state, 'subject': 'anna', **more}


@pytest.fixture
def robot() -> RobotState:
    """Return a robot whose alarm 1 of an earlier start was resolved."""
    found = RobotState('r1', 'r1', frozenset({'anna'}), boot='b1')
    found.take_alarm(event(5, acknowledged_by='mary'), NOW_NS, 'b1')
    found.take_alarm(event(9, 'resolved', 'resolved', why='in her chair'), NOW_NS + 5 * S, 'b1')
    found.boot = 'b2'
    return found


def test_an_alarm_of_a_new_journal_is_shown_and_has_nothing_of_the_older_one(
        robot: RobotState) -> None:
    shown = robot.take_alarm(event(1), NOW_NS + 20 * S, 'b2')
    assert shown is not None
    assert (shown['state'], shown['is_open'], shown['opened_ns']) == (
        'raised', True, NOW_NS + 20 * S)
    assert 'why' not in shown
    after = robot.take_alarm(event(2, 'acknowledged', 'acknowledged'), NOW_NS + 30 * S, 'b2')
    assert after is not None and after['state'] == 'acknowledged'
    assert robot.counts['alarm_names_reused'] == 1


@pytest.mark.parametrize('late', [
    (event(5), NOW_NS, 'b1'), (event(5), NOW_NS, 'b2'), (event(5), NOW_NS + S // 10, 'b2'),
    (event(4, 'suspected', 'suspected'), NOW_NS - S, 'b1'),
    (event(9, restored=1), NOW_NS + 90 * S, 'b2'),
    (event(7, 'acknowledged', 'acknowledged'), NOW_NS + 90 * S, 'b2')])
def test_what_is_late_or_repeated_changes_nothing(robot: RobotState, late: Any) -> None:
    assert robot.take_alarm(*late) is None
    assert robot.alarms['1']['state'] == 'resolved'


def test_a_page_sees_the_alarm_of_a_robot_that_lost_its_journal(tmp_path: Path) -> None:
    services = quick_services(tmp_path)
    me = logged_in(services)
    long_ago = {'utc_ns': time.time_ns() - 3600 * S}
    with served(services) as address:
        url = f'ws://{address}'
        first = RobotScript('robot')
        with FakeRobot(url, script=first) as robot:
            robot.keep(*({**first.alarm('1'), **long_ago} for _ in range(3)),
                       {**first.alarm('1', 'resolved', 'resolved'), **long_ago})
        with Page(address, me) as page, FakeRobot(url, script=RobotScript('robot')) as robot:
            robot.raise_alarm('1')
            assert page.next('alarm')['is_open'] is True

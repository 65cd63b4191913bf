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

"""Many who write at once share commits and take turns: nobody is turned away."""

from __future__ import annotations

from contextlib import closing
from contextlib import ExitStack
from pathlib import Path
import sqlite3
import threading

from fake_robot import FakeRobot
from fake_robot import RobotScript
from monitor_server import let_robot_in
from monitor_server import quick_services
from monitor_server import served
from processes import wait_until
import pytest
from rt_robot_os.base.errors import StoreError
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.monitor.server import DATABASE
from rt_robot_os.monitor.store.turns import Turns
from sqlalchemy import Connection
from sqlalchemy import event

ROBOTS = 20


def test_robots_that_reconnect_at_once_share_commits_and_none_is_refused(tmp_path: Path) -> None:
    services = quick_services(tmp_path)
    names = [f'r{number}' for number in range(ROBOTS)]
    for name in names:
        let_robot_in(services, name)
    commits: list[bool] = []

    @event.listens_for(services.store.engine, 'commit')
    def _(connection: Connection) -> None:
        commits.append(connection.get_execution_options().get('writes', False))

    with served(services) as address, ExitStack() as stack:
        with closing(sqlite3.connect(tmp_path / DATABASE)) as other:
            other.isolation_level = None
            other.execute('BEGIN IMMEDIATE')  # a disk that takes a while
            robots = [stack.enter_context(FakeRobot(
                f'ws://{address}', script=RobotScript(name, (name,)))) for name in names]
            batches = [each.script.records(each.script.observation(name, 'pulse_per_min', 60.0))
                       for each, name in zip(robots, names, strict=True)]
            for robot, batch in zip(robots, batches, strict=True):
                robot.send(batch)
        for robot, batch in zip(robots, batches, strict=True):
            robot.wait_for('stored', batch=decode(batch)['batch'], patience_s=60.0)
        assert not [each for robot in robots for each in robot.received
                    if each['kind'] == 'refused']
        wait_until(lambda: {each['id'] for each in services.store.robots()
                            if 'limits' in each['details']} == set(names), 'what all robots said')
        assert sum(commits) < ROBOTS


def test_turns_come_in_the_order_in_which_they_were_asked_for() -> None:
    turns, order, begun = Turns(), [], threading.Semaphore(0)

    def write(number: int) -> None:
        with turns.turn():
            order.append(number)

    threads = [threading.Thread(target=write, args=(number,)) for number in range(20)]
    with turns.turn():
        for number, thread in enumerate(threads):
            thread.start()
            while len(turns._waiting) <= number:
                begun.acquire(timeout=0.001)
    for thread in threads:
        thread.join()
    assert order == list(range(20))


def test_a_turn_that_does_not_come_is_given_up_and_passes_nobody_over() -> None:
    turns = Turns()
    with turns.turn():
        for _ in range(2):
            with pytest.raises(StoreError, match='threads have been writing'), turns.turn(0.001):
                pass
    for _ in range(2):
        with turns.turn(0.001):
            pass
    with pytest.raises(ZeroDivisionError), turns.turn():
        1 / 0
    with turns.turn(0.001):
        pass

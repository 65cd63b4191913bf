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


"""The program `top` as its user meets it: one look, JSON, the live screen, a core that leaves."""

from __future__ import annotations

import json
import signal
from typing import Any

import pytest
from rt_robot_os.link.robots import lock_core

TASK_KEYS = {
    'name', 'new', 'priority', 'state', 'rate_hz', 'declared_hz', 'latency_p50_us',
    'latency_p99_us', 'latency_max_us', 'execution_p50_us', 'execution_p99_us',
    'execution_max_us', 'cpu_percent', 'runs', 'missed', 'deadline_missed', 'overruns', 'aborted',
    'failures', 'budget_exceeded', 'blocked_us', 'last_late_us', 'ran_instead'}


def test_one_look_as_text_and_as_json_with_stable_keys(world: Any) -> None:
    world.start_core()
    seen = world.top('--once', '--wait', '60', '--interval', '0.2')
    assert seen.returncode == 0, seen.stderr
    assert all(name in seen.stdout for name in ('guard', 'link/beat', 'cmd_vel_safe', 'CPU%'))
    answer = world.top('--once', '--json', '--interval', '0.2', '--sort', 'rate_hz')
    document = json.loads(answer.stdout)
    assert set(document) == {'robot', 'at', 'interval_s', 'kernel', 'tasks', 'topics', 'devices',
                             'clients'}
    assert set(document['tasks'][0]) == TASK_KEYS
    assert document['tasks'][0]['name'] == 'guard'  # the fastest
    guard = document['tasks'][0]
    assert guard['declared_hz'] == 100.0 and guard['rate_hz'] > 0.0
    assert document['kernel']['cpu_percent'] > 0.0


def test_a_filter_and_a_part_leave_out_the_rest(world: Any) -> None:
    world.start_core()
    answer = world.top('--once', '--json', '--wait', '60', '--interval', '0.2', '--filter',
                       'link/*', '--part', 'tasks')
    document = json.loads(answer.stdout)
    assert {task['name'].split('/')[0] for task in document['tasks']} == {'link'}
    assert 'topics' not in document
    nothing = world.top('--once', '--wait', '60', '--interval', '0.2', '--filter', 'nosuch',
                        '--part', 'tasks')
    assert nothing.returncode == 2 and not nothing.stdout
    assert "--filter 'nosuch' matches nothing; there are: " in nothing.stderr
    assert 'link/life' in nothing.stderr


def test_bad_use_and_no_core_have_exit_codes_and_say_why(world: Any) -> None:
    (world.folder / 'leftover.sock').touch()
    there = lock_core(world.folder / 'arm.robot.sock')
    nobody = world.top('--once')
    there.release()
    assert nobody.returncode == 1
    assert 'no core answers' in nobody.stderr
    assert 'Running robots: --robot /arm/robot' in nobody.stderr
    assert 'leftover' not in nobody.stderr
    for arguments, what in ((['--sort', 'colour'], 'no such column'),
                            (['--interval', '0'], 'from 0.2 to 60'),
                            ([], 'not a terminal')):
        refused = world.top(*arguments)
        assert refused.returncode == 2 and what in refused.stderr


def test_with_an_old_rich_it_says_how_to_get_it_and_once_still_works(world: Any) -> None:
    (world.folder / 'rich-9.0.dist-info').mkdir()
    (world.folder / 'rich-9.0.dist-info' / 'METADATA').write_text(
        'Metadata-Version: 2.1\nName: rich\nVersion: 9.0\n')
    world.environment['PYTHONPATH'] = f'{world.folder}:{world.environment["PYTHONPATH"]}'
    world.start_core()
    assert world.top('--once', '--wait', '60', '--interval', '0.2').returncode == 0
    terminal = world.terminal()
    code = terminal.end()
    assert code == 2, terminal.seen
    assert 'the live screen needs rich ' in terminal.seen and '(9.0 is installed)' in terminal.seen


class TestLive:
    """The live screen on a pseudo-terminal."""

    @pytest.fixture(autouse=True)
    def _rich(self) -> None:
        pytest.importorskip('rich', reason='rich is not installed')

    def test_it_waits_for_a_core_and_notices_a_new_one(self, world: Any) -> None:
        terminal = world.terminal('--interval', '0.2')
        terminal.wait_for('no core answers')
        core = world.start_core()
        terminal.wait_for('link/beat')
        core.send_signal(signal.SIGKILL)
        core.wait()
        terminal.wait_for('waiting: ')
        world.start_core()
        terminal.wait_for('started again')
        terminal.press('q')
        assert terminal.end() == 0

    def test_keys_choose_what_is_seen(self, world: Any) -> None:
        world.start_core()
        terminal = world.terminal('--interval', '0.2')
        terminal.wait_for('READERS')
        terminal.press('2')
        terminal.wait_for('1-6 tasks')
        terminal.press('fguard\r')
        terminal.wait_for("only 'guard'")
        terminal.press('\x1b')
        terminal.press('s')
        terminal.wait_for('sort: name')
        terminal.press('p')
        terminal.wait_for('PAUSED')
        terminal.press('q')
        assert terminal.end() == 0

    def test_a_terminal_that_grows_shows_more(self, world: Any) -> None:
        world.start_core()
        terminal = world.terminal('--interval', '0.2', size=(60, 20))
        terminal.wait_for('guard')
        assert 'RAN INSTEAD' not in terminal.seen
        terminal.resize(300, 50)  # also with the wide numbers of a busy machine
        terminal.wait_for('RAN INSTEAD')
        terminal.press('q')
        assert terminal.end() == 0

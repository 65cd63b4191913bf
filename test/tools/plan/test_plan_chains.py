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

"""Chains from one task to another: which way, how long at most, and never longer on the kernel."""

from __future__ import annotations

from pathlib import Path
import random
from typing import Any

from plan_tools import random_set
from plan_tools import UNIT_NS
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.chains import ChainRequest
from rt_robot_os.tools.plan.chains import ChainResult
from rt_robot_os.tools.plan.chains import chains_of
from rt_robot_os.tools.plan.given import RobotTasks
from rt_robot_os.tools.plan.program import main
from rt_robot_os.tools.plan.task import Event
from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask

CONFIG = Path(__file__).with_name('plan_robot.yaml')


def timed(name: str, priority: int, period: int, cost: int) -> PlannedTask:
    return PlannedTask(name, priority, period_ns=period, execution_ns=cost)


def released(name: str, priority: int, cost: int | None, *sources: str, **more: Any
             ) -> PlannedTask:
    return PlannedTask(name, priority, execution_ns=cost,
                       events=tuple(Event(source) for source in sources), **more)


def chain(tasks: list[PlannedTask], *names: str, limit_ns: int = 0, **owners: str) -> ChainResult:
    robot = RobotTasks(tuple(tasks), Overhead(), {}, {
        task.name: owners.get(task.name.partition('/')[0], 'module') for task in tasks}, ())
    found, = chains_of([ChainRequest(names, limit_ns)], robot, analyse(tasks))
    return found


def test_each_job_in_between_counts_once_however_many_stages_there_are() -> None:
    tasks = [timed('high', 9, 1000, 100), released('last', 5, 30, 'middle'),
             released('middle', 7, 20, 'first'), timed('first', 6, 1000, 10)]
    found = chain(tasks, 'first', 'last')
    assert [stage.task for stage in found.stages] == ['first', 'middle', 'last']
    # high once, and its own 60; the bounds of the stages one by one have it three times.
    assert found.bound_ns == 160
    assert sum(stage.response_ns or 0 for stage in found.stages) > 300


def test_a_chain_of_high_priority_waits_for_no_lower_task() -> None:
    tasks = [timed('low', 1, 10_000, 5_000), timed('first', 8, 1000, 10),
             released('last', 9, 20, 'first')]
    assert chain(tasks, 'first', 'last').bound_ns == 30


def test_the_way_is_the_shortest_through_those_named() -> None:
    tasks = [timed('a', 9, 1000, 1), released('b', 8, 1, 'a'), released('c', 7, 1, 'a', 'b'),
             released('d', 6, 1, 'c')]
    assert [s.task for s in chain(tasks, 'a', 'd').stages] == ['a', 'c', 'd']
    assert [s.task for s in chain(tasks, 'a', 'b', 'd').stages] == ['a', 'b', 'c', 'd']


def test_a_device_is_its_task_for_bytes_or_the_one_that_is_woken() -> None:
    tasks = [
        timed('sink', 9, 1000, 5), PlannedTask('sink/arrival', 9, execution_ns=5, events=(
            Event('', 1000),)),
        released('brain', 8, 10, 'sink'),
        timed('base', 7, 1000, 5), released('base/arrival', 7, 5, 'brain')]
    owners = {'sink': 'device', 'base': 'device'}
    found = chain(tasks, 'sink', 'base', **owners)
    assert [s.task for s in found.stages] == ['sink/arrival', 'brain', 'base/arrival']
    # Without interrupts the bytes wait for the next poll.
    polled = [task for task in tasks if task.name != 'sink/arrival']
    assert chain(polled, 'sink', 'brain', **owners).bound_ns == 1000 + 15


def test_what_is_not_known_has_no_bound_and_says_why() -> None:
    tasks = [timed('first', 9, 1000, 10), released('last', 8, None, 'first')]
    found = chain(tasks, 'first', 'last', limit_ns=5)
    assert (found.bound_ns, found.late, found.unjudged) == (None, False, True)
    assert found.reason == 'last: its execution time is not known'


def test_those_below_a_chain_that_promise_to_be_seldom_release_a_stage_once_together() -> None:
    low = [timed(f'low{number}', 1, 1000, 10) for number in range(5)]
    promises = [Event(task.name, 900, promised=True) for task in low]
    tasks = [timed('first', 9, 1000, 10), released('last', 7, 30, 'middle'), *low,
             PlannedTask('middle', 8, execution_ns=20, events=(Event('first'), *promises))]
    # The 60 of the chain, and what all five had released when it began: middle, and after it last.
    assert chain(tasks, 'first', 'last').bound_ns == 60 + 50


def test_logical_execution_is_a_pause() -> None:
    tasks = [PlannedTask('first', 9, period_ns=1000, deadline_ns=400, execution_ns=10,
                         logical=True), released('last', 8, 20, 'first')]
    bound_ns = chain(tasks, 'first', 'last').bound_ns
    assert bound_ns is not None and bound_ns >= 420


@pytest.mark.parametrize('names, message', [
    (('first', 'lost'), "there is no task 'lost'"),
    (('last', 'first'), "nothing that 'last' publishes leads to 'first': it releases nothing"),
    (('first', 'both'), "leads to 'both'")])
def test_a_chain_that_is_none_is_told(names: tuple[str, ...], message: str) -> None:
    tasks = [timed('first', 9, 1000, 10), released('last', 8, 1, 'first'),
             PlannedTask('both', 7, execution_ns=1, events=(Event('first', waits=True),))]
    with pytest.raises(ConfigError, match=message):
        chain(tasks, *names)


@pytest.mark.parametrize('seed', range(50))
def test_no_chain_takes_longer_on_the_kernel(seed: int) -> None:
    rng = random.Random(7000 + seed)
    tasks = random_set(rng, rng.randint(2, 5), rng.uniform(0.2, 0.6), levels=rng.choice([3, 20]))
    before = 't0'
    for number in range(rng.randint(1, 4)):
        others = rng.sample([t for t in tasks if t.name != before], rng.choice((0, 1, 1)))
        # A task that publishes in each job may promise just that.
        tasks.append(PlannedTask(
            f'c{number}', rng.randint(1, 20), execution_ns=rng.randint(1, 4) * UNIT_NS,
            events=(Event(before), *(Event(t.name, t.period_ns, promised=bool(t.period_ns))
                                     for t in others))))
        before = f'c{number}'
    found = chain(tasks, 't0', before)
    if found.bound_ns is not None:
        assert 0 < longest_ns(tasks, [s.task for s in found.stages]) <= found.bound_ns, tasks


def longest_ns(tasks: list[PlannedTask], way: list[str]) -> int:
    """Run tasks on the kernel and return the longest time that a chain takes on a way."""
    clock = VirtualClock()
    kernel = Kernel(clock)
    begun: dict[str, int] = {}
    worst = 0

    def job(planned: PlannedTask) -> None:
        nonlocal worst
        name = planned.name
        begun_ns = kernel.task(name).release_ns if name == 't0' else begun.pop(name, -1)
        clock.spend((planned.execution_ns or 0) - 1)
        if name == way[-1] and begun_ns >= 0:
            worst = max(worst, kernel.now_ns() - begun_ns)
        for other in tasks:
            if any(event.source == name for event in other.events):
                if begun_ns >= 0 and (name, other.name) in zip(way, way[1:]):
                    begun.setdefault(other.name, begun_ns)
                kernel.release(kernel.task(other.name))

    for planned in tasks:
        kernel.add_task(planned.name, lambda planned=planned: job(planned),  # type: ignore[misc]
                        priority=planned.priority,
                        rate_hz=1e9 / planned.period_ns if planned.period_ns else None)
    kernel.run(1200 * UNIT_NS)
    assert not kernel.failures
    return worst


def test_the_program_bounds_a_chain_and_judges_its_limit(
        capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')
    given = ['--ros-args', '--params-file', str(CONFIG)]
    assert main(['--chain', 'imu,link/service', *given]) == 0
    assert "chain from 'imu' to 'link/service': at most" in capsys.readouterr().out
    assert main(['--chain', 'imu,link/service=0.01', *given]) == 1
    assert 'more than the limit of 0.010 ms' in ' '.join(capsys.readouterr().out.split())
    for wrong in ('imu', 'imu,guard=x', 'imu,,guard', 'imu,guard=-1'):
        with pytest.raises(SystemExit):
            main(['--chain', wrong, *given])
    capsys.readouterr()
    assert main(['--chain', 'imu,nobody', *given]) == 2
    assert "there is no task 'nobody'" in capsys.readouterr().err

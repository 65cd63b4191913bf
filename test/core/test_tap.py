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

"""What the taps note for a replay: all of it, whole, however late it is collected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rt_robot_os.core import tap
from rt_robot_os.core.app import Core
from rt_robot_os.core.tap_format import A_JOB
from rt_robot_os.core.tap_format import parse_schedule
from rt_robot_os.core.tap_format import SCHEDULE_TOPIC
from rt_robot_os.core.tap_format import ScheduleRecord

MakeCore = Callable[[str], Core]
S = 1_000_000_000
MODULES = """
modules: [often, long]
often: {type: 'core_modules:Noted', rate_hz: 1000.0, priority: 80}
long: {type: 'core_modules:Noted', rate_hz: 1.0, priority: 20, work_us: WORK}
core: {record_bytes: true}
"""


def run(core: Core, duration_ns: int) -> tuple[list[ScheduleRecord], int]:
    """Run a core; give the records of its schedule, and how many it says were dropped."""
    seen = core.bus.subscribe(SCHEDULE_TOPIC, 'test')
    core.prepare_modules()
    core.kernel.run(duration_ns)
    core.taps.drain()
    records: list[ScheduleRecord] = []
    dropped = 0
    while seen.take():
        message = parse_schedule(seen.buffer[:seen.length])
        records += message.records
        dropped = message.dropped
    return records, dropped


def jobs(core: Core, records: list[ScheduleRecord], name: str) -> list[ScheduleRecord]:
    number = [task.name for task in core.kernel.tasks].index(name)
    return [record for record in records if (record.task, record.topic) == (number, A_JOB)]


def steps(core: Core) -> dict[str, int]:
    """Count the jobs of the modules."""
    return {module.name: module.steps for module in core.modules}  # type: ignore[attr-defined]


@pytest.mark.parametrize('work_us', [0, 500_000, 999_000])
def test_no_record_is_lost_while_a_long_job_holds_up_the_lowest_task(
        make_core: MakeCore, work_us: int) -> None:
    core = make_core(MODULES.replace('WORK', str(work_us)))
    found = jobs(core, run(core, 4 * S)[0], 'often')
    assert len(found) == steps(core)['often']
    assert [one.at_ns for one in found] == [100 * S + k * S // 1000 for k in range(len(found))]
    assert core.taps.dropped == 0
    assert not core.kernel.failures


@pytest.mark.parametrize('count', [1023, 1024, 1025, 2048, 5000])
def test_any_number_of_records_is_split_and_arrives(make_core: MakeCore, count: int) -> None:
    core = make_core('core: {record_bytes: true}\ntopics: [p]\n'
                     'p: {message: geometry_msgs/msg/Point}')
    seen = core.bus.subscribe(SCHEDULE_TOPIC, 'test')
    publisher = core.bus.publisher('p')
    for _ in range(count):
        publisher.publish()
    core.taps.drain()
    numbers, complete = [], []
    while seen.take():
        message = parse_schedule(seen.buffer[:seen.length])
        complete.append(message.complete)
        numbers += [record.number for record in message.records]
    assert numbers == list(range(count))
    assert complete == [False] * (len(complete) - 1) + [True]


def test_what_is_lost_is_counted_and_told(make_core: MakeCore, monkeypatch: Any) -> None:
    monkeypatch.setattr(tap, '_PENDING_MOST', 300)
    core = make_core(MODULES.replace('WORK', '500000'))
    records, dropped = run(core, 2 * S)
    arrived = sum(len(jobs(core, records, name)) for name in ('often', 'long'))
    assert 0 < core.taps.dropped == sum(steps(core).values()) - arrived
    assert dropped == core.taps.dropped
    assert [r.text for r in core.reports.since(0)[2] if 'dropped' in r.text]


def test_a_message_that_is_refused_takes_no_other_along(make_core: MakeCore,
                                                        monkeypatch: Any) -> None:
    core = make_core('core: {record_bytes: true}\ntopics: [p]\n'
                     'p: {message: geometry_msgs/msg/Point}')
    seen = core.bus.subscribe(SCHEDULE_TOPIC, 'test')
    publisher = core.bus.publisher('p')
    for _ in range(3000):
        publisher.publish()
    monkeypatch.setattr(tap, 'RECORDS_A_MESSAGE', 1030)  # more than the topic holds
    core.taps.drain()
    received = 0
    while seen.take():
        received += len(list(parse_schedule(seen.buffer[:seen.length]).records))
    assert received == 3000 - 2 * 1030
    assert core.taps.dropped == 2 * 1030

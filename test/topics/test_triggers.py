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


"""Publications that release tasks under a condition."""

from __future__ import annotations

import pytest

from rt_robot_os.base.errors import TopicError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus

pytest.importorskip('std_msgs.msg', reason='needs the ROS 2 message packages')

MS = 1_000_000


class Robot:
    """Two sensors and a task that notes its releases."""

    def __init__(self) -> None:
        self.kernel = Kernel(VirtualClock())
        self.bus = Bus(self.kernel)
        self.seen: list[int] = []
        self.fusion = self.kernel.add_task(
            'fusion', lambda: self.seen.append(self.kernel.now_ns() // MS), priority=80)

    def sensor(self, name: str, rate_hz: float, phase_ms: int = 0) -> None:
        self.bus.declare(name, 'std_msgs/msg/Int64', depth=4)
        publisher = self.bus.publisher(name)

        def job() -> None:
            publisher.msg.data += 1
            publisher.publish()

        self.kernel.add_task(name, job, priority=50, rate_hz=rate_hz, phase_ns=phase_ms * MS)


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_every_fourth_publication_releases(robot: Robot) -> None:
    robot.sensor('imu', 100.0)
    robot.bus.release_every('imu', robot.fusion, 4)
    robot.kernel.run(170 * MS)
    assert robot.seen == [30, 70, 110, 150]
    assert robot.fusion.coalesced == 0


def test_all_of_some_topics_release_once_each_has_something_new(robot: Robot) -> None:
    robot.sensor('imu', 100.0)
    robot.sensor('gps', 25.0, phase_ms=15)
    robot.bus.release_on_all(['imu', 'gps'], robot.fusion)
    robot.kernel.run(150 * MS)
    assert robot.seen == [15, 55, 95, 135]


def test_all_waits_for_the_slower_whatever_comes_first(robot: Robot) -> None:
    robot.sensor('imu', 10.0, phase_ms=5)
    robot.sensor('gps', 100.0)
    robot.bus.release_on_all(['imu', 'gps'], robot.fusion)
    robot.kernel.run(290 * MS)
    assert robot.seen == [5, 105, 205]


def test_a_reader_of_the_newest_sees_one_sample_and_counts_the_others(robot: Robot) -> None:
    robot.sensor('imu', 1000.0)
    reader = robot.bus.subscribe('imu', 'slow', newest=True)
    taken: list[int] = []

    def slow() -> None:
        while reader.take():
            taken.append(reader.msg.data)

    robot.kernel.add_task('slow', slow, priority=5, rate_hz=100.0, phase_ns=9 * MS)
    robot.kernel.run(40 * MS)
    assert taken == [10, 20, 30, 40]
    assert (reader.skipped, reader.lost, reader.reads) == (36, 0, 4)


def test_what_a_reader_of_the_newest_never_looked_at_is_not_lost(robot: Robot) -> None:
    robot.sensor('imu', 1000.0)
    idle = [robot.bus.subscribe('imu', 'idle', newest=newest) for newest in (True, False)]
    robot.kernel.run(100 * MS)
    newest, plain = (each.statistics() for each in idle)
    assert newest.lost == 0 and newest.skipped == plain.lost > 0


@pytest.mark.parametrize('number', [0, -1, 2.5, True])
def test_a_number_that_is_none_is_refused(robot: Robot, number: int) -> None:
    robot.sensor('imu', 100.0)
    with pytest.raises(TopicError, match=f"task 'fusion': every {number!r} must be an integer"):
        robot.bus.release_every('imu', robot.fusion, number)


def test_all_of_nothing_and_all_of_the_same_are_refused(robot: Robot) -> None:
    robot.sensor('imu', 100.0)
    with pytest.raises(TopicError, match='each of them once; given: none'):
        robot.bus.release_on_all([], robot.fusion)
    with pytest.raises(TopicError, match="each of them once; given: 'imu', 'imu'"):
        robot.bus.release_on_all(['imu', 'imu'], robot.fusion)
    with pytest.raises(TopicError, match="no topic 'mag'"):
        robot.bus.release_on_all(['imu', 'mag'], robot.fusion)
    assert not robot.bus.topic('imu').triggers

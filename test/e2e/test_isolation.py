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

"""What happens on the ROS side, or to one device, does not reach the rest of the core."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import signal
from typing import Any

from processes import TIMEOUT_S
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from geometry_msgs.msg import Twist  # noqa: E402
from rt_robot_os.kernel import TaskStatistics  # noqa: E402
from rt_robot_os.link import LinkClient  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, spawn: false}
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 200.0, priority: 40}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist, depth: 8}
    mirrors: [cmd_vel_in, safe_out]
    cmd_vel_in: {topic: cmd_vel, direction: in}
    safe_out: {topic: cmd_vel_safe, direction: out}
"""


def guard_of(client: LinkClient) -> TaskStatistics:
    return next(t for t in client.statistics().tasks if t.name == 'guard')


def start_apart(world: Any, parameters: str = ROBOT) -> tuple[Any, Any, LinkClient]:
    """Start a core by itself, a node that attaches to it, and a client that watches."""
    path = world.folder / 'test.yaml'
    path.write_text(parameters)
    core = world.start('rt_robot_os.core.program', '--ros-args', '--params-file', str(path))
    robot = world.robot(parameters)
    robot.wait_for_line('connected to the core')
    return core, robot, LinkClient(world.folder / 'robot.sock', 'watch', timeout_s=TIMEOUT_S)


def mirrors_of(client: LinkClient, name: str) -> dict[str, Any] | None:
    for entry in client.statistics().clients:
        if entry['name'] == name and entry['mirrors']:
            found: dict[str, Any] = entry['mirrors'][0]
            return found
    return None


def releases_account_for_all(task: TaskStatistics) -> bool:
    return task.releases - task.runs - task.missed in (0, 1)


def test_a_stopped_ros_side_loses_only_its_own_samples(world: Any, until: Until) -> None:
    # Each sample in a packet of its own: a socket of any size is soon full. Not faster, or a busy
    # machine has no time left for the link, which is below the guard.
    _, robot, watch = start_apart(world, ROBOT.replace(
        'rate_hz: 200.0', 'rate_hz: 400.0').replace(
        'spawn: false', 'spawn: false, link_gather_ms: 0.0'))
    with watch:
        until(lambda: mirrors_of(watch, 'robot'), 'the mirror, which is asked for after that')
        before = guard_of(watch)
        robot.process.send_signal(signal.SIGSTOP)
        until(lambda: guard_of(watch).runs > before.runs + 400, '400 more jobs', 60.0)
        during = guard_of(watch)
        assert releases_account_for_all(during)
        # The whole time on the grid, none left out: 2.5 ms each.
        assert during.gap_maximum_ns < 2_500_000 * (during.missed + 2)
        mirror = until(lambda: (m := mirrors_of(watch, 'robot')) and m['full'] and m,
                       'a full socket', 60.0)
        robot.process.send_signal(signal.SIGCONT)
        until(lambda: (m := mirrors_of(watch, 'robot')) and m['sent'] > mirror['sent'] + 20,
              'samples again')
        after = mirrors_of(watch, 'robot')
        assert after is not None and after['full'] + after['lost'] > 0
        assert after['published'] == sum(
            after[k] for k in ('sent', 'full', 'lost', 'skipped', 'limited', 'waiting'))


def test_a_killed_ros_side_leaves_the_core_running_and_a_new_one_connects(
        world: Any, until: Until) -> None:
    core, robot, watch = start_apart(world)
    with watch:
        before = guard_of(watch)
        robot.end(signal.SIGKILL)
        until(lambda: guard_of(watch).runs > before.runs + 200, '200 more jobs')
        assert core.process.poll() is None
        until(lambda: mirrors_of(watch, 'robot') is None, 'the core forgetting the dead client')
        assert releases_account_for_all(guard_of(watch))
        safe = world.listen(Twist, '/cmd_vel_safe')
        world.robot(ROBOT).wait_for_line('connected to the core')
        until(lambda: safe, 'messages through a new node')
    assert core.end() == 0


def test_a_core_started_anew_is_found_again_by_its_node(world: Any, until: Until) -> None:
    core, robot, watch = start_apart(world)
    watch.close()
    assert core.end(signal.SIGTERM) == 0
    robot.wait_for_line('closed the connection')
    safe = world.listen(Twist, '/cmd_vel_safe')
    world.start('rt_robot_os.core.program', '--ros-args', '--params-file',
                str(world.folder / 'test.yaml'))
    until(lambda: safe, 'messages from the new core')


# Soon, and again for machines that have not started the robot by then.
FAULTS = "'{0} at 0.7 for 0.6', '{0} at 4 for 0.6', '{0} at 12 for 0.6', '{0} at 30 for 0.6'"
DEVICES = """
robot:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0}}
    devices: [imu, gps]
    imu: {{type: witmotion, port: sim, rate_hz: 200.0, timeout_s: 0.3, retry_s: 0.1,
          retry_max_s: 0.2, sim: {{faults: [{faults}]}}}}
    gps: {{type: nmea, port: sim, rate_hz: 100.0}}
    mirrors: [imu_data]
    imu_data: {{topic: imu/data}}
"""


@pytest.mark.parametrize(('fault', 'reason'), [
    ('unplug', 'gone'), ('silent', 'silent'), ('garbage', 'no valid frame')])
def test_a_faulty_device_is_named_recovers_and_never_delays_the_other(
        world: Any, until: Until, fault: str, reason: str) -> None:
    imu = world.listen(Imu, '/imu/data')
    robot = world.robot(DEVICES.format(faults=FAULTS.format(fault)))
    robot.wait_for_line(reason)
    seen = len(imu)
    robot.wait_for_line('imu]: active again')
    until(lambda: len(imu) > seen + 20, 'samples after the fault')
    with LinkClient(world.folder / 'robot.sock', 'watch', timeout_s=TIMEOUT_S) as watch:
        statistics = watch.statistics()
    gps = next(d for d in statistics.devices if d['name'] == 'gps')
    assert gps['state'] == 'active' and gps['faults'] == 0
    task = next(t for t in statistics.tasks if t.name == 'gps')
    assert releases_account_for_all(task) and task.failures == 0


def test_a_missing_device_is_reported_with_the_remedy_and_the_other_works(
        world: Any, until: Until) -> None:
    imu = world.listen(Imu, '/imu/data')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    yaml = DEVICES.format(faults='').replace(
        'gps: {type: nmea, port: sim', f'gps: {{type: nmea, port: {world.folder}/nowhere')
    world.robot(yaml)
    until(lambda: len(imu) > 50, 'the other device')

    def status() -> Any:
        return next((s for m in reversed(list(diagnostics)) for s in m.status
                     if s.name == 'robot: device gps'), None)

    until(lambda: (gps := status()) and gps.level == b'\x02' and 'does not exist' in gps.message,
          'diagnostics of the missing device')


def test_a_client_that_talks_nonsense_is_dropped_and_the_robot_runs_on(
        world: Any, until: Until) -> None:
    import socket
    safe = world.listen(Twist, '/cmd_vel_safe')
    robot = world.robot(ROBOT.replace('spawn: false', 'spawn: true'))
    robot.wait_for_line('connected to the core')
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
        stranger.connect(str(world.folder / 'robot.sock'))
        stranger.send(os.urandom(200))
        stranger.settimeout(60)
        while stranger.recv(70_000):
            pass  # until the core hangs up
    robot.wait_for_line('refused')
    seen = len(safe)
    until(lambda: len(safe) > seen + 20, 'messages afterwards')


def test_the_socket_is_for_its_user_alone(world: Any) -> None:
    world.robot(ROBOT.replace('spawn: false', 'spawn: true')).wait_for_line('connected')
    path: Path = world.folder / 'robot.sock'
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700

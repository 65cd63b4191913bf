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

"""
Take the pictures of docs/images from robots that run: top, top_trouble, recording, drive.

    .venv/bin/python scripts/pictures.py [top top_trouble recording drive] [--out docs/images]

Run it on a quiet machine. The picture of `top` is taken of a robot that is well only: no job was
late or lost since the statistics began, and none waited longer than ``--latency-us``; otherwise it
is tried again, and in the end nothing is written. Needs rich, matplotlib and mcap-ros2-support.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import io
import math
import os
from pathlib import Path
import random
import re
import signal
import subprocess
import sys
import tempfile
import time

from rich.console import Console
from rt_robot_os.clients.top.controls import Controls
from rt_robot_os.clients.top.core_source import Source
from rt_robot_os.clients.top.live import drawn
from rt_robot_os.clients.top.live import screen
from rt_robot_os.clients.top.rows import Snapshot
from rt_robot_os.clients.top.screen_layout import Choices
from rt_robot_os.clients.top.snapshot import compare
from rt_robot_os.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.link.paths import socket_path
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.topics import Layout

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / 'docs' / 'examples'
ROBOT = sys.executable, '-m', 'rt_robot_os.clients.ros.program'
RECORD = sys.executable, '-m', 'rt_robot_os.clients.recording.record_program'
START_S, WARM_UP_S, WATCHED_S = 60.0, 5.0, 10.0


@contextmanager
def robot(parameters: Path) -> Iterator[None]:
    """Run a robot by itself: a runtime folder and a ROS domain of its own."""
    with tempfile.TemporaryDirectory(prefix='rtp') as folder:
        os.environ |= {'RT_ROBOT_OS_RUNTIME_DIR': folder, 'ROS_LOG_DIR': f'{folder}/log',
                       'ROS_DOMAIN_ID': str(random.randint(1, 101)),
                       'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
                       'PYTHONPATH': os.pathsep.join([str(ROOT), str(EXAMPLES), os.environ.get(
                           'PYTHONPATH', '')])}
        process = subprocess.Popen(
            [*ROBOT, '--simulate', '--ros-args', '--params-file', str(parameters)],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            wait_for_devices()
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30.0)


def wait_for_devices() -> None:
    """Wait until a robot's devices deliver."""
    deadline_s = time.monotonic() + START_S
    while time.monotonic() < deadline_s:
        try:
            client = LinkClient(socket_path('robot'), 'pictures')
        except LinkError:
            time.sleep(0.2)
            continue
        active = all(each['state'] == 'active' for each in client.statistics().devices)
        client.close()
        if active:
            return
        time.sleep(0.2)
    raise SystemExit('pictures: the robot did not start')


def look(source: Source, interval_s: float = 1.0) -> Snapshot:
    """Look twice."""
    before = source.look()
    time.sleep(interval_s)
    source.pump()
    return compare('robot', source.look(), before)


def save_screen(snapshot: Snapshot, source: Source, path: Path, size: tuple[int, int]) -> None:
    """Draw what a terminal would show."""
    console = Console(record=True, width=size[0], height=size[1], file=io.StringIO(),
                      force_terminal=True, color_system='truecolor')
    lines = screen(snapshot, Controls(Choices(), 1.0), source, '', size)
    console.print(drawn(lines))
    text = console.export_svg(title='ros2 run rt_robot_os top', unique_id=path.stem)
    # No font from elsewhere: whoever looks at it has one of fixed width.
    text = re.sub(r'@font-face \{.*?\}\s*', '', text, flags=re.DOTALL)
    path.write_text(text.replace('Fira Code, monospace', 'DejaVu Sans Mono, monospace'))
    print(path)


def trouble(snapshot: Snapshot, latency_us: float) -> list[str]:
    """Say what is wrong with a robot that should be well."""
    found = [f'{task.name}: {key} {getattr(task, key)}' for task in snapshot.tasks
             for key in ('deadline_missed', 'missed', 'overruns', 'aborted', 'failures')
             if getattr(task, key)]
    found += [f'{task.name}: {task.latency_max_us:.0f} us late' for task in snapshot.tasks
              if task.priority > 3 and (task.latency_max_us or 0.0) > latency_us]
    return found + [f'{topic.name}: lost {topic.lost}' for topic in snapshot.topics if topic.lost]


def picture_top(path: Path, tries: int, latency_us: float) -> bool:
    """Take the picture of a robot that is well."""
    with robot(ROOT / 'config' / 'robot.yaml'):
        time.sleep(WARM_UP_S)
        for _ in range(tries):
            source = Source(socket_path('robot'))
            source.look()
            with_reset = LinkClient(socket_path('robot'), 'pictures')
            with_reset.request('reset_statistics')
            with_reset.close()
            time.sleep(WATCHED_S)
            snapshot = look(source)
            wrong = trouble(snapshot, latency_us)
            if not wrong:
                source.lines.clear()
                save_screen(snapshot, source, path, (132, 39))
                source.close()
                return True
            print(f'not well, once more: {"; ".join(wrong[:3])}', file=sys.stderr)
            source.close()
    return False


def picture_trouble(path: Path) -> None:
    """Take the picture of a robot in trouble, after its IMU was unplugged and came back."""
    with robot(EXAMPLES / 'trouble.yaml'):
        source = Source(socket_path('robot'))
        source.look()
        time.sleep(14.0)
        save_screen(look(source), source, path, (132, 39))
        source.close()


def roll_pitch_yaw_deg(q: object) -> tuple[float, float, float]:
    """Turn a quaternion into angles that people read."""
    w, x, y, z = (getattr(q, name) for name in 'wxyz')
    return (math.degrees(math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))),
            math.degrees(math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))),
            math.degrees(math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))))


def picture_recording(path: Path, seconds: float) -> None:
    """Record the default robot, and draw the bag as Foxglove's layout shows it."""
    from matplotlib.figure import Figure
    from mcap_ros2.reader import read_ros2_messages
    samples: dict[str, list[tuple[float, object]]] = {}
    with robot(ROOT / 'config' / 'robot.yaml'), tempfile.TemporaryDirectory() as folder:
        time.sleep(WARM_UP_S)
        bag = Path(folder) / 'bag'
        subprocess.run([*RECORD, 'imu/data', 'attitude/imu', 'gps/fix', '-o', str(bag),
                        '--duration', str(seconds)], check=True, stdout=subprocess.DEVNULL)
        for file in sorted(bag.glob('*.mcap')):
            for one in read_ros2_messages(str(file)):
                samples.setdefault(one.channel.topic, []).append(
                    (one.log_time_ns / 1e9, one.ros_msg))
    imu, fixes = samples['/imu/data'], samples['/gps/fix']
    attitude = samples.get('/imu/attitude') or samples['/attitude/imu']
    begin_s = imu[0][0]
    figure = Figure(figsize=(10, 5.2), layout='constrained')
    axes = figure.subplots(2, 2)
    panels = (
        (axes[0][0], 'angular velocity, rad/s', imu, lambda m: [
            getattr(m.angular_velocity, a) for a in 'xyz'], 'xyz'),
        (axes[1][0], 'linear acceleration, m/s²', imu, lambda m: [
            getattr(m.linear_acceleration, a) for a in 'xyz'], 'xyz'),
        (axes[0][1], 'orientation, degrees', attitude,
         lambda m: roll_pitch_yaw_deg(m.orientation), ('roll', 'pitch', 'yaw')))
    for axis, title, messages, values, names in panels:
        times = [at - begin_s for at, _ in messages]
        for name, row in zip(names, zip(*(values(message) for _, message in messages))):
            axis.plot(times, row, linewidth=1.0, label=name)
        axis.set_title(title, loc='left', fontsize=9)
        axis.set_xlabel('s', fontsize=8)
        axis.legend(fontsize=7, loc='lower right', bbox_to_anchor=(1.0, 1.0), ncol=3,
                    frameon=False)
    first = fixes[0][1]
    east = [111_320 * math.cos(math.radians(first.latitude)) * (m.longitude - first.longitude)
            for _, m in fixes]
    north = [111_320 * (m.latitude - first.latitude) for _, m in fixes]
    axes[1][1].plot(east, north, marker='o', markersize=3, linewidth=1.0)
    axes[1][1].set_title('position: north over east, m', loc='left', fontsize=9)
    axes[1][1].set_aspect('equal', adjustable='datalim')
    for axis in figure.axes:
        axis.grid(True, color='#dddddd', linewidth=0.6)
        axis.tick_params(labelsize=8)
    figure.savefig(path, metadata={'Date': None})
    print(path)


def publish_goal(x: float, y: float, heading: float) -> None:
    """Send the service robot to a place on its map."""
    layout = Layout.compile('geometry_msgs/msg/PoseStamped', {'header.frame_id': 'map'})
    cdr = layout.new_buffer()
    pose = layout.view(cdr).pose
    pose.position = x, y, 0.0
    pose.orientation = 0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2)
    with LinkClient(socket_path('robot'), 'pictures') as client:
        client.publish(client.advertise('goal_pose'), bytes(cdr))


def seen_from(pose: object, scan: object) -> list[tuple[float, float]]:
    """Give the points of a scan on the map; the scanner looks ahead, 12 cm before the middle."""
    position, heading = pose.position, math.radians(roll_pitch_yaw_deg(pose.orientation)[2])
    x, y = (position.x + 0.12 * math.cos(heading), position.y + 0.12 * math.sin(heading))
    angles = (heading + scan.angle_min + i * scan.angle_increment
              for i in range(len(scan.ranges)))
    return [(x + r * math.cos(a), y + r * math.sin(a))
            for r, a in zip(scan.ranges, angles) if math.isfinite(r)]


def picture_drive(path: Path, seconds: float) -> None:
    """Let the service robot drive to the bedroom, and draw its way on the map."""
    from matplotlib.figure import Figure
    from mcap_ros2.reader import read_ros2_messages
    grid = GridMap.load(ROOT / 'config' / 'maps' / 'flat.yaml')
    found: dict[str, list[object]] = {}
    with robot(ROOT / 'config' / 'service_robot.yaml'), tempfile.TemporaryDirectory() as folder:
        time.sleep(WARM_UP_S)
        bag = Path(folder) / 'bag'
        recorder = subprocess.Popen([*RECORD, 'pose', 'plan', 'scan', '-o', str(bag),
                                     '--duration', str(seconds)], stdout=subprocess.DEVNULL)
        time.sleep(WARM_UP_S)
        publish_goal(3.2, 6.4, 0.0)
        recorder.wait()
        for file in sorted(bag.glob('*.mcap')):
            for one in read_ros2_messages(str(file)):
                found.setdefault(one.channel.topic.strip('/'), []).append(one.ros_msg)
    left, bottom, right, top = grid.bounds
    figure = Figure(figsize=(7.2, 5.6), layout='constrained')
    axis = figure.subplots()
    axis.imshow(grid.occupied_mask(), origin='lower', cmap='Greys', vmax=1.6,
                extent=(left, right, bottom, top), interpolation='nearest')
    poses = [message.pose.pose for message in found['pose']]
    scan = seen_from(poses[-1], found['scan'][-1])
    axis.plot(*zip(*scan), '.', color='tab:red', markersize=1.5, label='last scan')
    for i, plan in enumerate(found['plan']):
        points = [each.pose.position for each in plan.poses]
        axis.plot([p.x for p in points], [p.y for p in points], color='tab:orange', linewidth=1.0,
                  linestyle='--', label='' if i else 'planned')
    axis.plot([p.position.x for p in poses], [p.position.y for p in poses], color='tab:blue',
              linewidth=2.0, label='driven')
    axis.legend(fontsize=8, loc='upper right')
    axis.set_xlabel('x, m', fontsize=8)
    axis.set_ylabel('y, m', fontsize=8)
    axis.tick_params(labelsize=8)
    figure.savefig(path, metadata={'Date': None})
    print(path)


def main() -> int:
    """Take pictures; the exit code is 1 when the robot was never well."""
    parser = argparse.ArgumentParser(description='Take the pictures of docs/images.')
    names = ('top', 'top_trouble', 'recording', 'drive')
    parser.add_argument('which', nargs='*', choices=[*names, []], default=[], help='default: all')
    parser.add_argument('--out', type=Path, default=ROOT / 'docs' / 'images')
    parser.add_argument('--tries', type=int, default=20)
    parser.add_argument('--latency-us', type=float, default=2000.0,
                        help='longest wait of a task that is still well (default %(default)g)')
    parser.add_argument('--seconds', type=float, default=30.0, help='length of the recording')
    arguments = parser.parse_args()
    wanted = arguments.which or names
    well = True
    if 'recording' in wanted:
        picture_recording(arguments.out / 'recording.svg', arguments.seconds)
    if 'drive' in wanted:
        picture_drive(arguments.out / 'drive.svg', arguments.seconds + 2 * WARM_UP_S)
    if 'top_trouble' in wanted:
        picture_trouble(arguments.out / 'top_trouble.svg')
    if 'top' in wanted:
        well = picture_top(arguments.out / 'top.svg', arguments.tries, arguments.latency_us)
    return 0 if well else 1


if __name__ == '__main__':
    sys.exit(main())

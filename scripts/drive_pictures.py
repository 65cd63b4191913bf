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

"""One recorded drive of the service robot, and two pictures of it: a map, and a scene of the bag."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass
import io
import math
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patches import Polygon
from mcap_ros2.reader import read_ros2_messages
import numpy as np
from PIL import Image
from rt_robot_os.link import LinkClient
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.topics import Layout
from simulated_robot import robot
from simulated_robot import ROOT

RECORD = sys.executable, '-m', 'rt_robot_os.recording.record_program'
TOPICS = 'pose', 'plan', 'scan', 'odom', 'camera/image_raw/compressed'
WARM_UP_S = 5.0
GOAL = 3.2, 6.4, 0.0
# As config/service_robot.yaml has them.
SCANNER_AHEAD_M, ROBOT_RADIUS_M = 0.12, 0.22
# Told apart with any colour vision (Okabe and Ito).
ORANGE, BLUE, GREEN, RED = '#e69f00', '#0072b2', '#009e73', '#d55e00'
DARK, PANEL, GRID, TEXT = '#15151a', '#1f2027', '#2f3240', '#d8dae0'


@dataclass(frozen=True)
class Drive:
    """What a bag holds of one drive: by topic, each message with its time in seconds."""

    messages: dict[str, list[tuple[float, Any]]]

    def of(self, topic: str) -> list[tuple[float, Any]]:
        """Return the messages of a topic, the oldest first."""
        return self.messages[topic]

    def last(self, topic: str, at_s: float) -> Any:
        """Return the newest message of a topic at a time."""
        rows = self.of(topic)
        return rows[max(0, bisect_right(rows, at_s, key=lambda row: row[0]) - 1)][1]

    def track(self) -> list[tuple[float, float, float, float]]:
        """Return the rows (time, x, y, heading) of the robot on the map, in s, m and rad."""
        return [(at_s, *place(message.pose.pose)) for at_s, message in self.of('pose')]

    def moving(self) -> tuple[float, float]:
        """Return when the wheels began to move, and when they stopped."""
        times = [at_s for at_s, message in self.of('odom')
                 if abs(message.twist.twist.linear.x) > 0.02
                 or abs(message.twist.twist.angular.z) > 0.05]
        return times[0], times[-1]


def record_drive(seconds: float) -> Drive:
    """Let the service robot drive to the bedroom, and read the bag of it."""
    found: dict[str, list[tuple[float, Any]]] = {}
    with robot(ROOT / 'config' / 'service_robot.yaml'), tempfile.TemporaryDirectory() as folder:
        time.sleep(WARM_UP_S)
        bag = Path(folder) / 'bag'
        recorder = subprocess.Popen([*RECORD, *TOPICS, '-o', str(bag),
                                     '--duration', str(seconds)], stdout=subprocess.DEVNULL)
        time.sleep(WARM_UP_S)
        publish_goal(*GOAL)
        recorder.wait()
        for file in sorted(bag.glob('*.mcap')):
            for one in read_ros2_messages(str(file)):
                found.setdefault(one.channel.topic.strip('/'), []).append(
                    (one.log_time_ns / 1e9, one.ros_msg))
    return Drive(found)


def publish_goal(x: float, y: float, heading: float) -> None:
    """Send the service robot to a place on its map."""
    layout = Layout.compile('geometry_msgs/msg/PoseStamped', {'header.frame_id': 'map'})
    cdr = layout.new_buffer()
    pose = layout.view(cdr).pose
    pose.position = x, y, 0.0
    pose.orientation = 0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2)
    with LinkClient(socket_path('robot'), 'pictures') as client:
        client.publish(client.advertise('goal_pose'), bytes(cdr))


def place(pose: Any) -> tuple[float, float, float]:
    """Return x, y and heading of a pose in the plane."""
    q = pose.orientation
    heading = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
    return pose.position.x, pose.position.y, heading


def seen_from(x: float, y: float, heading: float, scan: Any) -> list[tuple[float, float]]:
    """Return the points of a scan on the map."""
    x += SCANNER_AHEAD_M * math.cos(heading)
    y += SCANNER_AHEAD_M * math.sin(heading)
    angles = (heading + scan.angle_min + i * scan.angle_increment
              for i in range(len(scan.ranges)))
    return [(x + r * math.cos(a), y + r * math.sin(a))
            for r, a in zip(scan.ranges, angles) if math.isfinite(r)]


def planned(message: Any) -> tuple[list[float], list[float]]:
    """Return the x and y of a path."""
    points = [each.pose.position for each in message.poses]
    return [p.x for p in points], [p.y for p in points]


def draw_robot(axis: Any, x: float, y: float, heading: float, edge: str, face: str) -> None:
    """Draw the robot as a disc with an arrow that points ahead."""
    axis.add_patch(Circle((x, y), ROBOT_RADIUS_M, facecolor=face, edgecolor=edge, linewidth=1.6,
                          zorder=6))
    corners = [(x + 0.8 * ROBOT_RADIUS_M * math.cos(heading + turn),
                y + 0.8 * ROBOT_RADIUS_M * math.sin(heading + turn)) for turn in (0.0, 2.4, -2.4)]
    axis.add_patch(Polygon(corners, color=edge, linewidth=0, zorder=7))


def draw_map(drive: Drive, path: Path) -> None:
    """Draw the drive on the map: the first plan as a band, the way driven on it, the robot."""
    grid = GridMap.load(ROOT / 'config' / 'maps' / 'flat.yaml')
    left, bottom, right, top = grid.bounds
    figure = Figure(figsize=(7.6, 6.2), layout='constrained')
    axis = figure.subplots()
    axis.imshow(grid.occupied_mask(), origin='lower', cmap='Greys', vmax=1.6,
                extent=(left, right, bottom, top), interpolation='nearest')
    track = drive.track()
    _, x, y, heading = track[-1]
    axis.plot(*planned(drive.of('plan')[0][1]), color=ORANGE, linewidth=9.0, alpha=0.55,
              solid_capstyle='round', label='planned, when the goal came')
    axis.plot([row[1] for row in track], [row[2] for row in track], color=BLUE, linewidth=2.0,
              label='driven')
    axis.plot(*zip(*seen_from(x, y, heading, drive.of('scan')[-1][1])), '.', color=RED,
              markersize=1.8, label='last scan')
    axis.plot(*track[0][1:3], 'o', markerfacecolor='white', markeredgecolor=BLUE, markersize=8,
              label='start')
    draw_robot(axis, x, y, heading, BLUE, '#cfe6f5')
    axis.text(x + 0.35, y, 'robot at\nits goal', fontsize=9, va='center')
    figure.legend(*axis.get_legend_handles_labels(), fontsize=9, loc='outside lower center',
                  ncol=4, frameon=False, markerscale=1.5)
    axis.set(xlabel='x, m', ylabel='y, m')
    axis.tick_params(labelsize=8)
    figure.savefig(path, metadata={'Date': None})
    print(path)


def draw_scene(drive: Drive, path: Path) -> None:
    """Draw the bag as a viewer shows it in the middle of the drive: scene, camera and speed."""
    begin_s, end_s = drive.moving()
    at_s = begin_s + 0.45 * (end_s - begin_s)
    figure = Figure(figsize=(11.5, 6.0), facecolor=DARK, layout='constrained')
    figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
    columns = figure.add_gridspec(2, 2, width_ratios=(1.65, 1.0), height_ratios=(1.0, 0.85))
    _scene(figure.add_subplot(columns[:, 0]), drive, at_s)
    _camera(figure.add_subplot(columns[0, 1]), drive, at_s)
    _speed(figure.add_subplot(columns[1, 1]), drive, begin_s, end_s, at_s)
    for axis in figure.axes:
        axis.set_facecolor(PANEL)
        axis.tick_params(colors=TEXT, labelsize=8, length=0)
        for side in axis.spines.values():
            side.set_color(GRID)
    figure.savefig(path, metadata={'Date': None}, facecolor=DARK)
    print(path)


def _scene(axis: Any, drive: Drive, at_s: float) -> None:
    grid = GridMap.load(ROOT / 'config' / 'maps' / 'flat.yaml')
    left, bottom, right, top = grid.bounds
    walls = np.zeros((*grid.occupied_mask().shape, 4))
    walls[grid.occupied_mask()] = (0.62, 0.66, 0.74, 1.0)
    axis.imshow(walls, origin='lower', extent=(left, right, bottom, top), interpolation='nearest',
                zorder=2)
    axis.set(xticks=range(0, 11), yticks=range(0, 9), xticklabels=[], yticklabels=[],
             xlim=(left - 0.3, right + 0.3), ylim=(bottom - 0.3, top + 0.3))
    axis.grid(color=GRID, linewidth=0.7)
    track = [row for row in drive.track() if row[0] <= at_s]
    _, x, y, heading = track[-1]
    axis.plot([row[1] for row in track], [row[2] for row in track], color='#56b4e9', linewidth=2.0,
              zorder=4, label='/pose, until now')
    axis.plot(*planned(drive.last('plan', at_s)), color='#35d07f', linewidth=2.0, zorder=3,
              label='/plan')
    scan = np.array(seen_from(x, y, heading, drive.last('scan', at_s)))
    away = np.hypot(scan[:, 0] - x, scan[:, 1] - y)
    axis.scatter(scan[:, 0], scan[:, 1], c=away, cmap='autumn', s=4, linewidths=0, zorder=5,
                 label='/scan, by distance')
    draw_robot(axis, x, y, heading, '#56b4e9', '#20435a')
    axis.plot(*GOAL[:2], marker='*', color='#f0e442', markersize=12, linestyle='none', zorder=6,
              label='/goal_pose')
    for angle, colour in ((heading, '#ff5555'), (heading + math.pi / 2, '#55ff55')):
        axis.plot([x, x + 0.6 * math.cos(angle)], [y, y + 0.6 * math.sin(angle)], color=colour,
                  linewidth=1.8, zorder=8)
    axis.text(x + 0.34, y - 0.16, 'base_link', color=TEXT, fontsize=8, zorder=8)
    axis.set_title('3D, from above; frame map, grid 1 m', loc='left', fontsize=10, color=TEXT)
    legend = axis.legend(fontsize=8, loc='upper center', bbox_to_anchor=(0.5, -0.01), ncol=4,
                         frameon=False)
    for text in legend.get_texts():
        text.set_color(TEXT)


def _camera(axis: Any, drive: Drive, at_s: float) -> None:
    picture = drive.last('camera/image_raw/compressed', at_s)
    axis.imshow(np.asarray(Image.open(io.BytesIO(bytes(picture.data)))))
    axis.set(xticks=[], yticks=[])
    axis.set_title('Image: /camera/image_raw/compressed', loc='left', fontsize=10, color=TEXT)


def _speed(axis: Any, drive: Drive, begin_s: float, end_s: float, at_s: float) -> None:
    rows: Sequence[tuple[str, Callable[[Any], float], str]] = (
        ('forwards, m/s', lambda m: m.twist.twist.linear.x, '#56b4e9'),
        ('turning, rad/s', lambda m: m.twist.twist.angular.z, ORANGE))
    for label, value, colour in rows:
        points = [(t - begin_s, value(m)) for t, m in drive.of('odom')
                  if begin_s - 1.0 <= t <= end_s + 1.0]
        axis.plot(*zip(*points), color=colour, linewidth=1.2, label=label)
    axis.axvline(at_s - begin_s, color=TEXT, linewidth=0.9, linestyle=':')
    axis.grid(color=GRID, linewidth=0.7)
    axis.set_xlabel('time since the start, s', color=TEXT, fontsize=8)
    axis.set_title('Plot: /odom', loc='left', fontsize=10, color=TEXT)
    legend = axis.legend(fontsize=8, loc='lower left', frameon=False)
    for text in legend.get_texts():
        text.set_color(TEXT)

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
Make docs/images/trajectory.svg: an eight with each tracking law, and a goal at 300 ms.

    PYTHONPATH=. .venv/bin/python scripts/make_trajectory_picture.py

It gives the same picture each time: the robot is simulated, with a lag and a noisy pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
import math
from pathlib import Path
import random

from benchmarks.trajectory.drives import eight
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.controllers import CONTROLLERS
from rt_robot_os.motion.controllers import make_controller
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.follower import Follower
from rt_robot_os.motion.follower_tuning import FollowerTuning
from rt_robot_os.motion.spline import legs
from rt_robot_os.motion.velocity_limits import VelocityLimits
from rt_robot_os.sim.world.drive_base import DriveBase
from rt_robot_os.sim.world_settings import WorldSettings

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / 'docs' / 'images' / 'trajectory.svg'

LAG_S = 0.06
NOISE_M, NOISE_RAD = 0.003, 0.005
COLOURS = {'kanayama': '#0072b2', 'samson': '#009e73', 'regulated_pure_pursuit': '#d55e00',
           'park_kuipers': '#cc79a7'}
WIDTH, HEIGHT = 900, 680
TEXT = 'font-family="sans-serif" font-size="13" fill="#333333"'


def drive(law: str, poses: Sequence[Pose], start: Pose, period_s: float, limits: VelocityLimits,
          tuning: FollowerTuning) -> Iterator[tuple[float, Pose]]:
    """Yield time and pose of the robot until it rests."""
    base = DriveBase(WorldSettings(start=start))
    chance = random.Random(1)
    follower = Follower(make_controller(law), limits, tuning)
    follower.go(poses, start)
    time_s, command = 0.0, (0.0, 0.0)
    base.advance(0)
    while command is not None:
        x, y, yaw = moved(base.pose, base.velocity[0] * LAG_S, base.velocity[1] * LAG_S)
        seen = (x + chance.gauss(0, NOISE_M), y + chance.gauss(0, NOISE_M),
                yaw + chance.gauss(0, NOISE_RAD))
        command = follower.step(seen, period_s, base.velocity)
        linear, angular = command or (0.0, 0.0)
        half = angular * base.wheel_separation_m / 2
        base.set_wheel_speeds((linear - half) / base.wheel_radius_m,
                              (linear + half) / base.wheel_radius_m)
        for _ in range(round(period_s / 0.02)):
            time_s += 0.02
            base.advance(round(time_s * NS_PER_S))
            yield time_s, base.pose


def line(points: Sequence[tuple[float, float]], colour: str, width: float = 1.6) -> str:
    """Return a line through points of the picture."""
    text = ' '.join(f'{x:.1f},{y:.1f}' for x, y in points)
    return f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def label(x: float, y: float, text: str, more: str = '') -> str:
    """Return a text of the picture."""
    return f'<text x="{x:.0f}" y="{y:.0f}" {TEXT} {more}>{text}</text>'


def eights() -> Iterator[str]:
    """Draw the way of each law, and how far it is from the eight."""
    poses = tuple(eight())
    path, = legs(poses, 0.8)
    limits = VelocityLimits(angular_max_rad_s=2.0, lateral_max_m_s2=1.0)
    left, top, scale = 260.0, 150.0, 105.0

    def placed(points: Sequence[Pose]) -> list[tuple[float, float]]:
        return [(left + scale * x, top - scale * y) for x, y, _ in points]

    yield line(placed(poses), '#bbbbbb', 5)
    floor, height, cm = 290.0, 240.0, 34.0
    for step in range(0, 8, 2):
        yield line([(560, floor - cm * step), (880, floor - cm * step)], '#dddddd', 1)
        yield label(552, floor - cm * step + 4, f'{step}', 'text-anchor="end"')
    yield label(560, floor - height - 8, 'away from the path, cm')
    yield label(880, floor + 18, '20 s', 'text-anchor="end"')
    for law in CONTROLLERS:
        ways = list(drive(law, poses, poses[0], 0.02, limits, FollowerTuning()))
        yield line(placed([pose for _, pose in ways[::5]]), COLOURS[law])
        near, away = 0.0, []
        for time_s, (x, y, _) in ways[::10]:
            near = path.nearest(x, y, near)
            px, py = path.at(near)[:2]
            if time_s <= 20.0:
                away.append((560 + 16 * time_s,
                             floor - cm * 100 * min(0.07, math.hypot(px - x, py - y))))
        yield line(away, COLOURS[law])
    for index, law in enumerate(CONTROLLERS):
        yield line([(40 + 210 * index, 320), (64 + 210 * index, 320)], COLOURS[law], 3)
        yield label(70 + 210 * index, 324, law)
    yield label(40, 28, 'an eight of 4 m by 2 m at 0.3 m/s, a step every 20 ms')


def goals() -> Iterator[str]:
    """Draw the way to a goal with a step every 300 ms: turned at first, or on the way."""
    start, goal = (3.44, 1.0, math.radians(120)), (3.44, 2.3, math.radians(90))
    left, top, scale, across = 60.0, 470.0, 600.0, 3000.0
    yield label(40, 372, '1.3 m with a turn of 30 degrees, a step every 300 ms; across 5 times '
                'larger than along')
    yield line([(left, top), (left + 1.3 * scale, top)], '#bbbbbb', 5)
    for step in range(0, 8, 2):
        y = top + 0.01 * step * across
        yield line([(left, y), (left + 1.3 * scale, y)], '#dddddd', 1)
        yield label(left - 6, y + 4, f'{step}', 'text-anchor="end"')
    yield label(left, top + 0.0715 * across - 12, 'to the left of the line, cm; a dot for each step')
    for aside, colour, text in ((0.35, '#0072b2', 'turns in place first'),
                                (0.7, '#d55e00', 'turn_above_rad: 0.7: turns while it drives')):
        ways = list(drive('kanayama', (goal,), start, 0.3, VelocityLimits(),
                          FollowerTuning(turn_above_rad=aside, goal_tolerance_rad=0.01)))
        yield line([(left + (y - 1.0) * scale, top - (x - 3.44) * across)
                    for _, (x, y, _) in ways[::3]], colour)
        for _, (x, y, _) in ways[::15]:
            yield (f'<circle cx="{left + (y - 1.0) * scale:.1f}" '
                   f'cy="{top - (x - 3.44) * across:.1f}" r="3" fill="{colour}"/>')
        offset = 60 if aside < 0.5 else 380
        yield line([(offset, 405), (offset + 24, 405)], colour, 3)
        yield label(offset + 30, 409, f'{text}, {ways[-1][0]:.1f} s')


def main() -> None:
    """Write the picture."""
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
             f'width="{WIDTH}" height="{HEIGHT}">',
             f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>',
             *eights(), *goals(), '</svg>\n']
    PICTURE.write_text('\n'.join(parts), encoding='utf-8')


if __name__ == '__main__':
    main()

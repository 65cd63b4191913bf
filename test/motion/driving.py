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

"""A robot with two motors that lag, driven by a follower: a small stand-in for a world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
import math
import random

from rt_robot_os.motion.controllers import make_controller
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.follower import Follower
from rt_robot_os.motion.follower import Phase
from rt_robot_os.motion.follower_tuning import FollowerTuning
from rt_robot_os.motion.reference_path import Path
from rt_robot_os.motion.velocity_limits import VelocityLimits

STEP_S = 0.005
LAG_S = 0.1


@dataclass
class Drive:
    """
    A run of a follower.

    :ivar held: the robot does not move, whatever is commanded.
    :ivar drift_rad_s: how the floor turns the robot while it moves.
    """

    follower: Follower
    pose: Pose = (0.0, 0.0, 0.0)
    period_s: float = 0.02
    noise: tuple[float, float] = (0.0, 0.0)
    seed: int = 1
    held: bool = False
    velocity: tuple[float, float] = (0.0, 0.0)
    time_s: float = 0.0
    distance_m: float = 0.0
    poses: list[Pose] = field(default_factory=list)
    commands: list[tuple[float, float]] = field(default_factory=list)
    states: list[str] = field(default_factory=list)
    jump: Pose = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def seen(self) -> Pose:
        """Return the pose as a localiser with noise sees it, when a command takes effect."""
        linear, angular = self.velocity
        x, y, yaw = moved(self.pose, linear * LAG_S, angular * LAG_S)
        gauss = self._random.gauss
        return (x + gauss(0, self.noise[0]) + self.jump[0],
                y + gauss(0, self.noise[0]) + self.jump[1],
                yaw + gauss(0, self.noise[1]) + self.jump[2])

    def go(self, *poses: Pose) -> None:
        self.follower.go(poses, self.seen(), self.velocity)

    def run(self, seconds: float = 120.0) -> str:
        """Let the follower steer until it rests, or the time is over."""
        end_s = self.time_s + seconds
        while self.time_s < end_s:
            command = self.follower.step(self.seen(), self.period_s, self.velocity)
            if command is None:
                break
            self._move(command)
            if not self.states or self.states[-1] != self.follower.state:
                self.states.append(self.follower.state)
            self.poses.append(self.pose)
            self.commands.append(command)
        return self.follower.state

    def _move(self, command: tuple[float, float]) -> None:
        share = 1 - math.exp(-STEP_S / LAG_S)
        for _ in range(round(self.period_s / STEP_S)):
            linear, angular = (0.0, 0.0) if self.held else (
                now + (wanted - now) * share for now, wanted in zip(self.velocity, command))
            self.velocity = linear, angular
            self.pose = moved(self.pose, linear * STEP_S, angular * STEP_S)
            self.distance_m += abs(linear) * STEP_S
            self.time_s += STEP_S


def drive(law: str = 'kanayama', start: Pose = (0.0, 0.0, 0.0), period_s: float = 0.02,
          limits: VelocityLimits = VelocityLimits(), noise: tuple[float, float] = (0.0, 0.0),
          seed: int = 1, tuning: FollowerTuning = FollowerTuning()) -> Drive:
    """Make a run of a law."""
    return Drive(Follower(make_controller(law), limits, tuning), start, period_s, noise, seed)


def away_from(path: Path, poses: Sequence[Pose]) -> list[float]:
    """Return how far each pose is from a path, in m."""
    found, near = [], 0.0
    for x, y, _ in poses:
        near = path.nearest(x, y, near)
        px, py = path.at(near)[:2]
        found.append(math.hypot(px - x, py - y))
    return found


def rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values))


def resting(run: Drive) -> bool:
    return run.follower.phase is Phase.REST


def eight(radius_m: float = 1.5, count: int = 400) -> list[Pose]:
    """Return the lemniscate of Gerono as poses with headings along it."""
    angles = [math.tau * i / count for i in range(count + 1)]
    return [(radius_m * math.sin(a), radius_m * math.sin(a) * math.cos(a),
             math.atan2(math.cos(2 * a), math.cos(a))) for a in angles]

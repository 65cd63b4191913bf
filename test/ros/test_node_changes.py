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

"""Changes of a node's parameters are made all or none, each where it is used."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

from rt_robot_os.base.errors import LinkError  # noqa: E402
from rt_robot_os.base.errors import RtRobotError  # noqa: E402
from rt_robot_os.ros.node import RobotNode  # noqa: E402, I100
from rt_robot_os.settings import load  # noqa: E402
from rt_robot_os.settings import RobotParameters  # noqa: E402

YAML = """\
robot:
  ros__parameters:
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 100.0, timeout_s: 0.5}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist}
    mirrors: [safe]
    safe: {topic: cmd_vel_safe}
"""


@dataclass
class Core:
    """What the core is asked to change; after some changes it is gone."""

    lives: int = 99
    asked: list[tuple[str, Any]] = field(default_factory=list)

    def change(self, name: str, value: Any) -> None:
        if not self.lives:
            raise LinkError('the core closed the connection')
        self.lives -= 1
        self.asked.append((name, value))


@dataclass
class Followed:
    """What mirrors are told."""

    refuses: bool = False
    policies: list[str] = field(default_factory=list)

    def follow(self, mirrors: Any) -> None:
        policy = mirrors[0].policy
        if self.refuses and policy == 'latest':
            raise LinkError('no')
        self.policies.append(policy)


class Node(RobotNode):
    """The part of the node that changes parameters, without ROS."""

    def __init__(self, path: Path, core: Core | None) -> None:
        self._robot_parameters = RobotParameters(load([path]))
        self._adopting = False
        self._mirrors = Followed()  # type: ignore[assignment]
        self._supervisor = None
        self.core = core

    def _client(self) -> Any:
        return self.core

    def live(self) -> list[Any]:
        values = self._robot_parameters.live_values()
        return [values[name] for name in ('guard.rate_hz', 'guard.timeout_s', 'safe.policy')]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / 'robot.yaml').write_text(YAML)
    return tmp_path / 'robot.yaml'


def test_the_core_is_asked_for_what_is_its_own(path: Path) -> None:
    node = Node(path, Core())
    node._change({'guard.rate_hz': 50, 'safe.policy': 'latest'})
    assert node.live() == [50.0, 0.5, 'latest']
    assert node.core is not None and node.core.asked == [('guard.rate_hz', 50)]
    assert node._mirrors.policies[-1] == 'latest'  # type: ignore[union-attr]
    assert node.settings.modules[0].rate_hz == 50.0


def test_of_many_changes_a_bad_one_lets_none_happen_and_all_reasons_are_told(path: Path) -> None:
    node = Node(path, Core())
    with pytest.raises(RtRobotError) as refused:
        node._change({'guard.rate_hz': 50.0, 'guard.timeout_s': -1.0, 'safe.policy': 'newest'})
    assert str(refused.value) == (
        'guard.timeout_s = -1.0: must be a number from 0.01 to 60 (s); '
        "safe.policy = 'newest': must be one of drain, latest")
    assert node.live() == [100.0, 0.5, 'drain'] and node.core == Core()


def test_a_core_that_is_gone_half_way_leaves_all_as_it_was(path: Path) -> None:
    node = Node(path, Core(lives=1))
    with pytest.raises(LinkError, match='closed the connection'):
        node._change({'guard.rate_hz': 50.0, 'guard.timeout_s': 0.25})
    assert node.live() == [100.0, 0.5, 'drain']
    assert node.settings.modules[0].rate_hz == 100.0


def test_a_mirror_that_cannot_follow_takes_the_others_back(path: Path) -> None:
    node = Node(path, Core())
    node._mirrors.refuses = True  # type: ignore[union-attr]
    with pytest.raises(LinkError):
        node._change({'guard.rate_hz': 50.0, 'safe.policy': 'latest'})
    assert node.live() == [100.0, 0.5, 'drain']
    assert node.core is not None and node.core.asked[-1] == ('guard.rate_hz', 100.0)


def test_without_a_core_a_change_waits_for_the_next_one(path: Path) -> None:
    node = Node(path, None)
    node._change({'guard.rate_hz': 50.0})
    assert node.live() == [50.0, 0.5, 'drain']

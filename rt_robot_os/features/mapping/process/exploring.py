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

"""Explore: publish frontiers of the map as goals for the planner until none is left."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.engine import Engine
from rt_robot_os.features.mapping.messages import bool_message
from rt_robot_os.features.mapping.messages import goal_message
from rt_robot_os.features.mapping.settings import MappingSettings
from rt_robot_os.features.mapping.slam.exploration import ExplorationSettings
from rt_robot_os.features.mapping.slam.exploration import Explorer
from rt_robot_os.messages.cdr import string_in

# Publishes a message on a topic; returns False when it was not delivered.
Publish = Callable[[str, bytes], bool]


class Exploring:
    """
    An exploration that can be started and stopped.

    :param has: returns whether a topic has subscribers.
    :ivar state: in one line; empty while it does not explore.
    """

    def __init__(self, settings: MappingSettings, engine: Engine, publish: Publish,
                 has: Callable[[str], bool]) -> None:
        self.state = ''
        self._settings = settings
        self._engine = engine
        self._publish = publish
        self._has = has
        self._explorer: Explorer | None = None
        self._planner_state = ''

    def add_planner_state(self, stamp_ns: int, missed: int, cdr: memoryview) -> None:
        """Store the state of the planner; called in the thread of the link."""
        try:
            self._planner_state = string_in(cdr)
        except ValueError:
            self._planner_state = ''

    def begin(self) -> None:
        """
        Start to explore.

        :raises ConfigError: nothing receives the goals.
        """
        settings = self._settings
        if not settings.goal_topic or not self._has(settings.goal_topic):
            raise ConfigError([f'this robot has no topic {settings.goal_topic!r} (goal_topic): '
                               'nothing would drive to the goals'])
        self._explorer = Explorer(ExplorationSettings(
            radius_m=settings.explore_radius_m, least_m=settings.explore_least_m,
            patience_s=settings.explore_patience_s, goes_back=settings.explore_goes_back))
        self.state = self._explorer.state

    @property
    def is_active(self) -> bool:
        """Return whether it was started and is not done."""
        return self._explorer is not None

    def stop(self) -> bool:
        """Stop exploring and the robot; return whether it was exploring."""
        was = self._explorer is not None
        if was and self._settings.cancel_topic:
            self._publish(self._settings.cancel_topic, bool_message(True))
        self._explorer, self.state = None, ''
        return was

    def step(self, now_ns: int) -> None:
        """Continue, if the pose of the robot is known."""
        explorer, here = self._explorer, self._engine.last_pose
        if explorer is None:
            return
        if here is not None and not self._engine.is_paused:
            goal = explorer.step(now_ns, self._engine.grid, here[0], self._planner_state)
            if goal is not None:
                self._publish(self._settings.goal_topic, goal_message(goal))
        self.state = explorer.state
        if explorer.is_done:
            self._explorer = None

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        if self._explorer is None:
            return {}
        return {f'explore_{key}': value for key, value in self._explorer.counts.items()}

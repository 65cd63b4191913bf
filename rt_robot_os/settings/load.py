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


"""The way in: files and command line to checked settings, or every problem at once."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import replace
import os
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.files import read_files
from rt_robot_os.settings.files import read_overrides
from rt_robot_os.settings.installed import installed
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.overlay import lay_over
from rt_robot_os.settings.overlay import simulate_all
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.robot import read_robot
from rt_robot_os.settings.tree import COMMAND_LINE


def load(
    paths: Sequence[Path], overrides: Mapping[str, Any] = MappingProxyType({}),
    node: str = 'robot', namespace: str = '/', catalogue: Catalogue | None = None,
    simulate: bool = False,
) -> RobotSettings:
    """
    Read ROS 2 parameter files and check them against everything that they name; opens no device.

    :param paths: later files win, key by key.
    :param overrides: by dotted name (``imu.rate_hz``); they win over the files.
    :param node: the node's name; only its sections and wildcards count.
    :param namespace: the node's namespace.
    :param catalogue: what may be named; what is installed when None.
    :param simulate: every device is a simulated one, whatever its port.
    :raises ConfigError: with one line for each problem.
    """
    problems = Problems([*(str(path) for path in paths), COMMAND_LINE])
    tree = read_files([Path(path) for path in paths], namespace, node, problems)
    tree = lay_over(tree, read_overrides(overrides, problems))
    known = catalogue or installed()
    if simulate:
        tree = simulate_all(tree, known)
    settings = read_robot(tree, namespace, node, known, problems)
    return replace(settings, files=tuple(os.path.realpath(path) for path in paths))

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

"""The settings that a command line asks for: what `robot` and `core` have in common."""

from __future__ import annotations

from collections.abc import Sequence

from rt_robot_os.settings.load import load
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.paths import default_path
from rt_robot_os.settings.ros_args import parse_ros_args
from rt_robot_os.settings.ros_args import RosArguments


def load_from_arguments(argv: Sequence[str]) -> tuple[RobotSettings, RosArguments]:
    """
    Read the parameter files and overrides of a command line.

    Without a parameter file the package's own ``robot.yaml`` counts: simulated devices.

    :param argv: without the program's name.
    :raises ConfigError: with one line for each problem.
    """
    ros = parse_ros_args(argv)
    if ros.params_files:
        settings = load(ros.params_files, ros.overrides, ros.node_name, ros.namespace)
    else:
        # The shipped file is written for the node's usual name, wherever it runs.
        settings = load([default_path()], ros.overrides)
    return settings, ros

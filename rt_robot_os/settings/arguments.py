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
from dataclasses import replace
import os

from rt_robot_os.settings.load import load
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.paths import default_path
from rt_robot_os.settings.ros_args import parse_ros_args
from rt_robot_os.settings.ros_args import RosArguments


def load_from_arguments(argv: Sequence[str], simulate: bool = False
                        ) -> tuple[RobotSettings, RosArguments]:
    """
    Read the parameter files and overrides of a command line.

    Without a parameter file, as with the package's own ``robot.yaml``, devices are simulated.

    :param argv: without the program's name.
    :param simulate: all devices are to be simulated.
    :raises ConfigError: with one line for each problem.
    """
    ros = parse_ros_args(argv)
    files = ros.params_files or (default_path(),)
    # A launch file names the shipped one when its user names none.
    shipped = [os.path.realpath(path) for path in files] == [os.path.realpath(default_path())]
    # That one is written for the node's usual name, wherever it runs.
    node, namespace = ('robot', '/') if shipped else (ros.node_name, ros.namespace)
    settings = load(files, ros.overrides, node, namespace, simulate=simulate)
    return replace(settings, simulation_asked=simulate or not shipped), ros

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

"""The program `mapping` next to a running robot."""

from __future__ import annotations

import argparse
import os

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.needs import require
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.base.requirements import EXTRAS
from rt_robot_os.features.mapping.settings import load
from rt_robot_os.features.mapping.settings import MappingSettings
from rt_robot_os.link.single_instance import data_folder
from rt_robot_os.link.single_instance import single_instance
from rt_robot_os.linux.paths import robot_name
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.linux.process import use_ordinary_scheduling
from rt_robot_os.settings.ros_args import RosArguments

_NAME = 'mapping'


def run_live(arguments: argparse.Namespace, ros: RosArguments) -> int:
    """
    Map next to a robot until a signal ends it.

    :return: the exit code.
    :raises RtRobotError: it cannot run.
    """
    try:
        settings = load((*arguments.files, *ros.params_files), ros.overrides, ros.node_name,
                        ros.namespace)
    except ConfigError as error:
        warn(_NAME, error.problems[0], error.problems[1:])
        return BAD_USE
    require('mapping', *EXTRAS['slam'])
    return _map(settings, arguments.robot or robot_name(namespace=ros.namespace))


def _map(settings: MappingSettings, robot: str) -> int:
    from rt_robot_os.features.mapping.process.live_mapping import LiveMapping  # it imports scipy
    folder = data_folder(_NAME, robot, settings.folder)
    stopping: list[int] = []
    with single_instance(_NAME, robot,
                         f'mapping of the robot {robot} runs already: two would move it '
                         'between two maps'):
        use_ordinary_scheduling(settings.avoid_cpus)
        os.nice(settings.nice)
        live = LiveMapping(settings, socket_path(robot), folder, lambda text: warn(_NAME, text))
        with ended_by_signals(stopping.append):
            live.run(lambda: bool(stopping))
    return OK

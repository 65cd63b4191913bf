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

"""The program `robot`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
from contextlib import ExitStack
from contextlib import suppress
from pathlib import Path
import sys

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import importing
from rt_robot_os.link.robots import lock_core
from rt_robot_os.link.robots import lock_robot
from rt_robot_os.linux.paths import robot_name
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.settings.command_line import add_simulate
from rt_robot_os.settings.command_line import parse_own
from rt_robot_os.settings.command_line import ROS_ARGS_HELP
from rt_robot_os.settings.command_line import tell
from rt_robot_os.settings.command_line import told_simulated
from rt_robot_os.settings.ros_args import parse_ros_args

_EPILOG = """
Without a parameter file the shipped robot runs, with simulated sensors.

  robot --simulate                                   the shipped robot, without a warning
  robot my_robot.yaml                                your robot
  robot --simulate my_robot.yaml                     your robot, simulated
  robot my_robot.yaml --ros-args -p gps.enabled:=false

Robots on one machine need different names: -r __node:=NAME or -r __ns:=/NAMESPACE.
Exit code: 0 after Ctrl-C or SIGTERM, 2 when the configuration is not valid, 1 otherwise.
"""


def run(argv: Sequence[str]) -> int:
    """
    Run the robot until Ctrl-C or SIGTERM.

    :param argv: without the program's name.
    :return: the exit code, 2 for a bad configuration.
    """
    arguments = _arguments(argv)
    with ExitStack() as stack:
        try:
            ros = parse_ros_args(argv)
            robot = robot_name(ros.node_name, ros.namespace)
            path = socket_path(robot)
            core = stack.enter_context(_loaded_core(path))
            with importing():  # of drivers, modules and messages
                from rt_robot_os.settings.load import load_from_arguments
                settings, _ = load_from_arguments(argv, arguments.simulate, arguments.files)
                from rt_robot_os.settings.json_text import to_json
            stack.callback(lock_robot(robot).release)
            if settings.core.spawn:
                lock_core(path).release()  # the core itself locks it
        except RtRobotError as error:
            tell('robot', error)
            return BAD_USE
        if settings.core.spawn and settings.autostart:
            core.prepare(to_json(settings))
        if settings.simulated:
            print(f'robot: {told_simulated(settings)}', file=sys.stderr, flush=True)
        # ROS 2 is loaded after the check, so that a mistake is reported earlier.
        with importing():
            from rt_robot_os.ros.spin import spin
        return spin(settings, core)


@contextmanager
def _loaded_core(path: Path) -> Iterator[CoreProcess]:
    """
    Load the core's interpreter while this process checks the settings and loads ROS.

    It waits for its settings, and opens nothing before ROS has accepted the node.
    """
    core = CoreProcess('', path)
    with suppress(OSError):  # tried again, and reported, at the start
        core.load()
    try:
        yield core
    finally:
        core.stop()


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='robot', description='Run a robot: its real-time core and its ROS 2 node.',
        usage='robot [--help] [--simulate] [FILE ...] [--ros-args -p NAME:=VALUE ...]',
        epilog=ROS_ARGS_HELP + _EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False)
    add_simulate(parser)
    return parse_own(parser, argv)

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

"""The command line of the program `notifier`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import os

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.features.alarms.notifier.notifier import Notifier
from rt_robot_os.features.alarms.notifier.settings import load
from rt_robot_os.features.alarms.notifier.settings import NotifierSettings
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.link.single_instance import data_folder
from rt_robot_os.link.single_instance import single_instance
from rt_robot_os.linux.paths import robot_name
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.settings.command_line import parse_own
from rt_robot_os.settings.ros_args import parse_ros_args

_NAME = 'notifier'
_EPILOG = """Its channels stand in a parameter file under /**/notifier; see docs/notifier.md.
Exit code: 0 ended by a signal, 1 it cannot run, 2 wrong settings."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_NAME, description='Deliver notifications of alarms: by e-mail, webhook, '
        'program, file or console. No medical device.', epilog=_EPILOG, allow_abbrev=False,
        usage='notifier [options] [FILE ...] [--ros-args -p NAME:=VALUE ...]')
    add_robot_option(parser)
    parser.set_defaults(robot=None)  # the robot in its own namespace
    parser.add_argument('--check', action='store_true',
                        help='check the settings, name the channels, and end')
    return parser


def run(argv: Sequence[str]) -> int:
    """
    Deliver notifications until a signal ends it.

    :param argv: without the program's name.
    :return: the exit code.
    :raises RtRobotError: it cannot run.
    """
    try:
        ros = parse_ros_args(argv, _NAME)
        arguments = parse_own(_parser(), argv)
        settings = load((*arguments.files, *ros.params_files), ros.overrides, os.environ,
                        ros.node_name, ros.namespace)
    except ConfigError as error:
        warn(_NAME, error.problems[0], error.problems[1:])
        return BAD_USE
    if arguments.check:
        for each in settings.channels:
            print(f'{each.name}: {each.type}')
        return OK
    if not settings.channels:
        warn(_NAME, 'no channel: write channels: [...] under /**/notifier in a parameter file, '
             'and give that')
        return BAD_USE
    return _carry(settings, arguments.robot or robot_name(namespace=ros.namespace))


def _carry(settings: NotifierSettings, robot: str) -> int:
    folder = data_folder(_NAME, robot, settings.folder)
    stopping: list[int] = []
    with single_instance(_NAME, robot,
                         f'a notifier of the robot {robot} runs already: two would deliver '
                         'everything twice'):
        notifier = Notifier(settings, socket_path(robot), folder / 'deliveries.jsonl',
                            lambda text: warn(_NAME, text))
        with ended_by_signals(stopping.append):
            notifier.run(lambda: bool(stopping))
    return OK

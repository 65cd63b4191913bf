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

"""What the program `gateway` does with its command line."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Sequence
from dataclasses import replace

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.needs import require
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.base.requirements import EXTRAS
from rt_robot_os.gateway.settings import GatewaySettings
from rt_robot_os.gateway.settings import load
from rt_robot_os.gateway.settings import server_problem
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.link.single_instance import data_folder
from rt_robot_os.link.single_instance import single_instance
from rt_robot_os.linux.paths import robot_name
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.linux.process import use_ordinary_scheduling
from rt_robot_os.settings.command_line import parse_own
from rt_robot_os.settings.ros_args import parse_ros_args

_NAME = 'gateway'
_EPILOG = """Its settings are in a parameter file under /**/gateway; see docs/gateway.md.
Exit code: 0 ended by a signal, 1 it cannot run, 2 wrong settings."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_NAME, description='Connect a robot to a monitor: send its records and signals, '
        'execute commands of users. Records wait on the disk for the network.', epilog=_EPILOG,
        allow_abbrev=False,
        usage='gateway [options] [FILE ...] [--ros-args -p NAME:=VALUE ...]')
    add_robot_option(parser)
    parser.set_defaults(robot=None)  # that of its own namespace
    parser.add_argument('--server', help='URL of the monitor, such as wss://host:8443')
    return parser


def run(argv: Sequence[str]) -> int:
    """
    Run until a signal ends it.

    :param argv: without the program's name.
    :return: the exit code.
    :raises RtRobotError: it cannot run.
    """
    try:
        ros = parse_ros_args(argv, _NAME)
        arguments = parse_own(_parser(), argv)
        settings = load((*arguments.files, *ros.params_files), ros.overrides, ros.node_name,
                        ros.namespace)
    except ConfigError as error:
        warn(_NAME, error.problems[0], error.problems[1:])
        return BAD_USE
    if arguments.server:
        settings = replace(settings, server=arguments.server)
        if wrong := server_problem(settings.server):
            warn(_NAME, f'--server {settings.server!r}: {wrong}')
            return BAD_USE
    if not settings.server:
        warn(_NAME, 'no server: give --server wss://HOST:PORT, or write server: under /**/gateway '
             'in a parameter file and give that')
        return BAD_USE
    require('the gateway', *EXTRAS['gateway'])
    return _carry(settings, arguments.robot or robot_name(namespace=ros.namespace))


def _carry(settings: GatewaySettings, robot: str) -> int:
    from rt_robot_os.gateway.gateway import Gateway  # it imports websockets
    folder = data_folder(_NAME, robot, settings.folder)
    stopping: list[int] = []
    with single_instance(_NAME, robot,
                         f'a gateway of the robot {robot} runs already: two would send '
                         'everything twice'):
        use_ordinary_scheduling(settings.avoid_cpus)
        gateway = Gateway(settings, robot, socket_path(robot), folder,
                          lambda text: warn(_NAME, text))
        with ended_by_signals(stopping.append):
            asyncio.run(gateway.run(lambda: bool(stopping)))
    return OK

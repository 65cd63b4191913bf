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

"""What the program `monitor` does with its command line."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import ipaddress

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.needs import require
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import run_command
from rt_robot_os.base.programs import warn
from rt_robot_os.base.requirements import EXTRAS
from rt_robot_os.linux.folders import ros_home
from rt_robot_os.monitor.security.commands import WORDS
from rt_robot_os.monitor.settings import load
from rt_robot_os.monitor.settings import MonitorSettings
from rt_robot_os.settings.ros_args import parse_ros_args

_NAME = 'monitor'
_ABOUT = ('Serve the remote monitor: robots call it, people open its page. No medical '
          'device.')
_EPILOG = """Commands, each with --help: monitor user | robot | certificate | audit |
database. Its settings are in a parameter file under /**/monitor; see docs/monitor.md.
Exit code: 0 ended by a signal, 1 it cannot run, 2 wrong settings."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_NAME, description=_ABOUT, epilog=_EPILOG, allow_abbrev=False,
        usage='monitor [options] [--ros-args --params-file FILE -p NAME:=VALUE ...]')
    parser.add_argument('--host', help='address to listen on (default: 127.0.0.1)')
    parser.add_argument('--port', type=int, help='port (default: 8443 with TLS, 8080 without)')
    parser.add_argument('--database', metavar='URL', help='database (default: SQLite in FOLDER)')
    parser.add_argument('--folder', metavar='DIR', help='its data (default: ~/.ros/monitor)')
    parser.add_argument('--certificate', metavar='FILE', help='certificate of the server, PEM')
    parser.add_argument('--key', metavar='FILE', help='its private key, PEM')
    beside = parser.add_mutually_exclusive_group()
    beside.add_argument('--demo', action='store_true', help='run next to it a simulated flat in '
                        'which a person falls, with its robot and gateway')
    beside.add_argument('--with-gateway', metavar='NODE', help='run next to it the gateway of a '
                        'robot of this machine, such as /robot, with a token made for it')
    return parser


def run(argv: Sequence[str]) -> int:
    """
    Serve until a signal ends it.

    :param argv: without the program's name.
    :return: the exit code.
    :raises RtRobotError: it cannot run.
    """
    if argv and argv[0] in WORDS:
        require('the monitor', *EXTRAS['monitor'])
        from rt_robot_os.monitor.security.commands.table import COMMANDS
        return run_command(_NAME, _ABOUT, COMMANDS, argv)
    try:
        ros = parse_ros_args(argv, _NAME)
        arguments = _parser().parse_args(ros.rest)
        options = {key: value for key, value in vars(arguments).items()
                   if key not in ('demo', 'with_gateway') and value is not None}
        settings = load(ros.params_files, ros.overrides, options, ros_home(), ros.node_name,
                        ros.namespace, is_needed=not arguments.with_gateway)
    except ConfigError as error:
        warn(_NAME, error.problems[0], error.problems[1:])
        return BAD_USE
    check_reach(settings)
    require('the monitor', *EXTRAS['monitor'])
    from rt_robot_os.monitor.demo import demo
    from rt_robot_os.monitor.demo import gateway_of
    from rt_robot_os.monitor.server import serve
    serve(settings, demo() if arguments.demo else gateway_of(
        arguments.with_gateway, ros.params_files) if arguments.with_gateway else None)
    return OK


def check_reach(settings: MonitorSettings) -> None:
    """
    Refuse to accept unencrypted connections from other machines.

    :raises StartError: it would be.
    """
    if bool(settings.certificate) != bool(settings.key):
        raise StartError('certificate and key belong together: give both')
    if not settings.has_tls and not is_loopback(settings.host):
        raise StartError(f'host {settings.host} can be reached from elsewhere, and there is no '
                         "TLS: make a certificate with 'monitor certificate make' and give "
                         '--certificate and --key, or listen on 127.0.0.1')


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach an address."""
    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False

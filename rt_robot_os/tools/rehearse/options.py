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

"""Options that the commands of ``rehearse`` share."""

from __future__ import annotations

import argparse
from pathlib import Path

from rt_robot_os.settings import load
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings.files import default_path

_SHIPPED = 'assisted_living.yaml'


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options that name the robot."""
    parser.add_argument('--params-file', type=Path, action='append', default=[], metavar='FILE',
                        help='settings of the robot (default: assisted_living.yaml)')
    parser.add_argument('--node', default='robot', help='node in these settings (%(default)s)')
    parser.add_argument('--json', action='store_true', help='write a JSON object instead of text')


def settings_of(arguments: argparse.Namespace) -> RobotSettings:
    """
    Read the settings.

    :raises ConfigError: they are invalid.
    """
    return load(arguments.params_file or [default_path(_SHIPPED)], node=arguments.node)

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

"""Decode the packets of a recorded or a live line."""

from __future__ import annotations

import argparse
from typing import Any

from rt_robot_os.errors import RtRobotError


def add_to(commands: Any) -> None:
    """Add the command to the parser of the program."""
    parser = commands.add_parser(
        'sniff', allow_abbrev=False,
        help='decode the packets of a recorded or a live line')
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """
    Run the command.

    :return: the exit code.
    """
    raise RtRobotError('sniff is not there yet')

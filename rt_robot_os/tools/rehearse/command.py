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

"""
Command line of the program `rehearse`.

Each command is a module of this folder with ``add_to``, which adds its parser and its function.
"""

from __future__ import annotations

from collections.abc import Sequence

from rt_robot_os.base.programs import run_command
from rt_robot_os.tools.rehearse import emergencies
from rt_robot_os.tools.rehearse import quiet

_COMMANDS = (emergencies, quiet)


def run(argv: Sequence[str]) -> int:
    """
    Run one command.

    :param argv: without the program's name.
    :return: the exit code.
    :raises RtRobotError: it failed.
    """
    return run_command(
        'rehearse', 'Scenario tests in virtual time: the modules of a robot are real, its body '
        'and its home are simulated.', _COMMANDS, argv)

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
Command line of the program `wsn`.

Each command is a module of this folder with ``add_to``, which adds its parser and its function.
Slow imports happen only in the function.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import warn
from rt_robot_os.features.wsn.cli import compare
from rt_robot_os.features.wsn.cli import forward
from rt_robot_os.features.wsn.cli import send
from rt_robot_os.features.wsn.cli import simulate
from rt_robot_os.features.wsn.cli import sniff

# In the order of the help.
_COMMANDS = (simulate, compare, sniff, send, forward)


def run(argv: Sequence[str]) -> int:
    """
    Run one command.

    :param argv: without the program's name.
    :return: the exit code.
    :raises RtRobotError: it failed.
    """
    parser = argparse.ArgumentParser(
        prog='wsn', allow_abbrev=False, description='A wireless sensor network under TinyOS: '
        'simulate it, read its packets, send commands to its nodes.')
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    for each in _COMMANDS:
        each.add_to(commands)
    # argparse cannot parse words before, between and after options.
    arguments, words = parser.parse_known_args(argv)
    arguments.words = words
    if words and (not getattr(arguments, 'takes_words', False)
                  or any(word.startswith('-') for word in words)):
        parser.error(f'unrecognized arguments: {" ".join(words)}')
    try:
        return int(arguments.run(arguments))
    except ConfigError as error:
        warn('wsn', error.problems[0], error.problems[1:])
        return BAD_USE

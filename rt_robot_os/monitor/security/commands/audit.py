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

"""`monitor audit`: check the chain of the audit, and export it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import re
import sys
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.monitor.security.commands.opening import add_command
from rt_robot_os.monitor.security.commands.opening import opened


def add_to(commands: Any) -> None:
    """Add its parser."""
    parser = commands.add_parser('audit', help='the log of who did and saw what',
                                 allow_abbrev=False)
    words = parser.add_subparsers(dest='word', required=True, metavar='COMMAND')
    one = add_command(words, 'verify', _verify, 'check that no row was changed, removed or added; '
                      'exit code 1 when one was')
    one.add_argument('--noted', default='', metavar='HEAD', help='the head that an earlier check '
                     'printed, noted elsewhere: it must still be there')
    one.add_argument('--json', action='store_true', help='print JSON')
    one = add_command(words, 'export', _export, 'write all rows as lines of JSON')
    one.add_argument('--output', type=Path, metavar='FILE', help='default: standard output')


def _verify(arguments: argparse.Namespace) -> int:
    if arguments.noted and not re.fullmatch(r'\d{1,18}:[0-9a-f]{64}', arguments.noted):
        raise ConfigError(['--noted: a head looks like 12:3f…, as this command prints it'])
    with opened(arguments) as accounts:
        verdict = accounts.audit.verify(arguments.noted)
    if arguments.json:
        print(json.dumps({'rows': verdict.rows, 'head': verdict.head, 'whole': verdict.is_whole,
                          'problems': verdict.problems}, indent=1))
    else:
        print(f'{verdict.rows} rows, head {verdict.head}',
              *(verdict.problems or ['the chain is intact' if verdict.rows else
                                     'there are no rows: nothing was checked']), sep='\n')
    return OK if verdict.is_whole and verdict.rows else FAILED


def _export(arguments: argparse.Namespace) -> int:
    from rt_robot_os.monitor.api.audit import lines
    with opened(arguments) as accounts:
        if arguments.output is None:
            sys.stdout.writelines(lines(accounts.audit))
            return OK
        with arguments.output.open('x', encoding='utf-8') as file:
            file.writelines(lines(accounts.audit))
        print(f'written to {arguments.output}')
    return OK

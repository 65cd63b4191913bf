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

"""Options that several commands of `wsn` have."""

from __future__ import annotations

import argparse
from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.packets.decode import AUTO
from rt_robot_os.features.wsn.packets.decode import STACKS
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.payload_text import known_payloads
from rt_robot_os.features.wsn.packets.tos_msg import PLATFORMS
import yaml


def whole_number(least: int, most: int) -> Callable[[str], int]:
    """Return a parser of an integer argument, in any base of Python."""
    def convert(text: str) -> int:
        try:
            value = int(text, 0)
        except ValueError:
            value = least - 1
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(
                f'{text!r}: must be an integer from {least} to {most}')
        return value
    return convert


def seconds(text: str) -> float:
    """Parse a duration argument."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value <= 1e9:
        raise argparse.ArgumentTypeError(f'{text!r}: must be seconds above 0')
    return value


def add_stack(parser: argparse.ArgumentParser) -> None:
    """Add the options for the kind of motes."""
    parser.add_argument('--stack', choices=STACKS, default=AUTO,
                        help='generation of TinyOS (default: from the frames)')
    parser.add_argument('--platform', choices=(AUTO, *PLATFORMS), default=AUTO,
                        help='motes under TinyOS 1.x: telos is telos, telosb, tmote and micaz; '
                        'mica is mica, mica2 and mica2dot (default: by the lengths)')


def add_baud(parser: argparse.ArgumentParser) -> None:
    """Add the speed of a serial port."""
    parser.add_argument('--baud', type=whole_number(50, 4_000_000), default=0, metavar='N',
                        help='bits a second of a serial port (default: 115200 with --stack '
                        'tinyos2, else 57600; mica has 19200)')


def payloads_of(values: list[str]) -> tuple[Payload, ...]:
    """
    Return the payloads of a command line, and those of installed packages.

    :param values: declarations, or YAML files with a list of them.
    :raises ConfigError: with every problem.
    """
    found: list[object] = []
    for value in values:
        found += [value] if ':' in value else _of_file(Path(value))
    return known_payloads(found)


def _of_file(path: Path) -> list[object]:
    try:
        loaded: Any = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError([f'payloads {str(path)!r} cannot be read ({error}): give a YAML file, '
                           'or a declaration such as "soil 0x42 moisture:H"']) from error
    except yaml.YAMLError as error:
        raise ConfigError([f'payloads {str(path)!r} is not YAML: {error}']) from error
    if isinstance(loaded, dict):
        loaded = loaded.get('payloads')
    if not isinstance(loaded, list):
        raise ConfigError([f'payloads {str(path)!r}: must be a list, or a mapping with a list '
                           'under payloads'])
    return loaded

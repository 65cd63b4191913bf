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
The value that ROS 2 reads in a piece of YAML text.

ROS 2 has its own rules (rcl_yaml_param_parser), which differ from PyYAML's: ``1e9`` is a number,
``010`` is eight, ``1_000`` and ``2026-01-01`` are texts. The robot and ``ros2 param`` must agree.
"""

from __future__ import annotations

import math
import re
from typing import Final

Scalar = bool | int | float | str

NULLS: Final = frozenset({'~', 'null', 'Null', 'NULL'})

_TRUE = frozenset('Y y yes Yes YES true True TRUE on On ON'.split())
_FALSE = frozenset('N n no No NO false False FALSE off Off OFF'.split())
_INTEGER = re.compile(r'([+-]?)(?:0[xX]([0-9a-fA-F]+)|(0[0-7]*)|([1-9][0-9]*))', re.ASCII)
_DECIMAL = re.compile(r'[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?', re.ASCII)
_HEXADECIMAL = re.compile(
    r'[+-]?0[xX](?:[0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]+)?', re.ASCII)
_INFINITY = re.compile(r'[+-]?(?:\.(?:inf|Inf|INF)|(?i:infinity|inf))', re.ASCII)
_NAN = re.compile(r'\.(?:nan|NaN|NAN)|[+-]?(?i:nan)', re.ASCII)

# Longer than any number: keeps int() away from texts of thousands of digits.
_LONGEST_NUMBER = 400
_INT64 = 2 ** 63


def scalar(text: str, quoted: bool) -> Scalar:
    """
    Read one YAML scalar as ROS 2 does.

    :param text: the scalar without its quotes.
    :param quoted: whether it had any; then it is a text, whatever it looks like.
    """
    if quoted or len(text) > _LONGEST_NUMBER:
        return text
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    whole = _integer(text)
    if whole is not None:
        return whole
    number = _number(text)
    return text if number is None else number


def _integer(text: str) -> int | None:
    match = _INTEGER.fullmatch(text)
    if match is None:
        return None
    sign, hexadecimal, octal, decimal = match.groups()
    if hexadecimal:
        value = int(hexadecimal, 16)
    else:
        value = int(octal, 8) if octal else int(decimal)
    value = -value if sign == '-' else value
    return value if -_INT64 <= value < _INT64 else None


def _number(text: str) -> float | None:
    if _INFINITY.fullmatch(text):
        return -math.inf if text.startswith('-') else math.inf
    if _NAN.fullmatch(text):
        return math.nan
    if _DECIMAL.fullmatch(text):
        value = float(text)
    elif _HEXADECIMAL.fullmatch(text):
        try:
            value = float.fromhex(text)
        except OverflowError:
            return None
    else:
        return None
    # ROS 2 leaves what does not fit a double a text.
    return value if math.isfinite(value) else None

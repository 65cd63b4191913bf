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
Escaping of text for consoles, files and ROS messages.

Names and texts come from clients, devices and foreign code. A lone surrogate cannot be encoded,
and a control character would reach the terminal of a reader of the log.
"""

from __future__ import annotations

import re

# Control characters except newline and tab, lone surrogates, line separators, and bidi controls.
_UNSAFE = re.compile(
    '[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]')


def _escaped(match: re.Match[str]) -> str:
    return match.group().encode('unicode_escape').decode()


def safe_text(text: str) -> str:
    """
    Escape characters that cannot be encoded or would control a terminal; newlines stay.

    :return: the same object when there are none. Safe in the real-time loop for short texts.
    """
    return text if text.isprintable() else _UNSAFE.sub(_escaped, text)


def safe_line(text: str, longest: int = 200) -> str:
    """Escape a text as :func:`safe_text` does, in one line of limited length; for names."""
    text = text[:longest]
    if text.isprintable():
        return text
    return safe_text(text).replace('\n', '\\n').replace('\t', '\\t')


def encodable(text: str) -> bool:
    """Return whether a text can be encoded: it has no lone surrogates."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True

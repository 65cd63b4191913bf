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
Sentences of a StarGazer beside what they mean, as a JSON list.

Each entry has ``text``, the sentence, and ``landmarks``: a list of number, angle in degrees, x, y
and z in cm (null where the form has none); empty for what is no measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import json
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.stargazer.wire import CeilingMark
from rt_robot_os.devices.stargazer.wire import StarGazerDecoder

_FIELDS = 5
# Noise that a line may have before a sentence.
_NOISE = b'\x00\xff~^'


@dataclass(frozen=True)
class Sentences:
    """
    What became of them.

    :ivar count: of sentences.
    :ivar marks: that they tell of.
    :ivar wrong: those that were read otherwise, or not at all.
    :ivar wrong_in_noise: the same with noise before each, byte by byte.
    """

    count: int
    marks: int
    wrong: Sequence[str]
    wrong_in_noise: Sequence[str]


def compare(text: str, name: str) -> Sentences:
    """
    Read each sentence as the driver does.

    :param name: of the file, for errors.
    :raises ConfigError: it holds no sentences.
    """
    entries = _entries(text, name)
    return Sentences(
        len(entries), sum(len(marks) for _, marks in entries),
        [sentence for sentence, marks in entries if _read((sentence.encode(),)) != marks],
        [sentence for sentence, marks in entries if _read(
            bytes((byte,)) for byte in _NOISE + sentence.encode()) != marks])


def _read(pieces: Any) -> list[tuple[float | None, ...]] | None:
    """Return the marks of the one sentence that is in the bytes; None when it is none."""
    decoder = StarGazerDecoder()
    frames = [frame for piece in pieces for frame in decoder.feed(piece)]
    return [_plain(mark) for mark in frames[0].marks] if len(frames) == 1 else None


def _plain(mark: CeilingMark) -> tuple[float | None, ...]:
    return mark.number, mark.angle_deg, mark.x_cm, mark.y_cm, mark.z_cm


def _entries(text: str, name: str) -> list[tuple[str, list[tuple[float | None, ...]]]]:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError([f'{name}: is no JSON: {error}']) from error
    if not isinstance(content, list) or not content:
        raise ConfigError([f'{name}: must be a list of sentences'])
    found = []
    for place, entry in enumerate(content, 1):
        try:
            marks = [tuple(mark) for mark in entry['landmarks']]
            if not isinstance(entry['text'], str) or any(len(m) != _FIELDS for m in marks):
                raise ValueError('a text, and for each landmark five numbers')
            found.append((entry['text'], marks))
        except (KeyError, TypeError, ValueError) as error:
            raise ConfigError([f'{name}: entry {place}: {type(error).__name__}: {error}: it must '
                               'have text and landmarks']) from error
    return found

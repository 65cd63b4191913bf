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

"""What a terminal can show: colours, characters, a progress bar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TextIO

from rt_robot_os.tools.doctor.finding import State

_COLOURS = {State.OK: '32', State.WARN: '33', State.BAD: '1;31', State.UNKNOWN: '36',
            State.ABSENT: '2'}
_BAR_WIDTH = 40


@dataclass(frozen=True)
class Style:
    """
    How to write.

    :ivar colours: whether to use them.
    :ivar full: the character of which bars are made.
    :ivar trace: the character for what is there, but too little for a bar.
    """

    colours: bool = False
    full: str = '#'
    trace: str = '.'

    def paint(self, text: str, code: str) -> str:
        """Colour a text."""
        return f'\033[{code}m{text}\033[0m' if self.colours else text

    def state(self, state: State, width: int) -> str:
        """Write a state in its colour."""
        return self.paint(state.value, _COLOURS[state]) + ' ' * (width - len(state.value))

    def heading(self, text: str) -> str:
        """Write a heading."""
        return self.paint(text, '1')

    def command(self, text: str) -> str:
        """Write a line to paste."""
        return self.paint(text, '36') if text.lstrip()[:1] != '#' else self.paint(text, '2')


def style_for(stream: TextIO, environ: Mapping[str, str]) -> Style:
    """Choose what suits a stream: colours on a terminal only, and not against NO_COLOR."""
    colours = (stream.isatty() and not environ.get('NO_COLOR')
               and environ.get('TERM', 'dumb') != 'dumb')
    try:
        '█·'.encode(stream.encoding or 'ascii')
    except (UnicodeEncodeError, LookupError):
        return Style(colours)
    return Style(colours, '█', '·')


class Progress:
    """
    A bar that is drawn over itself, on a terminal only.

    :param label: what goes on.
    """

    def __init__(self, stream: TextIO, style: Style, label: str) -> None:
        self._stream = stream
        self._style = style
        self._label = label
        self._drawn = 0

    def show(self, part: float) -> None:
        """
        Draw.

        :param part: from 0 to 1.
        """
        filled = round(part * _BAR_WIDTH)
        bar = self._style.full * filled + self._style.trace * (_BAR_WIDTH - filled)
        line = f'  {self._label} {bar}'
        self._stream.write(f'\r{line} {part:4.0%}')
        self._stream.flush()
        self._drawn = len(line) + 5

    def clear(self) -> None:
        """Remove it."""
        if self._drawn:
            self._stream.write('\r' + ' ' * self._drawn + '\r')
            self._stream.flush()
            self._drawn = 0

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


"""The live screen, drawn with `rich`, and the keyboard."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
import os
import select
import signal
import sys
import termios
import time
import tty

from rich.console import Console
from rich.console import Group
from rich.live import Live
from rich.text import Text

from rt_robot_os.base.errors import LinkError
from rt_robot_os.tools.top.columns import Line
from rt_robot_os.tools.top.controls import Controls
from rt_robot_os.tools.top.controls import split_keys
from rt_robot_os.tools.top.core_source import Source
from rt_robot_os.tools.top.rows import Snapshot
from rt_robot_os.tools.top.screen_layout import body
from rt_robot_os.tools.top.screen_layout import cut
from rt_robot_os.tools.top.screen_layout import head
from rt_robot_os.tools.top.snapshot import compare
from rt_robot_os.tools.top.snapshot import Sample

STYLES = {'': '', 'dim': 'dim', 'head': 'bold', 'good': 'green', 'warn': 'yellow',
          'bad': 'bold red'}
_POLL_S = 0.1
_NOTE_S = 20.0
_TYPED_BYTES = 256


def drawn(lines: Sequence[Line]) -> Group:
    """Convert lines for rich."""
    texts = []
    for line in lines:
        text = Text(no_wrap=True, overflow='crop', end='')
        for piece, style in line:
            text.append(piece, STYLES[style])
        texts.append(text)
    return Group(*(Text.assemble(text, '\n', no_wrap=True, overflow='crop', end='')
                   for text in texts[:-1]), *texts[-1:])


def screen(snapshot: Snapshot | None, controls: Controls, source: Source, waiting: str,
           size: tuple[int, int]) -> list[Line]:
    """
    Compose all lines of the terminal.

    :param snapshot: None while no core was seen.
    :param waiting: why there is nothing new; empty when all is well.
    :param size: columns and lines of the terminal.
    """
    width, height = size
    lines: list[Line] = []
    if snapshot is not None:
        lines += head(snapshot, controls.choices, width)
    if waiting:
        lines.append(cut(((f'waiting: {waiting}', 'bad'),), width))
    elif source.note:
        lines.append(cut(((source.note, 'warn'),), width))
    if snapshot is not None:
        room = max(1, height - len(lines) - 1)
        lines += body(snapshot, controls.choices, width, room, source.lines)
    lines = lines[:max(1, height - 1)]
    lines += [((' ', ''),)] * (height - 1 - len(lines))
    return [*lines, cut(((controls.help_line(), 'dim'),), width)]


class Program:
    """
    The loop: poll, draw, read the keyboard.

    :param robot: what the core is called.
    """

    def __init__(self, robot: str, source: Source, controls: Controls) -> None:
        self._robot = robot
        self._source = source
        self._controls = controls
        self._console = Console(highlight=False)
        self._before: Sample | None = None
        self._snapshot: Snapshot | None = None
        self._waiting = ''
        self._noted_s = 0.0

    def run(self) -> None:
        """Run until the user quits."""
        # A signal ends it too, and the terminal is restored.
        signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
        due_s = 0.0
        size = (0, 0)
        with _keyboard() as typed, Live(
                console=self._console, screen=True, auto_refresh=False) as live:
            while True:
                fresh = False
                self._source.pump()
                if time.monotonic() >= due_s and not self._controls.choices.paused:
                    self._look()
                    # The second poll comes soon: rates need two.
                    first = self._snapshot is None or self._snapshot.interval_s is None
                    due_s = time.monotonic() + (
                        min(0.5, self._controls.interval_s) if first
                        else self._controls.interval_s)
                    fresh = True
                now_size = self._size()
                if fresh or typed or now_size != size:
                    size = now_size
                    live.update(drawn(screen(self._snapshot, self._controls, self._source,
                                             self._waiting, size)), refresh=True)
                typed = _typed(_POLL_S)
                before_s = self._controls.interval_s
                if not all([self._controls.press(key) for key in split_keys(typed)]):
                    return
                if self._controls.interval_s < before_s:
                    due_s = min(due_s, time.monotonic() + self._controls.interval_s)

    def _size(self) -> tuple[int, int]:
        size = self._console.size
        return size.width, size.height

    def _look(self) -> None:
        note = self._source.note
        try:
            sample = self._source.poll()
        except LinkError as error:
            self._waiting = str(error)
            return
        self._waiting = ''
        if self._source.note != note:
            self._noted_s = time.monotonic()
        elif note and time.monotonic() - self._noted_s > _NOTE_S:
            self._source.note = ''
        self._snapshot = compare(self._robot, sample, self._before)
        self._before = sample


@contextmanager
def _keyboard() -> Iterator[str]:
    """Let keys come immediately and without echo; nothing when standard input is no terminal."""
    if not sys.stdin.isatty():
        yield ''
        return
    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield ''
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _typed(timeout_s: float) -> str:
    """Wait for keys; empty when there were none."""
    if not sys.stdin.isatty():
        time.sleep(timeout_s)
        return ''
    ready, _, _ = select.select([sys.stdin], [], [], timeout_s)
    if not ready:
        return ''
    data = os.read(sys.stdin.fileno(), _TYPED_BYTES)
    return data.decode(errors='ignore') if data else 'q'  # the terminal is gone

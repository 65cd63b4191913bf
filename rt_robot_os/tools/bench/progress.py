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

"""A progress bar on a terminal; nothing where there is none."""

from __future__ import annotations

import shutil
import time
from typing import TextIO

_BAR = 24


def duration(seconds: float) -> str:
    """Write a duration as people do."""
    return f'{seconds:.0f} s' if seconds < 90 else f'{seconds / 60:.0f} min' if (
        seconds < 5400) else f'{seconds / 3600:.1f} h'


class ProgressLine:
    """
    One line that is written over: how much is done, what is done now, how long it still takes.

    :param total_s: expected for everything.
    """

    def __init__(self, stream: TextIO, total_s: float) -> None:
        self._stream = stream
        self._shown = stream.isatty()
        self._total_s = max(total_s, 1e-9)
        self._done_s = 0.0
        self._begun = time.monotonic()

    def show(self, text: str) -> None:
        """Say what is done now."""
        if not self._shown:
            return
        part = min(1.0, self._done_s / self._total_s)
        filled = round(part * _BAR)
        left_s = self._left_s(part)
        line = (f'[{"#" * filled}{"." * (_BAR - filled)}] {100 * part:3.0f} %  '
                f'{duration(left_s)} left  {text}')
        # A line that is broken by the terminal could not be written over.
        width = shutil.get_terminal_size((100, 0)).columns
        self._stream.write(f'\r\x1b[K{line[:min(100, width) - 1]}')
        self._stream.flush()

    def _left_s(self, part: float) -> float:
        """Estimate from the plan, corrected by how the plan went so far."""
        left_s = self._total_s - self._done_s
        if part < 0.05:
            return left_s
        return left_s * (time.monotonic() - self._begun) / self._done_s

    def done(self, expected_s: float) -> None:
        """Note the end of something with its expected duration."""
        self._done_s += expected_s

    def clear(self) -> None:
        """Remove the line."""
        if self._shown:
            self._stream.write('\r\x1b[K')
            self._stream.flush()

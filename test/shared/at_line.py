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

"""Do something between two lines of the code under test, as a signal handler may."""

from __future__ import annotations

from collections.abc import Callable
from types import CodeType
from types import FrameType
from typing import Any


class AtLine:
    """
    Call something before the n-th line that is executed; a function for ``sys.settrace``.

    :param step: n, from 1.
    :param of: whether the lines of a piece of code count.
    :param when: whether lines count already.
    :param event: ``line`` or ``opcode``.
    :ivar seen: how many there were.
    """

    def __init__(self, step: int, action: Callable[[], object], of: Callable[[CodeType], bool],
                 when: Callable[[], bool] = lambda: True, event: str = 'line') -> None:
        self.seen = 0
        self._step = step
        self._action = action
        self._of = of
        self._when = when
        self._event = event

    def __call__(self, frame: FrameType, event: str, arg: Any) -> AtLine | None:
        if not self._of(frame.f_code):
            return None
        frame.f_trace_opcodes = self._event == 'opcode'
        if event == self._event and self._when():
            self.seen += 1
            if self.seen == self._step:
                self._action()
        return self


def of_files(*names: str | None) -> Callable[[CodeType], bool]:
    """Count the lines of these files."""
    return lambda code: code.co_filename in names

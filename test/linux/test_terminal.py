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


"""The number of readable bytes of a terminal, and the error when it is gone."""

from __future__ import annotations

from collections.abc import Iterator
import os
import pty
import select
import tty

import pytest
from rt_robot_os.linux.terminal import is_raw_terminal
from rt_robot_os.linux.terminal import unread_bytes


@pytest.fixture
def ends() -> Iterator[tuple[int, int]]:
    controller, terminal = pty.openpty()
    yield controller, terminal
    os.close(controller)
    os.close(terminal)


def test_bytes_count_until_they_are_read(ends: tuple[int, int]) -> None:
    controller, terminal = ends
    tty.setraw(terminal)
    assert unread_bytes(terminal) == 0
    os.write(controller, bytes(300))
    assert select.select([terminal], [], [], 60)[0]
    assert unread_bytes(terminal) == 300
    os.read(terminal, 100)
    assert unread_bytes(terminal) == 200


def test_a_terminal_whose_other_side_closed_is_an_error() -> None:
    controller, terminal = pty.openpty()
    os.close(controller)
    with pytest.raises(OSError):
        unread_bytes(terminal)
    os.close(terminal)
    for closed in (terminal, -1):
        with pytest.raises(OSError):
            unread_bytes(closed)


def test_raw_terminals_are_told_from_those_with_lines_and_from_all_else(
        ends: tuple[int, int]) -> None:
    terminal = ends[1]
    assert not is_raw_terminal(terminal)
    tty.setraw(terminal)
    assert is_raw_terminal(terminal)
    reading, writing = os.pipe()
    assert not is_raw_terminal(reading)
    assert not is_raw_terminal(-1)
    os.close(reading)
    os.close(writing)
    assert not is_raw_terminal(reading)

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


"""A core in a process of its own, and a terminal to look at it from."""

from __future__ import annotations

from collections.abc import Iterator
import fcntl
import os
from pathlib import Path
import pty
import select
import signal
import struct
import subprocess
import sys
import termios

from processes import COMMANDS_YAML
from processes import environment
from processes import in_a_folder
from processes import start_core
from processes import TIMEOUT_S
from processes import wait_until
import pytest


class Terminal:
    """The program `top` on a pseudo-terminal."""

    def __init__(self, surroundings: dict[str, str], *arguments: str,
                 size: tuple[int, int] = (80, 24)) -> None:
        self._fd, theirs = pty.openpty()
        self.resize(*size)
        self.seen = ''
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'rt_robot_os.tools.top.program', *arguments], stdin=theirs,
            stdout=theirs, stderr=theirs, cwd='/', env={**surroundings, 'TERM': 'xterm'})
        os.close(theirs)

    def resize(self, columns: int, lines: int) -> None:
        fcntl.ioctl(self._fd, termios.TIOCSWINSZ, struct.pack('4H', lines, columns, 0, 0))

    def press(self, keys: str) -> None:
        os.write(self._fd, keys.encode())

    def read(self) -> None:
        while select.select([self._fd], [], [], 0.0)[0]:
            try:
                data = os.read(self._fd, 65536)
            except OSError:  # the program has ended
                return
            self.seen += data.decode(errors='replace')

    def wait_for(self, text: str) -> None:
        """Wait until a text is drawn from now on."""
        self.seen = ''

        def there() -> bool:
            self.read()
            return text in self.seen or self.process.poll() is not None

        wait_until(there, f'{text!r} on the screen')
        self.read()
        assert text in self.seen, self.seen[-2000:]

    def end(self) -> int:
        def gone() -> bool:
            self.read()
            return self.process.poll() is not None

        wait_until(gone, 'the end of top')
        return int(self.process.returncode)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self._fd)


class World:
    """A runtime folder, a core, and programs `top`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / 'robot.yaml').write_text(COMMANDS_YAML)
        self.environment = environment(folder)
        # What pytest-xdist sets would hide the size of the terminal.
        self.environment.pop('COLUMNS', None)
        self.environment.pop('LINES', None)
        self._terminals: list[Terminal] = []
        self._cores: list[subprocess.Popen[bytes]] = []

    def start_core(self) -> subprocess.Popen[bytes]:
        core = start_core(self.folder)
        self._cores.append(core)
        return core

    def top(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, '-m', 'rt_robot_os.tools.top.program', *arguments], cwd='/',
            text=True,
            env=self.environment, capture_output=True, timeout=TIMEOUT_S)

    def terminal(self, *arguments: str, size: tuple[int, int] = (80, 24)) -> Terminal:
        terminal = Terminal(self.environment, *arguments, size=size)
        self._terminals.append(terminal)
        return terminal

    def close(self) -> None:
        for terminal in self._terminals:
            terminal.close()
        for core in self._cores:
            if core.poll() is None:
                core.send_signal(signal.SIGTERM)
            try:
                core.wait(15.0)
            except subprocess.TimeoutExpired:
                core.kill()
                core.wait()


@pytest.fixture
def world() -> Iterator[World]:
    with in_a_folder(World) as made:
        yield made

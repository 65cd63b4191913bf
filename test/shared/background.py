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
What reads the whole package takes many seconds, and no other test needs to wait for it.

A test file declares its command with :class:`Reading`. When many tests run, one process of low
priority runs the commands one after the other from the beginning, and each test finds the outcome.
No thread does it: tests of the kernel want this process to have one.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = Path(__file__).resolve().parents[2]
_NICE = 10
_declared: list[Reading] = []
_runner: list[subprocess.Popen[bytes]] = []
_folders: list[Path] = []


class Reading:
    """
    A command that reads the package and changes nothing.

    :param command: with its arguments; run in the root of the repository.
    """

    def __init__(self, *command: str) -> None:
        self.command = command
        self._outcome: Path | None = None
        _declared.append(self)

    def outcome(self) -> tuple[int, str]:
        """Return the exit code and what was said, on both outputs; wait for it, or run it now."""
        while self._outcome is not None and not self._outcome.exists():
            if _runner[0].poll() is not None and not self._outcome.exists():
                break  # it was ended
            time.sleep(0.05)
        if self._outcome is None or not self._outcome.exists():
            return _run(self.command)
        code, said = json.loads(self._outcome.read_text())
        return code, said


def begin() -> None:
    """Run all commands that are declared, beside the tests."""
    _folders.append(Path(tempfile.mkdtemp(prefix='rt_robot_os_read_')))
    for number, each in enumerate(_declared):
        each._outcome = _folders[0] / f'{number}.json'
    (_folders[0] / 'commands').write_text(json.dumps([each.command for each in _declared]))
    _runner.append(subprocess.Popen(
        [sys.executable, __file__, str(_folders[0])], start_new_session=True))


def end() -> None:
    """End what still runs; may be called twice."""
    while _runner:
        process = _runner.pop()
        if process.poll() is None:
            os.killpg(process.pid, 9)
        process.wait()
    while _folders:
        shutil.rmtree(_folders.pop(), ignore_errors=True)


def _run(command: tuple[str, ...] | list[str]) -> tuple[int, str]:
    done = subprocess.run(command, cwd=ROOT, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT)
    return done.returncode, done.stdout


def _run_all(folder: Path) -> None:
    os.nice(_NICE)
    for number, command in enumerate(json.loads((folder / 'commands').read_text())):
        part = folder / f'{number}.part'
        part.write_text(json.dumps(_run(command)))
        part.rename(folder / f'{number}.json')


if __name__ == '__main__':
    _run_all(Path(sys.argv[1]))

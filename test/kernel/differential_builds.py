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
Two processes, one for each build, that run the same scenarios, and where what they saw differs.

Both are processes of their own, so that a build which crashes, or never ends, is a difference
like any other, and hypothesis can make the scenario smaller that does it.
"""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
import pickle
import select
import signal
import struct
import subprocess
import sys
import tempfile
from types import TracebackType
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PATIENCE_S = 20.0
PATIENCE_AT_START_S = 60.0
BEFORE = 12  # number of lines shown before the first difference
_LENGTH = struct.Struct('=Q')

# What a process says instead of what it saw: it could not make the scenario, or it is gone.
FAILED = 'it failed'
ENDLESS = f'it did not end within {PATIENCE_S:g} s'


class BuildProcess:
    """
    A process that runs scenarios on one build.

    :param compiled: which.
    :param root: the source tree that it uses.
    """

    def __init__(self, compiled: bool, root: Path = ROOT) -> None:
        self.name = 'compiled' if compiled else 'pure'
        self._environment = {**os.environ, 'RT_ROBOT_OS_COMPILE': '1' if compiled else '0',
                             'PYTHONPATH': os.pathsep.join([str(root), str(HERE)])}
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: Any = None
        self._answered = False

    def start(self) -> subprocess.Popen[bytes]:
        self._errors = tempfile.TemporaryFile()
        self._process = subprocess.Popen(
            [sys.executable, '-X', 'faulthandler', str(HERE / 'differential_builds.py')],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
            env=self._environment)
        return self._process

    def send(self, scenario: Any) -> None:
        """Let it run a scenario; :meth:`receive` gives what it saw."""
        process = self._process or self.start()
        assert process.stdin is not None
        data = pickle.dumps(scenario)
        try:
            process.stdin.write(_LENGTH.pack(len(data)) + data)
            process.stdin.flush()
        except BrokenPipeError:
            pass  # receive() reports the reason

    def receive(self) -> dict[str, Any]:
        process = self._process
        assert process is not None and process.stdout is not None
        patience_s = PATIENCE_S if self._answered else PATIENCE_AT_START_S
        if not select.select([process.stdout], [], [], patience_s)[0]:
            process.kill()
            self.close()
            return {FAILED: ENDLESS}
        head = process.stdout.read(_LENGTH.size)
        if len(head) == _LENGTH.size:
            data = process.stdout.read(_LENGTH.unpack(head)[0])
            found: dict[str, Any] = pickle.loads(data)
            self._answered = True
            return found
        code = process.wait()
        self._errors.seek(0)
        told = self._errors.read().decode(errors='replace')[-3000:]
        self.close()
        how = signal.Signals(-code).name if code < 0 else f'exit code {code}'
        return {FAILED: f'the process ended ({how}):\n{told}'}

    def close(self) -> None:
        process, self._process = self._process, None
        self._answered = False
        if process is not None:
            try:
                process.communicate(timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            for stream in (process.stdin, process.stdout, self._errors):
                if stream is not None:
                    try:
                        stream.close()
                    except BrokenPipeError:
                        pass


class Builds:
    """
    The two processes, as a context manager.

    :param one: whether the first is of the compiled build.
    :param two: the same of the second.
    :ivar endless: scenarios that neither ended; no difference, but nothing was compared either.
    """

    def __init__(self, one: bool = False, two: bool = True, root: Path = ROOT) -> None:
        self._one, self._two = BuildProcess(one, root), BuildProcess(two, root)
        self.endless: list[Any] = []

    def __enter__(self) -> Builds:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        self._one.close()
        self._two.close()

    def _see(self, scenario: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        self._one.send(scenario)
        self._two.send(scenario)
        return self._one.receive(), self._two.receive()

    def difference(self, scenario: Any) -> str:
        """Say where the two differ in a scenario; empty when they do not."""
        seen = self._see(scenario)
        if sum(found.get(FAILED) == ENDLESS for found in seen) == 1:  # or was the machine busy?
            seen = self._see(scenario)
        if all(found.get(FAILED) == ENDLESS for found in seen):
            self.endless.append(scenario)
        return difference(*seen, (self._one.name, self._two.name))


def difference(one: dict[str, Any], two: dict[str, Any],
               names: Sequence[str] = ('pure', 'compiled')) -> str:
    """Say what is first different in what two processes saw; empty when nothing is."""
    if FAILED in one or FAILED in two:
        if one == two and one[FAILED] == ENDLESS:
            return ''
        return '\n'.join(f'{name}: {found.get(FAILED, "it ran to its end")}'
                         for name, found in zip(names, (one, two)))
    told = []
    for key in (*one, *(key for key in two if key not in one)):
        mine, other = one.get(key), two.get(key)
        if mine != other:
            told.append(_where(key, mine, other, names))
    if not told:
        return ''
    if 'timeline' in two and one['timeline'] != two['timeline']:
        others = [line.partition('\n')[0] for line in told[1:]]
        return '\n'.join([told[0], *others[:20]])
    return '\n'.join(told[:20])


def _where(key: str, one: Any, two: Any, names: Sequence[str]) -> str:
    if not isinstance(one, list) or not isinstance(two, list):
        return f'{key}:\n  {names[0]:>9}: {one}\n  {names[1]:>9}: {two}'
    place = next((n for n, (a, b) in enumerate(zip(one, two)) if a != b), min(len(one), len(two)))
    lines = [f'{key}, entry {place} of {len(one)} and {len(two)}:']
    first = max(0, place - BEFORE) if key == 'timeline' else place
    lines += [f'             {entry}' for entry in one[first:place]]
    for name, found in zip(names, (one, two)):
        shown = found[place:place + 3] or ['(nothing more)']
        if key != 'timeline':
            shown = shown[:1]
        lines += [f'  {name:>9}: {entry}' for entry in shown]
    return '\n'.join(lines)


def serve() -> None:
    """Run the scenarios that come on the standard input, until it ends."""
    from differential_runner import Runner
    reading, writing = sys.stdin.buffer, os.fdopen(os.dup(1), 'wb')
    os.dup2(2, 1)  # whatever prints must not come between
    while True:
        head = reading.read(_LENGTH.size)
        if len(head) < _LENGTH.size:
            return
        scenario = pickle.loads(reading.read(_LENGTH.unpack(head)[0]))
        try:
            found = Runner(scenario).run()
        except Exception as error:
            found = {FAILED: f'{type(error).__name__}: {error}'}
        data = pickle.dumps(found)
        writing.write(_LENGTH.pack(len(data)) + data)
        writing.flush()


if __name__ == '__main__':
    serve()

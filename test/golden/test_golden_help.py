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

"""Every program and each of its commands says of itself what it always did."""

from __future__ import annotations

from collections.abc import Iterator
import importlib
import re
import signal
import sys
from typing import Any

import pytest

COLUMNS = 100
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Before that argparse breaks lines in one way, after it in others.
SAME_LINES_BEFORE = (3, 12)


@pytest.fixture(autouse=True)
def as_at_home(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Make what a help depends on the same on every machine."""
    for name in ('ROS_LOG_DIR', 'ROS_HOME', 'XDG_RUNTIME_DIR', 'RT_ROBOT_OS_RUNTIME_DIR',
                 'RT_ROBOT_OS_PARAMETERS', 'FORCE_COLOR', 'PYTHON_COLORS'):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv('HOME', '/HOME')
    monkeypatch.setenv('COLUMNS', str(COLUMNS))
    monkeypatch.setenv('NO_COLOR', '1')
    monkeypatch.setenv('OPENBLAS_NUM_THREADS', '1')  # else the core begins again as a process
    handlers = {signo: signal.getsignal(signo) for signo in SIGNALS}
    yield
    for signo, handler in handlers.items():
        signal.signal(signo, handler)


def help_of(
    program: str, where: str, words: list[str], capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> str:
    """Run a program in this process with ``--help``; give what it writes."""
    module, _, function = where.partition(':')
    main = getattr(importlib.import_module(module), function)
    capsys.readouterr()
    monkeypatch.setattr(sys, 'argv', [program, *words, '--help'])
    try:
        code = main()
    except SystemExit as stop:
        code = stop.code
    out, err = capsys.readouterr()
    assert (code or 0, err) == (0, ''), (program, words)
    return re.sub(r'^optional arguments:$', 'options:', out, flags=re.MULTILINE)


def commands_of(text: str) -> list[str]:
    """Give the commands that a help lists below COMMAND."""
    block = re.search(r'^  COMMAND\n((?:    .*\n)+)', text, re.MULTILINE)
    return re.findall(r'^    (\S+)', block[1], re.MULTILINE) if block else []


def key(text: str) -> str:
    """Give what does not depend on how this version of argparse breaks and repeats."""
    if sys.version_info[:2] < SAME_LINES_BEFORE:
        return text
    once = re.sub(r'(-\w) (\S+), (--[\w-]+) \2(?=\s)', r'\1, \3 \2', text)
    return ''.join(once.split())


def test_a_help_is_as_it_was(
    golden: Any, program: str, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    where = golden.programs()[program]
    text = help_of(program, where, [], capsys, monkeypatch)
    assert text.startswith(f'usage: {program} ')
    shown = [f'$ {program} --help\n{text}']
    for command in commands_of(text):
        shown.append(f'$ {program} {command} --help\n'
                     + help_of(program, where, [command], capsys, monkeypatch))
    golden.check(f'help/{program}.txt', '\n'.join(shown), key)


def test_no_program_came_or_went(golden: Any) -> None:
    golden.check_files('help', {f'{program}.txt' for program in golden.programs()})

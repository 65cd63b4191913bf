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

"""What ./scripts/run installs when a program is first started, and when the network is away."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]
SET_UP = """
. "$0/scripts/environment.bash"
KIND=$1 PROGRAM=$2 MODE=wheels VENV=$0/venv PYTHON=$VENV/bin/python LOG=$0/setup.log
choose_extras "${@:3}"
install_requirements
"""
# Pip of an environment that is online: it writes down what it was asked for.
ONLINE = """#!/bin/sh
case "$*" in
  *'pip install'*) for list; do :; done; cat "$list" >>"$HERE/asked.txt" ;;
  *) exec {python} "$@" ;;
esac
"""
OFFLINE = """#!/bin/sh
case "$*" in
  *'pip install'*) echo 'WARNING: Retrying after connection broken by an error'; exit 1 ;;
  *) exec {python} "$@" ;;
esac
"""


class Clone:
    """A clone with an environment whose pip is under control."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / 'venv' / 'bin').mkdir(parents=True)
        shutil.copytree(ROOT / 'scripts', folder / 'scripts')
        (folder / 'rt_robot_os' / 'base').mkdir(parents=True)
        shutil.copy(ROOT / 'rt_robot_os' / 'base' / 'requirements.py',
                    folder / 'rt_robot_os' / 'base')
        self.goes(ONLINE)

    def goes(self, python: str) -> None:
        path = self.folder / 'venv' / 'bin' / 'python'
        path.write_text(python.format(python=sys.executable))
        path.chmod(0o755)

    def start(self, program: str, *extras: str, kind: str = 'run', **variables: str) -> str:
        """Set up for a program; gives what pip was asked to install, or the message."""
        asked = self.folder / 'asked.txt'
        asked.unlink(missing_ok=True)
        done = subprocess.run(
            ['bash', '-c', SET_UP, self.folder, kind, program, *extras], text=True,
            capture_output=True, env={**os.environ, 'HERE': str(self.folder), 'CC': 'true',
                                      'RT_ROBOT_OS_COMPILE': '', **variables})
        if done.returncode:
            return done.stderr
        return asked.read_text() if asked.exists() else ''


@pytest.fixture
def clone(tmp_path: Path) -> Clone:
    folder = tmp_path / 'a clone'  # with a blank
    folder.mkdir()
    return Clone(folder)


def test_a_program_installs_what_it_needs_and_once(clone: Clone) -> None:
    first = clone.start('robot')
    assert 'numpy>=' in first and 'pillow>=' in first and 'ros-jazzy-rclpy' in first
    assert not any(name in first for name in ('fastapi', 'scipy', 'aiortc', 'pytest'))
    assert clone.start('robot') == clone.start('top') == ''
    second = clone.start('monitor')
    assert 'fastapi>=' in second and 'aiortc' not in second
    assert clone.start('monitor') == clone.start('robot') == ''
    assert 'aiortc>=' in clone.start('', 'voice')


def test_a_program_needs_no_tool_of_the_tests_to_be_compiled(clone: Clone) -> None:
    asked = clone.start('robot', RT_ROBOT_OS_COMPILE='1')
    assert 'numpy>=' in asked and 'mypy' not in asked


def test_the_tests_install_everything_at_once(clone: Clone) -> None:
    asked = clone.start('', kind='test')
    for name in ('fastapi', 'scipy', 'aiortc', 'pillow', 'mcap', 'pytest', 'flake8'):
        assert f'\n{name}' in asked
    assert clone.start('robot') == clone.start('monitor') == clone.start('', kind='test') == ''


def test_without_network_what_is_installed_starts_and_the_rest_says_why_not(clone: Clone) -> None:
    clone.start('robot')
    clone.goes(OFFLINE)
    assert clone.start('robot') == ''
    said = clone.start('monitor')
    assert 'the Python package index cannot be reached' in said and 'monitor' in said
    assert 'check the network' in said
    assert clone.start('top') == ''
    clone.goes(ONLINE)
    assert 'fastapi>=' in clone.start('monitor')


def test_an_extra_that_there_is_not_is_refused_and_nothing_installed(clone: Clone) -> None:
    assert "no extra 'voices', there are: attitude" in clone.start('', 'voices')
    assert not (clone.folder / 'asked.txt').exists()

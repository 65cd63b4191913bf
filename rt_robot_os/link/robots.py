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
Single-instance locks: at most one robot of each name of this user runs on this machine.

A node holds ``NAME.lock`` in the runtime folder while it runs, a core ``NAME-core.lock``. There
are two, because a core that was started by hand and the node that attaches to it share a name.
Both are flock(2) locks: Linux releases them when a process is killed.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
import os
from pathlib import Path
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import StartError
from rt_robot_os.linux.lock_file import holder
from rt_robot_os.linux.lock_file import LockFile
from rt_robot_os.linux.paths import node_of
from rt_robot_os.linux.paths import robot_of
from rt_robot_os.linux.paths import runtime_folder
from rt_robot_os.linux.process import parent_of

_CORE_SUFFIX: Final = '-core.lock'
# A core whose node was killed brings its outputs to a safe state before it ends.
_ENDING_S = 10.0
_POLL_S = 0.02


def lock_robot(robot: str) -> LockFile:
    """
    Lock the name of a node until :meth:`LockFile.release` or the end of the process.

    :param robot: from :func:`rt_robot_os.linux.paths.robot_name`.
    :raises StartError: it already runs; the message gives the process and the remedy.
    """
    lock = LockFile(runtime_folder() / f'{robot}.lock')
    if not _acquire(lock):
        raise StartError(f'the robot {node_of(robot)} already runs on this machine'
                         f'{_process(holder(lock.path))}: stop it, or give this robot another '
                         'name: --ros-args -r __node:=other')
    lock.note(pid=os.getpid(), since=_now())
    return lock


def lock_core(path: Path, parent: int = 0) -> LockFile:
    """
    Lock the name of a core; waits for a core whose node is dead to end.

    :param path: of its socket.
    :param parent: process that the core ends with; 0 for none.
    :raises StartError: it already runs; the message gives the process and the remedy.
    """
    lock = LockFile(core_lock_path(path))
    deadline_s = time.monotonic() + _ENDING_S
    while not _acquire(lock):
        there = holder(lock.path)
        if there is not None and (not _is_orphan(there) or time.monotonic() > deadline_s):
            raise StartError(f'the core {path.stem} already runs on this machine'
                             f'{_process(there)}: stop it, attach a node to it '
                             '(-p core.spawn:=false), or give this robot another name: '
                             '--ros-args -r __node:=other')
        time.sleep(_POLL_S)
    lock.note(pid=os.getpid(), since=_now(), parent=parent)
    return lock


def core_lock_path(path: Path) -> Path:
    """Return the path of the lock that belongs to a core's socket."""
    return path.with_name(path.stem + _CORE_SUFFIX)


def remove_leftovers(path: Path) -> None:
    """Remove the socket of a core that was killed; the socket of a running core stays."""
    lock = LockFile(core_lock_path(path))
    if path.exists() and _acquire(lock):
        try:
            with suppress(OSError):  # a folder, for example: the next core reports the problem
                path.unlink(missing_ok=True)
        finally:
            lock.release()


def remove_dead_lock(path: Path) -> None:
    """
    Remove the lock file of a killed node next to its core's socket; a lock that is held stays.

    :param path: of the core's socket.
    """
    lock = LockFile(path.with_suffix('.lock'))
    with suppress(OSError):
        if lock.path.exists() and holder(lock.path) is None and lock.acquire():
            lock.release()


def running_cores() -> dict[str, Mapping[str, Any]]:
    """
    Return the running cores by the name of their robot, with the facts in their lock files.

    :raises StartError: the runtime folder cannot be used.
    """
    found = {}
    for path in sorted(runtime_folder().glob(f'*{_CORE_SUFFIX}')):
        facts = holder(path)
        if facts is not None:
            found[path.name.removesuffix(_CORE_SUFFIX)] = facts
    return found


def _acquire(lock: LockFile) -> bool:
    try:
        return lock.acquire()
    except OSError as error:
        raise StartError(f'{lock.path} cannot be created: {error.strerror}; set '
                         'RT_ROBOT_OS_RUNTIME_DIR to a folder of your own') from error


def _now() -> str:
    return datetime.now().isoformat(' ', 'seconds')


def _process(there: Mapping[str, Any] | None) -> str:
    return f' (pid {there["pid"]}, since {there["since"]})' if there else ''


def _is_orphan(there: Mapping[str, Any]) -> bool:
    parent = there.get('parent', 0)
    return bool(parent) and parent_of(int(there['pid'])) != parent


def add_robot_option(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--robot``, which is the same in every program."""
    parser.add_argument(
        '--robot', default='robot', metavar='NODE', type=robot_of,
        help='node of the robot, as `ros2 node list` prints it: /arm/robot (default: /robot)')


def others_than(robot: str) -> str:
    """Return a sentence with the running robots, for the error that one does not answer."""
    running = running_cores()
    if robot in running:
        return (f' Its core runs{_process(running[robot])} and does not answer: it is starting or '
                'ending, or it is starved (see `doctor`).')
    names = [name for name in running if name != robot]
    if not names:
        return ' No robot of this user runs on this machine.'
    return f' Running robots: {", ".join(f"--robot {node_of(name)}" for name in names)}'

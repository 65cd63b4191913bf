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

"""The paths of a core's socket and its simulated devices: in a private folder of its user."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import stat

from rt_robot_os.base.errors import StartError
from rt_robot_os.linux.folders import runtime_path
from rt_robot_os.linux.folders import RUNTIME_VARIABLE

# sockaddr_un has 108 bytes, the last of them zero.
SOCKET_PATH_BYTES_MAXIMUM = 107
_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def runtime_folder() -> Path:
    """
    Return the private runtime folder, created if needed; see :mod:`rt_robot_os.linux.folders`.

    :raises StartError: it or a folder above it belongs to another user or is writable for one, or
        it cannot be created.
    """
    folder = runtime_path(os.environ, os.getuid())
    remedy = f'set {RUNTIME_VARIABLE} to a folder of your own'
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.lstat()
        if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
            raise StartError(f'{folder} is not a folder of this user; remove it, or {remedy}')
        if status.st_mode & _WRITABLE_BY_OTHERS:
            raise StartError(f'{folder} can be written by other users; {remedy}, or chmod 700 it '
                             'if it has no files of other users')
        for above, problem in _exposed(folder):
            raise StartError(f'{folder} is not private: {above} {problem}; {remedy}')
        if status.st_mode & 0o077 and not _is_used_by_others(folder):
            folder.chmod(0o700)
    except OSError as error:
        if isinstance(error, StartError):
            raise
        raise StartError(f'{folder} cannot be used: {error.strerror}; {remedy}') from error
    return folder


def _is_used_by_others(folder: Path) -> bool:
    """Return whether others need access to a folder of this user, such as /run or a home."""
    real = folder.resolve()
    return len(real.parts) < 3 or real == Path(os.path.expanduser('~')).resolve()


def _exposed(folder: Path) -> Iterator[tuple[Path, str]]:
    """Find the folders and links on the path that other users could replace."""
    absolute, trusted = Path(os.path.abspath(folder)), (0, os.getuid())
    for above in dict.fromkeys((*absolute.parents, *absolute.resolve().parents)):
        status = above.lstat()
        if status.st_uid not in trusted:
            yield above, 'belongs to another user'
        elif (status.st_mode & _WRITABLE_BY_OTHERS and stat.S_ISDIR(status.st_mode)
              and not status.st_mode & stat.S_ISVTX):
            yield above, 'can be written by other users'


def robot_name(node: str = 'robot', namespace: str = '/') -> str:
    """Return the name of a robot's files: its namespace and node name."""
    return '.'.join([*(part for part in namespace.split('/') if part), node])


def robot_of(text: str) -> str:
    """Return the name of a robot's files from the name of its node, such as ``/arm/robot``."""
    return '.'.join(part for part in text.replace('.', '/').split('/') if part) or 'robot'


def node_of(robot: str) -> str:
    """Return the full name of a robot's node from the name of its files."""
    return '/' + robot.replace('.', '/')


def socket_path(name: str = 'robot') -> Path:
    """
    Return the path of a core's socket.

    :param name: from :func:`robot_name`.
    :raises StartError: the runtime folder cannot be used, or the path is too long for a socket.
    """
    path = runtime_folder() / f'{name}.sock'
    size = len(os.fsencode(path))
    if size > SOCKET_PATH_BYTES_MAXIMUM:
        raise StartError(f'the path of the socket, {path}, has {size} bytes, and Linux allows '
                         f'{SOCKET_PATH_BYTES_MAXIMUM}: set {RUNTIME_VARIABLE} to a folder with '
                         'a shorter path, or give the robot a shorter name')
    return path

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

"""The folders of a running robot, and safe opening of files that users name."""

from __future__ import annotations

from collections.abc import Mapping
import errno
import os
from pathlib import Path
import stat
import tempfile

from rt_robot_os.base.errors import StartError

RUNTIME_VARIABLE = 'RT_ROBOT_OS_RUNTIME_DIR'
_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def runtime_path(environ: Mapping[str, str], uid: int) -> Path:
    """
    Return the path of the private runtime folder of a user, without creating it.

    ``$RT_ROBOT_OS_RUNTIME_DIR``, else ``$XDG_RUNTIME_DIR/rt_robot_os``, else a private
    folder among the temporary files.
    """
    explicit = environ.get(RUNTIME_VARIABLE)
    session = environ.get('XDG_RUNTIME_DIR')
    if explicit:
        return Path(explicit)
    if session and os.access(session, os.W_OK):
        return Path(session) / 'rt_robot_os'
    return _temporary_path(uid)


def _temporary_path(uid: int) -> Path:
    return Path(tempfile.gettempdir()) / f'rt_robot_os-{uid}'


def observations_folder() -> Path:
    """
    Return the folder of pictures and clips of alarms, where a robot names no other.

    :raises StartError: a user without a home has none.
    """
    return ros_home() / 'observations'


def ros_home() -> Path:
    """
    Return the folder of ROS 2's files: ``$ROS_HOME`` or ``~/.ros``.

    A user without a home folder, as in some containers, gets a private one among the temporary
    files.

    :raises StartError: that folder belongs to another user.
    """
    home = os.path.expanduser(os.environ.get('ROS_HOME') or '~/.ros')
    if not home.startswith('~'):
        return Path(home)
    folder = _temporary_path(os.getuid())
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError as error:
        raise StartError(f'{folder} cannot be used: {error.strerror}; set ROS_HOME') from error
    if (not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid()
            or status.st_mode & _WRITABLE_BY_OTHERS):
        raise StartError(f'{folder} is not a private folder of this user; remove it, or set '
                         'ROS_HOME')
    return folder


def open_to_append(path: Path) -> int:
    """
    Open a file under a fixed name for appending.

    If others can write to the folder, they cannot redirect the writing to another file.

    :return: its file descriptor.
    :raises OSError: it cannot be opened, or belongs to another user in such a folder.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
    shared = path.parent.stat().st_mode & _WRITABLE_BY_OTHERS
    if not shared:
        return os.open(path, flags, 0o644)
    fd = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
    status = os.fstat(fd)
    if (not stat.S_ISREG(status.st_mode) or status.st_uid != os.getuid()
            or status.st_nlink != 1):
        os.close(fd)
        raise OSError(errno.EPERM, 'it is not a file of this user')
    return fd


MAX_BYTES = 1 << 20


def read_file(path: Path, max_bytes: int = MAX_BYTES) -> bytes:
    """
    Read a whole file of limited size; never waits for the writer of a pipe.

    :raises OSError: it cannot be read, is not a regular file, or is longer.
    """
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            raise OSError(errno.EINVAL, 'it is not a regular file')
    except OSError:
        os.close(fd)
        raise
    with open(fd, 'rb') as file:
        data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f'it is longer than {max_bytes} bytes')
    return data

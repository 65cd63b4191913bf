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

"""Where a core's socket and its simulated devices lie: a folder that only its user can enter."""

from __future__ import annotations

import os
from pathlib import Path
import stat

from rt_robot_os.errors import LinkError
from rt_robot_os.linux.folders import runtime_path


def runtime_folder() -> Path:
    """
    Give the private runtime folder, made if need be; :mod:`rt_robot_os.linux.folders` says where.

    :raises LinkError: the folder belongs to another user or cannot be made.
    """
    folder = runtime_path(os.environ, os.getuid())
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.lstat()
        if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
            raise LinkError(f'{folder} is not a folder of this user; remove it, or set '
                            'RT_ROBOT_OS_RUNTIME_DIR')
        if stat.S_IMODE(status.st_mode) & 0o077:
            folder.chmod(0o700)
    except OSError as error:
        if isinstance(error, LinkError):
            raise
        raise LinkError(f'{folder} cannot be used: {error.strerror}; set '
                        'RT_ROBOT_OS_RUNTIME_DIR to a folder of your own') from error
    return folder


def robot_name(node: str = 'robot', namespace: str = '/') -> str:
    """Give the name of a robot's files: its namespace and node name."""
    return '.'.join([*(part for part in namespace.split('/') if part), node])


def socket_path(name: str = 'robot') -> Path:
    """
    Give the path of a core's socket.

    :param name: from :func:`robot_name`.
    :raises LinkError: the runtime folder cannot be used.
    """
    return runtime_folder() / f'{name}.sock'

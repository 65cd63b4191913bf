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

"""One instance of a program for each robot, with a folder of its own for its data."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path

from rt_robot_os.base.errors import StartError
from rt_robot_os.linux.folders import ros_home
from rt_robot_os.linux.lock_file import LockFile
from rt_robot_os.linux.paths import runtime_folder


def data_folder(program: str, robot: str, setting: str) -> Path:
    """
    Return the folder for the data that a program keeps between its runs.

    :param setting: the folder that the user has set; empty: ``~/.ros/PROGRAM-ROBOT``.
    """
    return Path(setting).expanduser() if setting else ros_home() / f'{program}-{robot}'


@contextmanager
def single_instance(program: str, robot: str, refusal: str) -> Iterator[None]:
    """
    Hold the lock of a program for a robot, so that no second instance starts.

    :param refusal: error text for the second instance.
    :raises StartError: another instance runs, or the lock file cannot be created.
    """
    lock = LockFile(runtime_folder() / f'{robot}-{program}.lock')
    try:
        acquired = lock.acquire()
    except OSError as error:
        raise StartError(f'{lock.path} cannot be created: {error.strerror}') from error
    if not acquired:
        raise StartError(refusal)
    try:
        lock.note(pid=os.getpid())
        yield
    finally:
        lock.release()

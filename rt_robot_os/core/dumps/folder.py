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


"""The folder of the dumps: its path, the file names, and the number of dumps kept."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from datetime import timedelta
import os
from pathlib import Path
import re

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.core.dumps.dump_file import SUFFIX
from rt_robot_os.core.dumps.dump_file import write_parts
from rt_robot_os.core.dumps.dump_parts import Part
from rt_robot_os.linux.folders import ros_home

KEPT = 20
PREFIX = 'black_box_'
_WORD = re.compile(r'[^A-Za-z0-9]+')
_REASON_MAXIMUM = 40


def default_folder() -> Path:
    """
    Return ROS 2's folder for logs: ``$ROS_LOG_DIR``, ``$ROS_HOME/log`` or ``~/.ros/log``.

    :raises StartError: the user has no home, see :func:`rt_robot_os.linux.folders.ros_home`.
    """
    explicit = os.environ.get('ROS_LOG_DIR')
    if explicit:
        return expanded(explicit)
    return ros_home() / 'log'


def expanded(folder: str) -> Path:
    """Replace ``~`` by the user's home, if there is one."""
    return Path(os.path.expanduser(folder))


def file_name(robot: str, reason: str, moment: datetime) -> str:
    """
    Return the file name of a dump: for each robot, alphabetical order is order of time.

    :param moment: in local time.
    """
    short = _WORD.sub('_', reason)[:_REASON_MAXIMUM].strip('_').lower() or 'dump'
    return (f'{PREFIX}{_WORD.sub("_", robot)}_{moment:%Y%m%d_%H%M%S_%f}'[:-3]
            + f'_{short}{SUFFIX}')


def dumps(folder: Path, robot: str | None = None) -> list[Path]:
    """
    List the dumps in a folder, the oldest first; empty if the folder does not exist.

    :param robot: whose dumps; None for those of all robots.
    """
    prefix = PREFIX if robot is None else f'{PREFIX}{_WORD.sub("_", robot)}_'
    found = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                rest = entry.name.removeprefix(prefix)
                # The date must follow the name of the robot; otherwise it is a longer name.
                if (entry.name.startswith(prefix) and entry.name.endswith(SUFFIX)
                        and (robot is None or re.match(r'\d{8}_\d{6}_\d{3}_', rest))):
                    found.append((entry.stat().st_mtime_ns, entry.name))
    except OSError:
        return []
    return [folder / name for _, name in sorted(found)]


def newest(folder: Path) -> Path:
    """
    Return the newest dump of a folder.

    :raises BlackBoxError: there is none.
    """
    found = dumps(folder)
    if not found:
        raise BlackBoxError(f'{folder} holds no dump of a black box; name a file or another '
                            '--folder, or ask a running robot for one: `black_box dump`')
    return found[-1]


def keep(source: Iterable[Part], folder: Path, robot: str, reason: str,
         kept: int = KEPT) -> tuple[Path, int, list[Path]]:
    """
    Write a dump into a folder, and keep only the newest dumps of this robot.

    Old dumps are deleted before the new one is written, to free space on a full disk.

    :return: its path, its length in bytes, the deleted dumps.
    :raises BlackBoxError: it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BlackBoxError(f'{folder} cannot be created: {error.strerror}; choose another '
                            'folder (core.black_box_folder)') from error
    deleted = []
    older = dumps(folder, robot)
    for path in older[:max(0, len(older) - kept + 1)]:
        try:
            path.unlink()
            deleted.append(path)
        except OSError:
            pass  # deleted already, or owned by another user
    moment = datetime.now()
    path = folder / file_name(robot, reason, moment)
    while path.exists():  # two within a millisecond
        moment += timedelta(milliseconds=1)
        path = folder / file_name(robot, reason, moment)
    return path, write_parts(source, path), deleted

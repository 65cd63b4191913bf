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

"""The source of scans for offline mapping: a bag of ROS 2, or a text log."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import math
from pathlib import Path
from typing import Protocol

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.bags.bag import is_bag
from rt_robot_os.features.mapping.bags.bag_log import BagLog
from rt_robot_os.features.mapping.bags.bag_log import BagOptions
from rt_robot_os.features.mapping.slam.deskew import LaserMount
from rt_robot_os.features.mapping.slam.logs import TextLog
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import Floats

_UPSIDE_DOWN = 'upside-down'


class ScanSource(Protocol):
    """
    Scans that are read one by one.

    :ivar problems: a sentence for each problem, complete when all scans were read.
    """

    problems: list[str]

    def scans(self) -> Iterator[Scan]:
        """Yield all scans."""

    @property
    def bad(self) -> int:
        """Return how many lines or messages could not be read."""

    @property
    def share_read(self) -> float:
        """Return how much was read, from 0 to 1."""

    @property
    def reference(self) -> Floats | None:
        """Return the reference poses of the scans that were read; None without any."""


def opened(arguments: argparse.Namespace) -> ScanSource:
    """
    Open the log of a command line.

    :raises ConfigError: it cannot be read, or the options do not fit it.
    """
    path: Path = arguments.bag
    try:
        is_of_ros = is_bag(path)
    except OSError as error:
        raise ConfigError([f'{path}: {error.strerror}']) from error
    if not is_of_ros:
        for name in ('scan_topic', 'odom_topic', 'laser', 'session'):
            if getattr(arguments, name) is not None:
                raise ConfigError([f'--{name.replace("_", "-")}: {path} is not a bag of ROS 2'])
        return TextLog(path)
    try:
        return BagLog(path, BagOptions(
            arguments.scan_topic or '', arguments.odom_topic or '',
            None if arguments.laser is None else laser_mount(arguments.laser),
            arguments.session))
    except OSError as error:
        raise ConfigError([f'{error.filename or path}: {error.strerror or error}']) from error


def laser_mount(text: str) -> LaserMount:
    """
    Parse the mounting of a laser: ``X,Y,YAW`` in m and degrees, and ``,upside-down``.

    :raises ConfigError: it has another form.
    """
    *numbers, last = text.split(',')
    is_mirrored = last.strip() == _UPSIDE_DOWN
    try:
        x, y, yaw = (float(each) for each in (numbers if is_mirrored else [*numbers, last]))
        if not all(map(math.isfinite, (x, y, yaw))):
            raise ValueError(text)
    except ValueError:
        raise ConfigError([f'--laser {text}: must be X,Y,YAW in m and degrees, such as 0.1,0,90, '
                           f'followed by ,{_UPSIDE_DOWN} for a laser that hangs']) from None
    return LaserMount(np.array((x, y, math.radians(yaw))), is_mirrored)

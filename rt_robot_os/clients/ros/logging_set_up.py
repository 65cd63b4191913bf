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

"""Make rclpy start where its own log file cannot be written: without a home, on a full disk."""

from __future__ import annotations

import os
from pathlib import Path
import sys
import tempfile

from rt_robot_os.dumps.folder import default_folder
from rt_robot_os.dumps.folder import expanded
from rt_robot_os.errors import StartError


def logging_arguments() -> list[str]:
    """
    Check the folder of ROS 2's own log files, without which rclpy does not start.

    :return: arguments to add to the command line; standard error says what is lost.
    """
    try:
        folder = default_folder()
        if not os.environ.get('ROS_LOG_DIR') and not os.environ.get('HOME'):
            os.environ['ROS_LOG_DIR'] = str(folder)  # rcl asks for nothing but $HOME
        # rcl takes ROS_LOG_DIR with a ~ as well.
        _try(expanded(str(folder)))
    except (OSError, StartError) as error:
        reason = str(error) if isinstance(error, StartError) else (
            f'the log folder {folder} cannot be written: {error.strerror}')
        print(f'robot: {reason}; ROS 2 writes no log file. Set ROS_LOG_DIR to a folder that can '
              'be written', file=sys.stderr)
        return ['--ros-args', '--disable-external-lib-logs']
    return []


def _try(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass

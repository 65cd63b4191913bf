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

"""The program `robot`: the main job, core and ROS 2 node together."""

from __future__ import annotations

import sys

from rt_robot_os.errors import ConfigError
from rt_robot_os.settings.arguments import load_from_arguments

OK, FAILED, BAD_CONFIGURATION = 0, 1, 2


def main() -> int:
    """Run the robot until Ctrl-C or SIGTERM; the exit code is 2 for a bad configuration."""
    try:
        settings, _ = load_from_arguments(sys.argv[1:])
    except ConfigError as error:
        count = len(error.problems)
        print(f'robot: {count} problem{"s" if count > 1 else ""} in the configuration, '
              'nothing was started:', file=sys.stderr)
        for problem in error.problems:
            print(f'  {problem}', file=sys.stderr)
        return BAD_CONFIGURATION
    # Everything of ROS 2 comes after the check: it takes a second, and a typing mistake does not.
    from rt_robot_os.ros.program import spin
    return spin(settings)

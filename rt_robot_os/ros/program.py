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
The program `robot`: the core and the ROS 2 node together.

Run the robot until Ctrl-C or SIGTERM; the exit code is 2 for a bad configuration.
"""

from __future__ import annotations

import sys
from typing import Final

from rt_robot_os.base.programs import Program

main: Final = Program('robot', 'rt_robot_os.ros.command:run', handles_signals=True,
                      one_thread=True)


if __name__ == '__main__':
    sys.exit(main())

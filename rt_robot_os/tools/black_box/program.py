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
The program `black_box`: save, read and draw the last activity of a core.

The exit code is 1 if the command failed; the message gives the reason.
"""

from __future__ import annotations

import sys
from typing import Final

from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import Program

main: Final = Program('black_box', 'rt_robot_os.tools.black_box.command:run', broken_pipe_code=OK)


if __name__ == '__main__':
    sys.exit(main())

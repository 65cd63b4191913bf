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


"""The robot of the configuration: what it does when this computer falls silent."""

from __future__ import annotations

from collections.abc import Iterator

from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.system import System

# Rounding is no reason to warn.
_ROUNDING = 1e-6


def run_on(system: System) -> Iterator[Finding]:
    """Compare how far each motor board moves the robot on with what is tolerable."""
    boards = system.wanted.boards
    if not boards:
        yield absent('no motor board in the configuration')
        return
    # Late: it needs NumPy, and doctor runs without.
    from rt_robot_os.settings.run_on import WAY_MAX_M
    for board in boards:
        if board.way_m > WAY_MAX_M + _ROUNDING:
            yield warn(f'{board}; more than {WAY_MAX_M:g} m', Remedy((), board.remedy), weight=80)
        else:
            yield ok(str(board))


CHECKS = (
    Check('robot.run_on', 'silent computer',
          'until a motor board notices that nothing commands it, nothing stops the robot before '
          'a wall', run_on),
)

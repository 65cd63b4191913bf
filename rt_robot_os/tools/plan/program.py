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

"""The program `plan`: is this configuration of the robot schedulable."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import sys

from rt_robot_os.base.programs import Run
from rt_robot_os.base.programs import run_program


def _load() -> Run:
    from rt_robot_os.ros.core_process import CoreProcess
    from rt_robot_os.tools.plan.command import run
    return partial(run, make_core=CoreProcess)


def main(argv: Sequence[str] | None = None) -> int:
    """Analyse; the exit code is 0 schedulable, 1 not, 3 cannot be judged, 2 bad input."""
    return run_program('plan', _load, argv)


if __name__ == '__main__':
    sys.exit(main())

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

"""The program `core`: the real-time process by itself."""

from __future__ import annotations

from collections.abc import Sequence
import os
import sys

from rt_robot_os.base.programs import Run
from rt_robot_os.base.programs import run_program


def _load() -> Run:
    from rt_robot_os.core.command import run
    return run


def main(argv: Sequence[str] | None = None) -> int:
    """Run the core until it is stopped; see :mod:`rt_robot_os.core.command`."""
    if 'OPENBLAS_NUM_THREADS' not in os.environ:
        # NumPy starts threads when it is imported, and the core must have only one: restart.
        os.environ['OPENBLAS_NUM_THREADS'] = '1'
        os.execv(sys.executable, [sys.executable, '-m', 'rt_robot_os.core.program',
                                  *(sys.argv[1:] if argv is None else argv)])
    return run_program('core', _load, argv, handles_signals=True)


if __name__ == '__main__':
    sys.exit(main())

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

import os
import sys

from rt_robot_os.cli.interrupt import end_quietly


def main() -> int:
    """Run the core by hand; see :mod:`rt_robot_os.core.main`."""
    if 'OPENBLAS_NUM_THREADS' not in os.environ:
        # NumPy starts threads when it is imported, and the core has one: begin again without.
        os.environ['OPENBLAS_NUM_THREADS'] = '1'
        os.execv(sys.executable, [sys.executable, '-m', 'rt_robot_os.cli.core', *sys.argv[1:]])
    end_quietly()  # until it listens to signals
    from rt_robot_os.core.main import main as core_main
    return core_main()


if __name__ == '__main__':
    sys.exit(main())

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
Run a program that ends, with all its children, when its parent process has ended.

Started as a script, with the standard library alone and isolated from the environment, which is
the program's. Arguments: a descriptor, and the command. Nothing is written to the descriptor; it
is at its end when the process that holds the other end has ended, however that happened.
"""

from __future__ import annotations

from collections.abc import Sequence
import os
import select
import signal
import subprocess
import sys

#: Exit code when the program cannot be started, as of a shell.
NOT_STARTED = 127


def main(arguments: Sequence[str]) -> int:
    """Run the command; return its exit code, 128 and the signal if that ended it."""
    life, *command = arguments
    try:
        process = subprocess.Popen(command)
    except OSError:
        return NOT_STARTED
    waiting = select.poll()
    waiting.register(int(life), select.POLLIN | select.POLLHUP)
    waiting.register(os.pidfd_open(process.pid), select.POLLIN)
    waiting.poll()
    if process.poll() is None:  # the parent process has ended
        os.killpg(0, signal.SIGKILL)  # this one leads the group
    return process.returncode if process.returncode >= 0 else 128 - process.returncode


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))

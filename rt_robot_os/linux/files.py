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

"""Read what a user names as a file, whatever it is."""

from __future__ import annotations

import errno
import os
from pathlib import Path
import stat

LARGEST_BYTES = 1 << 20


def read_file(path: Path, most_bytes: int = LARGEST_BYTES) -> bytes:
    """
    Read a whole file; never waits for the writer of a pipe, never reads more than is sensible.

    :raises OSError: it cannot be read, is no file, or is longer.
    """
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            raise OSError(errno.EINVAL, 'it is no file')
    except OSError:
        os.close(fd)
        raise
    with open(fd, 'rb') as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise OSError(errno.EFBIG, f'it is longer than {most_bytes} bytes')
    return data

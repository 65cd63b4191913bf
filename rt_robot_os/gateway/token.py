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

"""The token that authenticates this robot: from a file that only this user can read."""

from __future__ import annotations

import os
from pathlib import Path
import re
import stat
from typing import Final

from rt_robot_os.base.errors import StartError

_MOST_BYTES: Final = 4096
_TOKEN: Final = re.compile(r'[A-Za-z0-9._~+/=:-]{8,1024}', re.ASCII)
_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO


def read_token(token_file: str) -> str:
    """
    Read the token.

    :raises StartError: there is none, or others can read the file; never with its content.
    """
    if not token_file:
        raise StartError('token_file is empty: make a token on the server with `monitor robot '
                         'add NAME`, put it into a file, and name that under /**/gateway')
    path = Path(token_file).expanduser()
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
        with open(fd, 'rb') as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise StartError(f'token_file {path} is not a file')
            data = file.read(_MOST_BYTES)
    except OSError as error:
        raise StartError(f'token_file {path} cannot be read ({error.strerror}): put the token '
                         'there that `monitor robot add NAME` printed on the server') from error
    if status.st_mode & _OTHERS or status.st_uid not in (0, os.geteuid()):
        raise StartError(f'token_file {path} can be read or written by others: chmod 600 {path}, '
                         'and have it belong to the user of the gateway')
    token = data.decode('ascii', 'replace').strip()
    if not _TOKEN.fullmatch(token):
        raise StartError(f'token_file {path} holds no token: it must be one line of 8 to 1024 '
                         'letters and digits, as `monitor robot add NAME` prints it')
    return token

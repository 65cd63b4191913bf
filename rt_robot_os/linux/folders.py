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

"""Where the files of a running robot belong."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
import tempfile

RUNTIME_VARIABLE = 'RT_ROBOT_OS_RUNTIME_DIR'


def runtime_path(environ: Mapping[str, str], uid: int) -> Path:
    """
    Tell which folder is the private runtime folder of a user, without making it.

    ``$RT_ROBOT_OS_RUNTIME_DIR``, else ``$XDG_RUNTIME_DIR/rt_robot_os``, else a folder of the
    user's own in the folder for temporary files.
    """
    explicit = environ.get(RUNTIME_VARIABLE)
    session = environ.get('XDG_RUNTIME_DIR')
    if explicit:
        return Path(explicit)
    if session and os.access(session, os.W_OK):
        return Path(session) / 'rt_robot_os'
    return Path(tempfile.gettempdir()) / f'rt_robot_os-{uid}'

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

"""The optional libraries that read and write MCAP, checked before their import."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.base.needs import require


# Dependencies of mcap from PyPI, which may be missing with mcap from another source.
_COMPRESSIONS: Final = {'zstd': 'zstandard', 'lz4': 'lz4'}


def need_mcap(compression: str = 'none') -> None:
    """
    Check that the libraries are installed, before the modules that import them are imported.

    :param compression: for writing.
    :raises RecordingError: a library is missing or too old.
    """
    require('recordings', 'mcap', error=RecordingError)
    needed = _COMPRESSIONS.get(compression)
    if needed is not None:
        require(f'--compression {compression}', needed, error=RecordingError)

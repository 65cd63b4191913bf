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

"""The libraries that read and write MCAP; optional, so they are looked for here first."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.base.needs import require


# They come with mcap from PyPI, but need not where it comes from elsewhere.
_COMPRESSIONS: Final = {'zstd': 'zstandard', 'lz4': 'lz4'}


def need_mcap(compression: str = 'none') -> None:
    """
    Make sure that the libraries are there, before anything that imports them is imported.

    :param compression: what is written with it.
    :raises RecordingError: one is missing or too old.
    """
    require('recordings', 'mcap', error=RecordingError)
    needed = _COMPRESSIONS.get(compression)
    if needed is not None:
        require(f'--compression {compression}', needed, error=RecordingError)

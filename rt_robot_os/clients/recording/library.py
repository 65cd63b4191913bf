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

"""The library that reads and writes MCAP; optional, so it is looked for here first."""

from __future__ import annotations

from importlib.util import find_spec

from rt_robot_os.errors import RecordingError


def need_mcap() -> None:
    """
    Make sure that the library is there, before anything that imports it is imported.

    :raises RecordingError: it is not.
    """
    if find_spec('mcap') is None:
        raise RecordingError('recordings need the Python package mcap, which is not installed: '
                             "pip install 'mcap>=1.3'")

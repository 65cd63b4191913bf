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


"""Where the configuration that comes with the package lies."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import sys

from rt_robot_os.errors import ConfigError

_PACKAGE = 'rt_robot_os'


def default_path(name: str = 'robot.yaml') -> Path:
    """
    Find a configuration file of this package, without asking ament.

    The source tree's own comes first when the code runs from there, then the one installed beside
    this code, then those of ``AMENT_PREFIX_PATH``.

    :raises ConfigError: there is none; names the places.
    """
    tried = []
    for folder in _folders():
        path = folder / name
        if path.is_file():
            return path
        tried.append(str(path))
    raise ConfigError([f'{name}: this configuration is not installed; looked for '
                       + ', '.join(dict.fromkeys(tried))])


def _folders() -> Iterator[Path]:
    here = Path(__file__).resolve()
    root = here.parents[2]
    if (root / 'resource' / _PACKAGE).is_file():
        yield root / 'config'
    share = Path('share') / _PACKAGE / 'config'
    # <prefix>/lib/python3.x/site-packages/rt_robot_os/settings/paths.py, or one folder deeper.
    for prefix in here.parents[5:7]:
        yield prefix / share
    for entry in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if entry:
            yield Path(entry) / share
    yield Path(sys.prefix) / share

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

"""Files that a setting names by a path or by a ROS URL."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.linux.folders import read_file


def path_of(url: str, key: str) -> Path:
    """
    Resolve a path, ``file://``, or ``package://package/path``.

    :param key: of the setting, for the errors.
    :raises ConfigError: the URL is of another kind, or the package is not installed.
    """
    if url.startswith('file://'):
        return Path(unquote(url.removeprefix('file://')))
    if url.startswith('package://'):
        package, _, rest = unquote(url.removeprefix('package://')).partition('/')
        try:
            from ament_index_python.packages import get_package_share_directory
            return Path(get_package_share_directory(package)) / rest
        except Exception as error:  # PackageNotFoundError is a KeyError; the module may be missing
            raise ConfigError([f'{key} = {url!r}: package {package!r} is not found: source its '
                               'workspace, or give a path']) from error
    if '://' in url:
        raise ConfigError([f'{key} = {url!r}: give a path, file:// or package://'])
    return Path(url).expanduser()


def read_text_file(url: str, key: str, wanted: str) -> tuple[Path, str]:
    """
    Read a text file; not for the real-time loop.

    :param key: of the setting that names it, for the errors.
    :param wanted: description of a valid file, for the errors, such as ``a YAML file with nodes``.
    :return: its path and its text.
    :raises ConfigError: it cannot be read; the message has the remedy.
    """
    path = path_of(url, key)
    try:
        return path, read_file(path).decode('utf-8-sig')
    except OSError as error:
        raise ConfigError([f'{key} = {url!r}: {error.strerror}: give the path of {wanted}'
                           ]) from error
    except UnicodeDecodeError as error:
        raise ConfigError([f'{key} = {url!r} is not UTF-8 text: give {wanted}']) from error

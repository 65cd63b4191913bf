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

"""Reads the files that the case `devices` compares with, and says what is wrong with one."""

from __future__ import annotations

from pathlib import Path

from rt_robot_os.base.errors import ConfigError

_LARGEST = 64 << 20


def text_of(path: Path) -> str:
    """
    Read a file of text.

    :raises ConfigError: it cannot be read, or is no text.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise ConfigError([f'{path}: has more than {_LARGEST >> 20} MiB'])
        return path.read_text(encoding='utf-8')
    except OSError as error:
        raise ConfigError([f'{path}: cannot be read: {error.strerror}']) from error
    except UnicodeDecodeError as error:
        raise ConfigError([f'{path}: is no text: give sentences as JSON, or a transcript']) from (
            error)

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
Check the output files of a command line before any work is done.

Otherwise an hour of simulation is lost when its picture cannot be written at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.needs import lacking

#: The formats that matplotlib can write, by file name extension.
PICTURES: Final = ('.png', '.svg', '.pdf', '.jpg', '.jpeg', '.webp')


def check_output(option: str, path: Path | None, endings: Sequence[str] = ()) -> None:
    """
    Ensure that a file can be written.

    :param option: the argument that names it, for the message.
    :param path: of the file; None when it is not requested.
    :param endings: the allowed extensions; empty allows all.
    :raises ConfigError: it cannot be written, or has another extension.
    """
    if path is None:
        return
    folder = path.parent
    wrong = ''
    if endings and path.suffix.lower() not in endings:
        wrong = f'the name must end with {_listed(endings)}'
    elif not folder.is_dir():
        wrong = f'there is no folder {folder}'
    elif path.is_dir():
        wrong = 'is a folder: give the name of a file'
    elif not os.access(path if path.exists() else folder, os.W_OK):
        wrong = 'cannot be written: permission denied'
    if wrong:
        raise ConfigError([f'{option} {path}: {wrong}'])


def check_picture(option: str, path: Path | None, endings: Sequence[str] = PICTURES) -> None:
    """
    Ensure that a picture can be drawn and written.

    :raises ConfigError: as for :func:`check_output`, or matplotlib is missing or too old.
    """
    check_output(option, path, endings)
    if path is not None and (text := lacking(option, 'matplotlib')):
        raise ConfigError([text])


def _listed(endings: Sequence[str]) -> str:
    return endings[0] if len(endings) == 1 else (
        f'{", ".join(endings[:-1])} or {endings[-1]}')

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
The state of a mapping run on the disk, so that it resumes after any end, also ``kill -9``.

Two files alternate. Each is written to a temporary file, synced and renamed, and has a number and
a checksum: one of both is always intact, and the newer intact one is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
import json
import os
from pathlib import Path
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.slam.array_file import Arrays
from rt_robot_os.features.mapping.slam.array_file import bytes_of
from rt_robot_os.features.mapping.slam.array_file import pack
from rt_robot_os.features.mapping.slam.array_file import sync_folder
from rt_robot_os.features.mapping.slam.array_file import unpack
from rt_robot_os.features.mapping.slam.array_file import write_whole
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.graph_arrays import arrays_of
from rt_robot_os.features.mapping.slam.graph_arrays import graph_of

_NAMES: Final = ('state.0.npz', 'state.1.npz')
VERSION: Final = 1
#: It is written repeatedly: speed before size.
_LEVEL: Final = 1
_EXTRA_MOST: Final = 1 << 20


class StateFile:
    """
    The state of a run in a folder.

    :param folder: created with the first write; used by this run alone.
    :ivar problems: of the files when they were last read; a line each.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self.problems: tuple[str, ...] = ()
        self._number: int | None = None

    def write(self, graph: MapGraph, extra: Mapping[str, Any] | None = None) -> int:
        """
        Write a state; the previous one stays until this one is on the disk.

        :param extra: plain values (JSON) that are stored with it.
        :return: its size in bytes.
        :raises ConfigError: it cannot be written; the previous state is unchanged.
        """
        number = (self._newest() if self._number is None else self._number) + 1
        extra_json = json.dumps(dict(extra or {})).encode()
        data = pack({'version': np.array([VERSION]), 'number': np.array([number]),
                     'extra': np.frombuffer(extra_json, np.uint8), **arrays_of(graph)}, _LEVEL)
        path = self.folder / _NAMES[number % 2]
        aside = path.with_name(f'.{path.name}.new')
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(aside, data)
            aside.replace(path)
            sync_folder(self.folder)
        except OSError as error:
            with suppress(OSError):
                aside.unlink(missing_ok=True)  # on a full disk others need that space
            raise ConfigError([f'{path}: the state of mapping cannot be written: '
                               f'{error.strerror}: free space or give another folder; the '
                               'previous state is unchanged']) from error
        self._number = number
        return len(data)

    def read(self) -> tuple[MapGraph, dict[str, Any]] | None:
        """
        Return the newest intact state, with its extra values.

        :return: None: there is none; :attr:`problems` says whether one is damaged.
        """
        for _, path, arrays in self._states():
            try:
                extra_json = json.loads(arrays['extra'].tobytes())
                if not isinstance(extra_json, dict):
                    raise ValueError('no object')
                return graph_of(arrays), extra_json
            except (KeyError, ValueError, RecursionError) as error:
                self.problems += (f'{path}: is damaged: {error}',)
        return None

    def remove(self) -> None:
        """Delete the state, as after a reset."""
        for name in _NAMES:
            (self.folder / name).unlink(missing_ok=True)
            (self.folder / f'.{name}.new').unlink(missing_ok=True)

    def _newest(self) -> int:
        return max((number for number, _, _ in self._states()), default=0)

    def _states(self) -> list[tuple[int, Path, Arrays]]:
        """Return the intact states, the newest first."""
        found, problems = [], []
        for path in (self.folder / name for name in _NAMES):
            try:
                if not _is_there(path):
                    continue
                arrays = unpack(bytes_of(path))
                found.append((_number(arrays), path, arrays))
            except ConfigError as error:
                problems.append(str(error))
            except ValueError as error:
                problems.append(f'{path}: {error}')
        self.problems = tuple(problems)
        return sorted(found, key=lambda each: each[0], reverse=True)


def _is_there(path: Path) -> bool:
    """Return whether a path exists; an inaccessible folder is an error."""
    try:
        os.lstat(path)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise ConfigError([f'{path}: cannot be read: {error.strerror}: give its folder to the '
                           'user of mapping, or give another folder']) from error
    return True


def _number(arrays: Arrays) -> int:
    version, number, extra = (arrays.get(each) for each in ('version', 'number', 'extra'))
    if version is None or number is None or extra is None or number.shape != (1,):
        raise ValueError('is not a state of mapping')
    if version.shape != (1,) or version[0] != VERSION:
        raise ValueError(f'is of version {version.tolist()}: this release reads {VERSION}')
    if extra.dtype != np.uint8 or extra.size > _EXTRA_MOST or number.dtype.kind != 'i':
        raise ValueError('is not a state of mapping')
    return int(number[0])

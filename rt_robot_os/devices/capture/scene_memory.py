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
The scene of a simulated camera: a small text in memory that one process writes and others read.

The writer never blocks, and a reader always sees one consistent state.
"""

from __future__ import annotations

from collections.abc import Mapping
import json
import mmap
import os
import struct
from typing import Any
from typing import Final

SCENE_BYTES: Final = 16 * 1024

# A counter, incremented before and after each change, so odd meanwhile; then the length of the
# text.
_HEAD: Final = struct.Struct('<QI')
_TRIES: Final = 1000


class SceneMemory:
    """
    A page of text in an anonymous file, which exists until the last process closes it.

    :param fd: of the file; it is closed with :meth:`close`.
    """

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self._map = mmap.mmap(fd, SCENE_BYTES)

    @classmethod
    def create(cls) -> SceneMemory:
        """
        Create an empty one.

        :raises OSError: no more descriptors are available.
        """
        fd = os.memfd_create('rt_robot_os.scene', os.MFD_CLOEXEC)
        os.ftruncate(fd, SCENE_BYTES)
        return cls(fd)

    def write(self, scene: Mapping[str, Any]) -> None:
        """
        Replace the text; only one process may call this.

        :raises ValueError: it is too long.
        """
        text = json.dumps(scene).encode()
        if _HEAD.size + len(text) > SCENE_BYTES:
            raise ValueError(f'a scene of {len(text)} bytes: at most {SCENE_BYTES - _HEAD.size}')
        count, _ = _HEAD.unpack_from(self._map)
        _HEAD.pack_into(self._map, 0, count + 1, len(text))
        self._map[_HEAD.size:_HEAD.size + len(text)] = text
        _HEAD.pack_into(self._map, 0, count + 2, len(text))

    def read(self) -> dict[str, Any] | None:
        """Return the text; None if there is none, or it is being written all the time."""
        for _ in range(_TRIES):
            count, length = _HEAD.unpack_from(self._map)
            text = self._map[_HEAD.size:_HEAD.size + length]
            if count and not count & 1 and _HEAD.unpack_from(self._map)[0] == count:
                found: dict[str, Any] = json.loads(text)
                return found
        return None

    def close(self) -> None:
        """Close it; may be called twice."""
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1
            self._map.close()

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

"""Copy large samples in chunks; in Python, because compiled code cannot be preempted."""

from __future__ import annotations

# Bytes copied in one native call: some 3 us where memory is slow; tasks can preempt in between.
PIECE_BYTES = 1 << 16


def touch(buffer: memoryview) -> None:
    """Have Linux allocate the pages of a buffer now instead of in the loop."""
    for start in range(0, len(buffer), PIECE_BYTES):
        piece = buffer[start:start + PIECE_BYTES]
        piece[:] = bytes(piece)


def copy_in_pieces(target: memoryview, source: memoryview) -> None:
    """
    Copy bytes; a task may be preempted between two chunks.

    :param target: of the same length as ``source``.
    """
    length = len(source)
    for start in range(0, length, PIECE_BYTES):
        stop = min(start + PIECE_BYTES, length)
        target[start:stop] = source[start:stop]

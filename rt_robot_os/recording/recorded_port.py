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

"""The port of a replayed device."""

from __future__ import annotations

import os

from rt_robot_os.base.errors import DeviceError


class RecordedPort:
    """A port that returns the bytes that were read from the real port."""

    def __init__(self) -> None:
        self.bytes_read = self.dropped_write_bytes = 0
        self.data = b''
        self.fails = False
        # Never readable: the recorded rounds come at their times.
        self._fd = os.eventfd(0, os.EFD_CLOEXEC)

    def fileno(self) -> int:
        """Return a descriptor that is never readable."""
        return self._fd

    def read(self) -> bytes:
        """
        Return the bytes of this round, once.

        :raises DeviceError: the real port failed in this round.
        """
        self._fail()
        data, self.data = self.data, b''
        self.bytes_read += len(data)
        return data

    def write(self, data: bytes) -> None:
        """
        Discard a command: the answer was recorded.

        :raises DeviceError: the real port failed in this round.
        """
        self._fail()

    def close(self) -> None:
        """Close the descriptor; may be called twice."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            os.close(fd)

    def _fail(self) -> None:
        if self.fails:
            raise DeviceError('the port failed in the recording')

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


"""Ask a core for its statistics, and find it again when it was away."""

from __future__ import annotations

from collections import deque
from datetime import datetime
import os
from pathlib import Path
from typing import Any

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.tools.top.snapshot import Sample

_ANSWER_S = 2.0
_LINES_KEPT = 200


class Source:
    """
    The core behind a socket, whichever process that is.

    :ivar lines: what it reported last, as it came: severity, source, text.
    :ivar note: why there is no connection, to be shown; empty when all is well.
    """

    def __init__(self, path: Path, name: str = 'top') -> None:
        self.path = path
        self.lines: deque[tuple[int, str, str]] = deque(maxlen=_LINES_KEPT)
        self.note = ''
        self._name = name
        self._client: LinkClient | None = None
        self._pid = 0

    def poll(self) -> Sample:
        """
        Take statistics, connecting first if need be.

        :raises LinkError: there is no core, or it does not answer; the next call tries again.
        """
        try:
            client = self._client or self._connect()
            return _with_process(client)
        except LinkError:
            self.close()
            raise

    def _connect(self) -> LinkClient:
        client = LinkClient(self.path, self._name, _ANSWER_S)
        client.on_report = self._report
        pid = int(client.core['pid'])
        if self._pid and pid != self._pid:
            self.note = (f'the core was started again at {datetime.now():%H:%M:%S} '
                         f'(pid {self._pid}, now {pid})')
            self.lines.clear()
        self._pid, self._client = pid, client
        return client

    def pump(self) -> None:
        """Read what the core sends by itself: its reports and heartbeats."""
        try:
            if self._client is not None:
                self._client.pump(0.0)
        except LinkError:
            self.close()  # the next poll reports it

    def _report(self, content: dict[str, Any]) -> None:
        self.lines.append((int(content['severity']), str(content['source']),
                           str(content['text'])))

    def close(self) -> None:
        """Disconnect; may be called twice."""
        if self._client is not None:
            self._client.close()
            self._client = None


def _with_process(client: LinkClient) -> Sample:
    statistics = client.statistics()
    cpu_s, memory = _process(int(statistics.core['pid']))
    at = datetime.now().astimezone().isoformat(timespec='milliseconds')
    return Sample(statistics, at, cpu_s, memory)


def _process(pid: int) -> tuple[float | None, int | None]:
    """Return the computing time and the resident memory of a process, if Linux reports them."""
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
        ticks = int(fields[11]) + int(fields[12])
        return ticks / os.sysconf('SC_CLK_TCK'), int(fields[21]) * os.sysconf('SC_PAGE_SIZE')
    except (OSError, ValueError, IndexError):
        return None, None  # it has ended, or lives in a container of its own

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

"""Periodic work while the server runs: delete data older than its retention time."""

from __future__ import annotations

from collections.abc import Callable
import sys
import threading
from typing import Final

from rt_robot_os.base.errors import StoreError

PERIOD_S: Final = 3600.0
FIRST_S: Final = 60.0


class Housekeeping:
    """
    The thread for this work; ended by :meth:`close`.

    :param thin: deletes expired data, and returns the number of rows for each table.
    :ivar thinned: rows deleted so far.
    :ivar fault: why the last run failed; '' after success.
    """

    def __init__(self, thin: Callable[[], dict[str, int]], *, first_s: float = FIRST_S,
                 period_s: float = PERIOD_S) -> None:
        self.thinned = 0
        self.fault = ''
        self._thin = thin
        self._waits_s = first_s, period_s
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name='housekeeping', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End after the current run."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        wait_s, period_s = self._waits_s
        while not self._closing.wait(wait_s):
            wait_s = period_s
            try:
                self.thinned += sum(self._thin().values())
                self.fault = ''
            except StoreError as error:
                self.fault = str(error)
                print(f'monitor: deleting old data failed: {error}', file=sys.stderr, flush=True)

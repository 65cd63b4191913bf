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
Detect threads in the core, where only the thread of the kernel may run.

Python gives its interpreter to a computing thread for 5 ms at a time, whatever the priorities are,
and no timer is served meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
import sys
import threading
from types import FrameType

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.core.part import Host
from rt_robot_os.core.watch import POLLS_PER_S


class ThreadWatch:
    """
    Detect Python threads that were started since this object was created.

    :param note: reports, once for each thread.
    :param owners: modules and devices by name, any of which may have started a thread.
    :ivar found: the names of the running threads.
    """

    def __init__(self, note: Callable[[str], object], owners: Mapping[str, object]) -> None:
        self.found: list[str] = []
        self._note = note
        self._owners = owners
        self._known = set(sys._current_frames())
        self._reported: set[int] = set()

    def attach(self, host: Host) -> None:
        """Poll once a second, and add the threads to the statistics."""
        if host.kernel.clock.has_signals:
            host.watch.add(self.poll, every=POLLS_PER_S)
        host.statistics.add_facts(lambda: {'threads': list(self.found)})

    def poll(self) -> None:
        """Detect threads; about 10 us, for the lowest task."""
        frames = sys._current_frames()
        strange = [ident for ident in frames
                   if ident not in self._known and ident != threading.get_ident()]
        if not strange and not self.found:
            return
        threads = {thread.ident: thread for thread in threading.enumerate()}
        self._reported.intersection_update(strange)
        self.found = []
        for ident in strange:
            thread = threads.get(ident)
            name = safe_line(thread.name if thread is not None else f'thread {ident}')
            self.found.append(name)
            if ident not in self._reported:
                self._reported.add(ident)
                self._note(_text(name, thread, frames[ident], self._owners))


def _text(name: str, thread: threading.Thread | None, frame: FrameType | None,
          owners: Mapping[str, object]) -> str:
    files = {_file_of(owner): owned for owned, owner in owners.items()}
    place, owned = '', 'unknown'
    while frame is not None:  # from the innermost call outwards
        found = files.get(frame.f_code.co_filename)
        if found is not None:
            owned = found
            place = f', {frame.f_code.co_filename}:{frame.f_lineno} in {frame.f_code.co_name}'
        frame = frame.f_back
    used_ns = _computed_ns(thread)
    return (f'thread {name!r} runs in the core (of: {owned}{place}); it has used '
            f'{used_ns // NS_PER_MS} ms of computing time. While it computes, every task waits up '
            f'to {1000 * sys.getswitchinterval():g} ms at a time, whatever the priorities: make '
            'it a task, or a separate process')


def _file_of(owner: object) -> str:
    return str(getattr(sys.modules.get(type(owner).__module__), '__file__', ''))


def _computed_ns(thread: threading.Thread | None) -> int:
    native = thread.native_id if thread is not None else None
    try:
        return int(Path(f'/proc/self/task/{native}/schedstat').read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return 0

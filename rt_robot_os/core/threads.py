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
Notice threads in the core, where there must be none but the kernel's.

Python hands its interpreter to a thread that computes for 5 ms at a time, whatever the priorities
are, and no alarm is served meanwhile.
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
from rt_robot_os.core.watch import LOOKS_A_SECOND


class ThreadWatch:
    """
    Look for Python threads that were started since this was made.

    :param note: reports, once for each thread.
    :param owners: modules and devices, which may have started one, by name.
    :ivar found: the names of those that live.
    """

    def __init__(self, note: Callable[[str], object], owners: Mapping[str, object]) -> None:
        self.found: list[str] = []
        self._note = note
        self._owners = owners
        self._known = set(sys._current_frames())
        self._told: set[int] = set()

    def attach(self, host: Host) -> None:
        """Look for them once a second, and tell which there are."""
        if host.kernel.clock.has_signals:
            host.watch.add(self.look, every=LOOKS_A_SECOND)
        host.statistics.add_facts(lambda: {'threads': list(self.found)})

    def look(self) -> None:
        """Look for them; some 10 us, for the lowest task."""
        frames = sys._current_frames()
        strange = [ident for ident in frames
                   if ident not in self._known and ident != threading.get_ident()]
        if not strange and not self.found:
            return
        threads = {thread.ident: thread for thread in threading.enumerate()}
        self._told.intersection_update(strange)
        self.found = []
        for ident in strange:
            thread = threads.get(ident)
            name = safe_line(thread.name if thread is not None else f'thread {ident}')
            self.found.append(name)
            if ident not in self._told:
                self._told.add(ident)
                self._note(_text(name, thread, frames[ident], self._owners))


def _text(name: str, thread: threading.Thread | None, frame: FrameType | None,
          owners: Mapping[str, object]) -> str:
    files = {_file_of(owner): owned for owned, owner in owners.items()}
    place, owned = '', 'unknown'
    while frame is not None:  # from what it does now to where it began
        found = files.get(frame.f_code.co_filename)
        if found is not None:
            owned = found
            place = f', {frame.f_code.co_filename}:{frame.f_lineno} in {frame.f_code.co_name}'
        frame = frame.f_back
    used_ns = _computed_ns(thread)
    return (f'thread {name!r} runs in the core (of: {owned}{place}); it has computed '
            f'{used_ns // NS_PER_MS} ms. While it computes, every task waits for up to '
            f'{1000 * sys.getswitchinterval():g} ms at a time, whatever the priorities: make it a '
            'task, or a process of its own')


def _file_of(owner: object) -> str:
    return str(getattr(sys.modules.get(type(owner).__module__), '__file__', ''))


def _computed_ns(thread: threading.Thread | None) -> int:
    native = thread.native_id if thread is not None else None
    try:
        return int(Path(f'/proc/self/task/{native}/schedstat').read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return 0

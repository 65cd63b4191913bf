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
How much of the core's time clients may take: a bounded share, divided among those who want more.

A client that sends more than its share is not read until the next interval. Its packets wait in
its socket, and the full socket makes it wait (back-pressure). Nothing is lost on this side.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.session import Session

INTERVAL_NS = 20 * NS_PER_MS
# Packets of ordinary length, of all clients together: 10000 a second.
UNITS_PER_INTERVAL = 200
# Nobody gets more than half of them.
_SHARERS_MINIMUM = 2
_GREEDY_NS = NS_PER_S

LINES_AT_ONCE = 10
LINE_NS = NS_PER_S


class Shares:
    """
    Divide each interval among the clients.

    One that used up its share counts as greedy for a second, and the greedy share the interval.
    """

    def __init__(self) -> None:
        self.end_ns = 0

    def begin(self, sessions: Iterable[Session], now_ns: int) -> list[Session]:
        """
        Give everybody a new share when the interval is over.

        :return: those that were paused and may go on.
        """
        if now_ns < self.end_ns:
            return []
        sessions = list(sessions)
        greedy = sum(session.greedy_ns > now_ns for session in sessions)
        share = UNITS_PER_INTERVAL // max(_SHARERS_MINIMUM, greedy)
        self.end_ns = now_ns + INTERVAL_NS
        resumed = [session for session in sessions if session.paused]
        for session in sessions:
            session.left = share
            session.paused = False
        return resumed

    def used_up(self, session: Session, now_ns: int) -> bool:
        """Look whether a client has to wait for the next interval."""
        if session.left > 0:
            return False
        session.paused = True
        session.greedy_ns = now_ns + _GREEDY_NS
        return True


class Lines:
    """
    Rate limit of the log lines about clients: the first are logged, a flood is summed up.

    :param tell: gets each line.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._left = LINES_AT_ONCE
        self._next_ns = 0
        self._held = 0

    def note(self, now_ns: int) -> bool:
        """Return whether a line may be logged; if not, it is counted."""
        self.sweep(now_ns)
        if self._left:
            self._left -= 1
            return True
        self._held += 1
        return False

    def sweep(self, now_ns: int) -> None:
        """Regain a line each second, and sum up; a few times a second."""
        if now_ns < self._next_ns:
            return
        earned = 1 + (now_ns - self._next_ns) // LINE_NS if self._next_ns else LINES_AT_ONCE
        self._next_ns = now_ns + LINE_NS
        self._left = min(LINES_AT_ONCE, self._left + earned)
        if self._held and self._left:
            self._left -= 1
            held, self._held = self._held, 0
            self._tell(f'{held} more lines about clients that came and went; /diagnostics counts '
                       'them (clients_accepted, clients_refused)')

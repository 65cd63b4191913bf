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
Limits on the packets of clients, and on the log lines about them.

A client that uses up its quota is not read until the next interval. Its packets wait in its
socket, and the full socket makes the client wait (back-pressure). The core loses nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.session import ClientSession

INTERVAL_NS = 20 * NS_PER_MS
# Packets of ordinary length, of all clients together: 10000 per second.
UNITS_PER_INTERVAL = 200
# A single client gets at most half of them.
_DIVISOR_MINIMUM = 2
_OVER_QUOTA_NS = NS_PER_S

LINE_BURST = 10
LINE_NS = NS_PER_S


class ClientQuotas:
    """
    Give each client a quota of packets for each interval.

    A client that used up its quota counts as over its quota for a second. The packets of an
    interval are divided by the number of such clients.
    """

    def __init__(self) -> None:
        self.end_ns = 0

    def renew(self, sessions: Iterable[ClientSession], now_ns: int) -> list[ClientSession]:
        """
        Renew the quota of all clients when the interval has ended.

        :return: the clients that were paused and may send again.
        """
        if now_ns < self.end_ns:
            return []
        sessions = list(sessions)
        over_quota = sum(session.over_quota_until_ns > now_ns for session in sessions)
        share = UNITS_PER_INTERVAL // max(_DIVISOR_MINIMUM, over_quota)
        self.end_ns = now_ns + INTERVAL_NS
        resumed = [session for session in sessions if session.paused]
        for session in sessions:
            session.quota = share
            session.paused = False
        return resumed

    def pause_if_exhausted(self, session: ClientSession, now_ns: int) -> bool:
        """Pause a client that has used up its quota until the next interval; return whether."""
        if session.quota > 0:
            return False
        session.paused = True
        session.over_quota_until_ns = now_ns + _OVER_QUOTA_NS
        return True


class LogRateLimiter:
    """
    Rate limit of the log lines about clients (a token bucket); dropped lines are summarised.

    :param log: called with the summary.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._left = LINE_BURST
        self._next_ns = 0
        self._held = 0

    def allow(self, now_ns: int) -> bool:
        """Return whether a line may be logged; otherwise it is counted."""
        self.refill(now_ns)
        if self._left:
            self._left -= 1
            return True
        self._held += 1
        return False

    def refill(self, now_ns: int) -> None:
        """Add one token per second, and log the summary; call it a few times a second."""
        if now_ns < self._next_ns:
            return
        earned = 1 + (now_ns - self._next_ns) // LINE_NS if self._next_ns else LINE_BURST
        self._next_ns = now_ns + LINE_NS
        self._left = min(LINE_BURST, self._left + earned)
        if self._held and self._left:
            self._left -= 1
            held, self._held = self._held, 0
            self._log(f'{held} more lines about clients that connected and left; /diagnostics '
                      'counts them (clients_accepted, clients_refused)')

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
Which sessions hold WebSockets, and how many: one session or one user cannot take all of them.

A session is counted from the handshake to the end of the connection, so that what is looked up
each second are the sessions that are connected now.
"""

from __future__ import annotations

from collections import Counter
import threading
from typing import Final

from rt_robot_os.monitor.security.sessions import Session

#: WebSockets of one session, which is a browser with its tabs: each has up to four.
OF_A_SESSION: Final = 16
#: Of one user, with all sessions.
OF_A_USER: Final = 32


class Connected:
    """The sessions that hold connections; safe for several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sessions: Counter[str] = Counter()
        self._users: Counter[str] = Counter()
        #: Refused because the session or the user had as many as they may have.
        self.refused = 0

    def add(self, session: Session) -> bool:
        """Count a connection; False when the session or its user has too many."""
        with self._lock:
            if (self._sessions[session.id] >= OF_A_SESSION
                    or self._users[session.user] >= OF_A_USER):
                self.refused += 1
                return False
            self._sessions[session.id] += 1
            self._users[session.user] += 1
            return True

    def remove(self, session: Session) -> bool:
        """Count a connection that has ended; True when it was the last of its session."""
        with self._lock:
            for counts, key in ((self._sessions, session.id), (self._users, session.user)):
                counts[key] -= 1
                if counts[key] <= 0:
                    del counts[key]
            return session.id not in self._sessions

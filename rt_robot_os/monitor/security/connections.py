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
Counts the WebSockets of sessions, so that one session or one user cannot use all of them.

A session is counted from the handshake to the end of the connection, so that the check each second
covers only connected sessions.
"""

from __future__ import annotations

from collections import Counter
import threading
from typing import Final

from rt_robot_os.monitor.security.sessions import Session

#: Most WebSockets of one session, which is a browser; each of its tabs has up to four.
OF_A_SESSION: Final = 16
#: Most WebSockets of all sessions of one user.
OF_A_USER: Final = 32


class Connected:
    """The sessions that hold connections; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sessions: Counter[str] = Counter()
        self._users: Counter[str] = Counter()
        #: Connections refused because the session or the user had too many.
        self.refused = 0

    def add(self, session: Session) -> bool:
        """Add a connection; False when the session or its user has too many."""
        with self._lock:
            if (self._sessions[session.id] >= OF_A_SESSION
                    or self._users[session.user] >= OF_A_USER):
                self.refused += 1
                return False
            self._sessions[session.id] += 1
            self._users[session.user] += 1
            return True

    def remove(self, session: Session) -> bool:
        """Remove a connection; True when it was the last of its session."""
        with self._lock:
            for counts, key in ((self._sessions, session.id), (self._users, session.user)):
                counts[key] -= 1
                if counts[key] <= 0:
                    del counts[key]
            return session.id not in self._sessions

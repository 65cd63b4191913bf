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

"""The dependencies between parts of the server; made once, passed to each router."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from typing import TYPE_CHECKING

from rt_robot_os.monitor.settings import MonitorSettings

if TYPE_CHECKING:
    from rt_robot_os.monitor.live.hub import Hub


@dataclass
class Services:
    """
    The parts of a server.

    :ivar store: the database; its functions block, and are for threads.
    :ivar writer: ``await writer.put(robot, boot, records)`` returns when they are on the disk.
    :ivar hub: live data; for the event loop alone.
    :ivar accounts: users, sessions, robots' tokens.
    :ivar audit: ``audit.note(actor, action, object, **details)``; ``audit.note_soon`` does not
        wait for the disk.
    :ivar maps: maps of robots.
    :ivar connections: all connections; None when another server runs the app.
    :ivar media: pictures and files; None without a store.
    :ivar story: the story of a demonstration; None without one.
    :ivar other_server: the error when another server took the database; else empty.
    """

    settings: MonitorSettings
    store: Any
    writer: Any
    hub: Hub
    accounts: Any
    audit: Any
    maps: Any = None
    connections: Any = None
    media: Any = None
    story: Any = None
    other_server: str = ''

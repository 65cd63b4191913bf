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


"""What keeps records of a gateway, without a network; the test steps it by a clock of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from uuid import uuid4

from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.record_queue import RecordQueue
from rt_robot_os.gateway.settings import GatewaySettings


class NoNetwork:
    """A connection of which nothing is heard."""

    connected = False

    def wake(self) -> None:
        pass


def keeper_in(folder: Path, clock: Any, said: list[str], **more: Any) -> RecordQueue:
    """Make what keeps records in a folder; the caller steps it."""
    none: Any = None
    server: Any = NoNetwork()
    context = GatewayContext(none, server, GatewaySettings(**more), none, none, said.append,
                             folder)
    return RecordQueue(context, str(uuid4()), clock)

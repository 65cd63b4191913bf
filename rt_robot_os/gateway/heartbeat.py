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

"""The heartbeat on the robot's bus while the connection to the server works."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
import json
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Part
from rt_robot_os.messages.cdr import string_message

HEARTBEAT: Final = 'monitor/heartbeat'
_CHARACTERS: Final = 3900
_LEAST: Final = ('connected', 'waiting', 'kept', 'stored')


class Heartbeat(Part):
    """
    Publish the counters while the server answers; a rule on silence reports when it does not.

    :param counters: of the whole gateway.
    """

    def __init__(self, context: GatewayContext, counters: Callable[[], Mapping[str, Any]]) -> None:
        super().__init__(context)
        self._counters = counters

    def publishes(self) -> Sequence[str]:
        """Publish the heartbeat if the robot lists its topic."""
        return (HEARTBEAT,)

    def _text(self) -> str:
        counters = self._counters()
        text = json.dumps(counters, separators=(',', ':'))
        if len(text.encode()) > _CHARACTERS:  # limit of the topic; truncated JSON would be invalid
            text = json.dumps({key: counters.get(key) for key in _LEAST})
        return text

    async def run(self) -> None:
        """Publish periodically."""
        while True:
            if self.context.server.connected and self.context.robot.has(HEARTBEAT):
                text = self._text()
                try:
                    self.context.robot.publish(HEARTBEAT, string_message(text))
                except LinkError:
                    pass  # the next one says as much
            await asyncio.sleep(self.context.settings.heartbeat_s)

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

"""Camera and microphone in scenarios: they answer orders, unless the camera fails."""

from __future__ import annotations

from functools import partial
import json
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.sim.scenarios.timeline import seconds
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.fixture import CoreFixture
from rt_robot_os.tools.rehearse.topics import publish_text
from rt_robot_os.tools.rehearse.topics import received_json

# Time until a picture is stored on the disk.
_PICTURE_NS: Final = NS_PER_S
_LEVEL_NS: Final = NS_PER_S // 10
_QUIET_DB, _LOUD_DB = -60.0, -15.0


class CameraAndMicrophone:
    """
    Simulates the devices ``camera`` and ``microphone``.

    :param world: the world with the people, who may speak.
    :ivar failing: the camera does not answer.
    :ivar noise: it is loud.
    """

    def __init__(self, world: World) -> None:
        self.failing = self.noise = False
        self._world = world
        self._timeline = VirtualTimeline()

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics; a new core has no pending orders."""
        self._timeline.clear()
        self._orders = fixture.reader('camera/observe')
        self._observed = fixture.publisher('camera/observed')
        self._level = fixture.publisher('sound/level')

    def step(self, now_ns: int) -> None:
        """Receive orders, answer completed ones, and publish the sound level."""
        self._timeline.now_ns = now_ns
        for order in received_json(self._orders):
            if not self.failing:
                after_s = order.get('after_s', 0.0) if order['order'] == 'clip' else 0.0
                self._timeline.after(_PICTURE_NS + seconds(after_s),
                                     partial(self._answer, order))
        self._timeline.run_until(now_ns)
        if self._level is not None and now_ns % _LEVEL_NS == 0:
            is_loud = self.noise or any(each.speaks for each in self._world.people)
            self._level.msg.data = _LOUD_DB if is_loud else _QUIET_DB
            self._level.publish(now_ns)

    def _answer(self, order: dict[str, Any]) -> None:
        publish_text(self._observed, json.dumps({
            'id': order['id'], 'alarm': order['alarm'], 'subject': order['subject'],
            'kind': order['order'], 'camera': 'camera', 'file': f'{order["id"]}.jpg'}),
                     self._timeline.now_ns)

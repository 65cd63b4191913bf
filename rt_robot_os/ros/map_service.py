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

"""A service that returns the last map of a topic of the core: ``nav_msgs/srv/GetMap``."""

from __future__ import annotations

from typing import Any

from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.link.reader import SampleHandler
from rt_robot_os.settings.service_model import ServiceSettings


class MapService:
    """
    One service; without a core it continues to return its last map.

    :ivar calls: number of calls.
    :ivar empty: calls that were answered with an empty map, because none was received.
    """

    def __init__(self, node: Node, settings: ServiceSettings, group: ReentrantCallbackGroup
                 ) -> None:
        self.settings = settings
        self.calls = self.empty = 0
        self._node = node
        self._cdr = b''
        self._mirrored: SampleHandler | None = None
        self.entity = node.create_service(
            GetMap, settings.service, self._respond, callback_group=group)

    def connect(self, client: LinkClient) -> None:
        """
        Use a new connection, after its mirrors were connected.

        :raises LinkError: the core has no such topic.
        """
        info = client.topics.get(self.settings.topic)
        if info is None:
            raise LinkError(f'the core has no topic {self.settings.topic!r} for a service that '
                            'returns its last sample; was it started with another configuration?')
        self._mirrored = client.sample_handlers.get(info.channel)
        client.sample_handlers[info.channel] = self._receive

    def activate(self, client: LinkClient) -> None:
        """
        Request the map from the core, unless a mirror has done so.

        :raises LinkError: the core refuses.
        """
        if self._mirrored is None:
            client.mirror(self.settings.topic, 'latest', initial=True)

    def _receive(self, stamp_ns: int, missed: int, cdr: memoryview) -> None:
        if self._mirrored is not None:
            self._mirrored(stamp_ns, missed, cdr)  # it writes the time of day into the header
        self._cdr = cdr.tobytes()

    def _respond(self, request: Any, response: Any) -> Any:
        self.calls += 1
        if self._cdr:
            response.map = deserialize_message(self._cdr, OccupancyGrid)
        else:
            self.empty += 1
            self._node.get_logger().warn(
                f'{self.entity.service_name}: no map was received on {self.settings.topic}: the '
                'response is empty')
        return response

    def counters(self) -> dict[str, Any]:
        """Return its counters for /diagnostics."""
        return {'calls': self.calls, 'empty': self.empty, 'map_bytes': len(self._cdr)}

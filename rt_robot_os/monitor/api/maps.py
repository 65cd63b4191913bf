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


"""The maps of robots for pages."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from fastapi import Depends
from rt_robot_os.messages.uplink.maps import MapMessage
from rt_robot_os.monitor.api.answers import refusal
from rt_robot_os.monitor.api.answers import unknown
from rt_robot_os.monitor.api.models import ShownMap
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services


def router(services: Services) -> APIRouter:
    """Return the endpoint."""
    made = APIRouter(prefix='/api', tags=['robots'])

    @made.get('/robots/{robot}/map', response_model=ShownMap)
    def one_map(robot: str, actor: Actor = Depends(allowed(Permission.SEE))) -> dict[str, Any]:
        """
        Return the map of a robot.

        ``cells`` is base64 of zlib of one byte per cell, row by row from the lower left: 0 free to
        100 occupied, 255 unknown. ``origin`` is x and y in m and the yaw in rad of the outer
        corner of the first cell.
        """
        if not services.hub.may_see_robot(actor, robot):
            raise unknown('robot')
        found: MapMessage | None = services.maps.get(robot) if services.maps else None
        if found is None:
            raise refusal(404, 'this robot has sent no map',
                          'set map in the section of its gateway to the YAML file of its planner')
        return found.content()

    return made

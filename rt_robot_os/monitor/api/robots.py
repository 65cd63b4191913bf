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

"""Robots and people that the user may see."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from fastapi import Depends
from rt_robot_os.monitor.api.answers import unknown
from rt_robot_os.monitor.api.models import ShownPerson
from rt_robot_os.monitor.api.models import ShownRobot
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter(prefix='/api', tags=['robots'])
    hub = services.hub

    @found.get('/robots', response_model=list[ShownRobot], response_model_exclude_unset=True)
    async def robots(actor: Actor = Depends(allowed(Permission.SEE))) -> list[dict[str, Any]]:
        """Return the robots that the user may see."""
        rights = hub.rights_of(actor)
        return [each.shown(rights) for each in hub.seen(rights)]

    @found.get('/robots/{robot}', response_model=ShownRobot, response_model_exclude_unset=True)
    async def one_robot(robot: str, actor: Actor = Depends(allowed(Permission.SEE))
                        ) -> dict[str, Any]:
        """Return a robot."""
        if not hub.may_see_robot(actor, robot):
            raise unknown('robot')
        return hub.robots[robot].shown(hub.rights_of(actor))

    @found.get('/people', response_model=list[ShownPerson])
    async def people(actor: Actor = Depends(allowed(Permission.SEE))) -> list[dict[str, Any]]:
        """Return the people that the user may see, each with the robots they live with."""
        return hub.people(hub.rights_of(actor))

    return found

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

"""Charts of people's signs: lowest, mean and highest value per pixel."""

from __future__ import annotations

from typing import Annotated
from typing import Any

from fastapi import APIRouter
from fastapi import Depends
from fastapi import Query
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.api.alarms import Time
from rt_robot_os.monitor.api.answers import away
from rt_robot_os.monitor.api.answers import refusal
from rt_robot_os.monitor.api.answers import unknown
from rt_robot_os.monitor.api.models import ShownChart
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.store.charts import PIXELS_MOST
from rt_robot_os.monitor.store.stretches import stretches


def router(services: Services) -> APIRouter:
    """Return the endpoint."""
    found = APIRouter(prefix='/api/people', tags=['charts'])
    hub = services.hub

    def shown(actor: Actor, alarm: dict[str, Any]) -> dict[str, Any] | None:
        robot = hub.robots.get(alarm['robot'])
        return robot.alarm_shown(alarm, hub.rights_of(actor)) if robot is not None else None

    @found.get('/{person:path}/charts',
               response_model=ShownChart, response_model_exclude_unset=True)
    def chart(person: str, sign: Annotated[str, Query(max_length=100)], start: Time, end: Time,
              pixels: Annotated[int, Query(ge=1, le=PIXELS_MOST)] = 1000,
              actor: Actor = Depends(allowed(Permission.HEALTH))) -> dict[str, Any]:
        """
        Return a chart of a sign: parallel lists, with an entry for each span that has values.

        ``start`` and ``end`` are UTC in ns. ``bucket_ns`` is the span of an entry, ``bad`` lists
        ranges without a good value and the reason (for at most two days), ``alarms`` those about
        the person that were open in this time.
        """
        if not actor.may_see(person):
            raise unknown('person')
        if end <= start:
            raise refusal(422, 'end is not after start', 'give both in ns since 1970, UTC')
        try:
            services.audit.read(actor, 'health.read', person, sign=sign)
            made = services.store.chart(person, sign, start, end, pixels)
            with services.store.reading() as connection:
                bad = stretches(connection, person, sign, start, end)
        except StoreError as error:
            raise away(error) from error
        made.alarms = [each for each in (shown(actor, one) for one in made.alarms)
                       if each is not None]
        return {**made.as_dict(), 'bucket_ns': made.width_ns, 'bad': bad}

    return found

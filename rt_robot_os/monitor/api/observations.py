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

"""Observations of people, a page at a time; the audit records who has read them."""

from __future__ import annotations

from typing import Annotated
from typing import Any

from fastapi import APIRouter
from fastapi import Depends
from fastapi import Query
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.api.alarms import Time
from rt_robot_os.monitor.api.alarms import TIME_MOST
from rt_robot_os.monitor.api.answers import away
from rt_robot_os.monitor.api.answers import unknown
from rt_robot_os.monitor.api.models import ShownObservation
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter(prefix='/api', tags=['observations'])

    @found.get('/observations', response_model=list[ShownObservation])
    def observations(person: Annotated[str, Query(max_length=100)],
                     sign: Annotated[str | None, Query(max_length=100)] = None,
                     start_ns: Time = 0, end_ns: Time = TIME_MOST,
                     limit: Annotated[int, Query(ge=1, le=10_000)] = 1000,
                     after_ns: Time | None = None, after_id: Time = 0,
                     actor: Actor = Depends(allowed(Permission.HEALTH))) -> list[dict[str, Any]]:
        """
        Return observations in order of time.

        For the next page set ``after_ns`` and ``after_id`` to ``t_ns`` and ``id`` of the last one.
        """
        if not actor.may_see(person):
            raise unknown('person')
        after = None if after_ns is None else (after_ns, after_id)
        try:
            services.audit.read(actor, 'health.read', person, sign=sign or 'all')
            found: list[dict[str, Any]] = services.store.observations(
                person, sign, start_ns, end_ns, limit, after)
        except StoreError as error:
            raise away(error) from error
        return found

    @found.get('/people/{person:path}/latest', response_model=list[ShownObservation])
    def latest(person: str, actor: Actor = Depends(allowed(Permission.HEALTH))
               ) -> list[dict[str, Any]]:
        """Return the newest observation of each sign of a person."""
        if not actor.may_see(person):
            raise unknown('person')
        try:
            services.audit.read(actor, 'health.read', person, sign='latest')
            found: list[dict[str, Any]] = services.store.latest(frozenset({person}))
        except StoreError as error:
            raise away(error) from error
        return found

    return found

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

"""The residents of robots: administrators see the suggestions of robots, and confirm them."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from fastapi import Depends
from pydantic import Field
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.api.answers import away
from rt_robot_os.monitor.api.answers import refusal
from rt_robot_os.monitor.api.models import ConfirmedPeople
from rt_robot_os.monitor.api.models import ShownHousehold
from rt_robot_os.monitor.api.session import Strict
from rt_robot_os.monitor.live.residents import apply
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.security.residents import MOST
from rt_robot_os.monitor.security.users import AccountError
from rt_robot_os.monitor.services import Services


class Confirmed(Strict):
    """The people who live with a robot."""

    people: list[str] = Field(max_length=MOST)


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter(prefix='/api/residents', tags=['residents'])
    accounts = services.accounts

    @found.get('', response_model=list[ShownHousehold])
    def residents(actor: Actor = Depends(allowed(Permission.ADMIN))) -> list[dict[str, Any]]:
        """Return each robot; ``people`` is null until they are confirmed once."""
        try:
            table: list[dict[str, Any]] = accounts.residents.table(accounts.robots.all())
            return table
        except StoreError as error:
            raise away(error) from error

    @found.put('/{robot}', response_model=ConfirmedPeople)
    def confirm(robot: str, form: Confirmed,
                actor: Actor = Depends(allowed(Permission.ADMIN))) -> dict[str, Any]:
        """Set the residents of a robot; they replace the previous ones."""
        try:
            household = accounts.residents.confirm(robot, form.people, actor.name)
        except AccountError as error:
            raise refusal(422, error.text, error.remedy) from None
        except StoreError as error:
            raise away(error) from error
        people = sorted(household.people or ())
        accounts.audit.note(actor, 'robot.residents', robot, people=people)
        # Pages are notified now, and records stored aside are filed within a second.
        accounts.soon(apply, services.hub, accounts.residents.all())
        services.store.file_confirmed()
        return {'people': people}

    return found

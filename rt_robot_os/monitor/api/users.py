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

"""For admins: users, the people they may see, their sessions, robot tokens, emergencies."""

from __future__ import annotations

from typing import Any
from typing import Final

from fastapi import APIRouter
from fastapi import Depends
from fastapi import Request
from pydantic import Field
from rt_robot_os.monitor.api.models import AddedRobot
from rt_robot_os.monitor.api.models import AddedUser
from rt_robot_os.monitor.api.models import Ended
from rt_robot_os.monitor.api.models import InvitationToken
from rt_robot_os.monitor.api.models import ListedSession
from rt_robot_os.monitor.api.models import Revocation
from rt_robot_os.monitor.api.models import ShownEmergency
from rt_robot_os.monitor.api.models import ShownToken
from rt_robot_os.monitor.api.models import ShownUser
from rt_robot_os.monitor.api.session import Strict
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.security.guard import refusal
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.roles import role_of
from rt_robot_os.monitor.security.users import AccountError
from rt_robot_os.monitor.security.users import MOST_PEOPLE
from rt_robot_os.monitor.security.users import shown_people
from rt_robot_os.monitor.security.users import User

_ADMIN: Final = Depends(allowed(Permission.ADMIN))
_NO_USER: Final = ('there is no such user', 'load the list again')


class NewUser(Strict):
    """A user to be added."""

    name: str = Field(max_length=128)
    role: str = Field(max_length=16)
    people: list[str] = Field(default=[], max_length=MOST_PEOPLE)


class UserChange(Strict):
    """The changes of a user."""

    role: str | None = Field(None, max_length=16)
    people: list[str] | None = Field(None, max_length=MOST_PEOPLE)
    disabled: bool | None = None


class NewRobot(Strict):
    """A robot to be added."""

    name: str = Field(max_length=64)


def router(services: Any) -> APIRouter:
    """Make the endpoints."""
    accounts: Accounts = services.accounts
    found = APIRouter(prefix='/api', tags=['users'])
    _add_users(found, accounts)
    _add_links(found, accounts)
    _add_robots(found, accounts)

    @found.get('/emergencies', response_model=list[ShownEmergency])
    def emergencies(actor: Actor = _ADMIN) -> list[dict[str, Any]]:
        return accounts.emergencies.all()

    return found


def _add_users(found: APIRouter, accounts: Accounts) -> None:
    @found.get('/users', response_model=list[ShownUser])
    def users(actor: Actor = _ADMIN) -> list[dict[str, Any]]:
        return [user.as_dict() for user in accounts.users.all()]

    @found.post('/users', status_code=201, response_model=AddedUser)
    def add(form: NewUser, request: Request, actor: Actor = _ADMIN) -> dict[str, Any]:
        try:
            user = accounts.users.add(form.name, _role(form.role), form.people, actor.name)
        except AccountError as error:
            raise refusal(422, error.text, error.remedy) from None
        accounts.audit.note(actor, 'user.add', user.name, role=user.role.value,
                            people=shown_people(user.people))
        return {**user.as_dict(), 'token': accounts.invitations.make(user.id)}

    @found.patch('/users/{user}', response_model=ShownUser)
    def change(user: str, form: UserChange, actor: Actor = _ADMIN) -> dict[str, Any]:
        before = _user(accounts, user)
        try:
            after = change_user(accounts, actor.name, before, form.role, form.people,
                                form.disabled)
        except AccountError as error:
            raise refusal(422, error.text, error.remedy) from None
        accounts.audit.note(actor, 'user.change', after.name, **differences(before, after))
        return after.as_dict()

    @found.get('/users/{user}/sessions', response_model=list[ListedSession])
    def sessions(user: str, actor: Actor = _ADMIN) -> list[dict[str, Any]]:
        return accounts.sessions.of(_user(accounts, user).id)

    @found.delete('/users/{user}/sessions', response_model=Ended)
    def end_all(user: str, actor: Actor = _ADMIN) -> dict[str, int]:
        whose = _user(accounts, user)
        count = accounts.end_sessions(user=whose.id)
        accounts.audit.note(actor, 'session.end_all', whose.name, sessions=count)
        return {'ended': count}

    @found.delete('/users/{user}/sessions/{session}', response_model=Ended)
    def end_one(user: str, session: str, actor: Actor = _ADMIN) -> dict[str, int]:
        whose = _user(accounts, user)
        count = accounts.end_sessions(session, whose.id)
        if not count:
            raise refusal(404, 'there is no such session', 'it may have ended by itself')
        accounts.audit.note(actor, 'session.end', whose.name, session=session)
        return {'ended': count}


def _add_links(found: APIRouter, accounts: Accounts) -> None:
    @found.post('/users/{user}/invitation', response_model=InvitationToken)
    def invite(user: str, actor: Actor = _ADMIN) -> dict[str, Any]:
        whose = _user(accounts, user)
        if whose.is_disabled:
            raise refusal(422, f'{whose.name} is disabled', 'enable the account first')
        token = accounts.invitations.make(whose.id)
        accounts.audit.note(actor, 'user.invite', whose.name)
        return {'token': token}


def _add_robots(found: APIRouter, accounts: Accounts) -> None:
    @found.get('/tokens', response_model=list[ShownToken])
    def robots(actor: Actor = _ADMIN) -> list[dict[str, Any]]:
        return accounts.robots.all()

    @found.post('/tokens', status_code=201, response_model=AddedRobot)
    def add(form: NewRobot, actor: Actor = _ADMIN) -> dict[str, Any]:
        try:
            robot, token = accounts.robots.add(form.name)
        except AccountError as error:
            raise refusal(422, error.text, error.remedy) from None
        accounts.audit.note(actor, 'robot.add', robot.name)
        return {'id': robot.id, 'name': robot.name, 'token': token}

    @found.delete('/tokens/{robot}', response_model=Revocation)
    def revoke(robot: str, actor: Actor = _ADMIN) -> dict[str, int]:
        try:
            name = accounts.revoke_robot(robot)
        except AccountError as error:
            raise refusal(404, error.text, 'load the list again') from None
        accounts.audit.note(actor, 'robot.revoke', name)
        return {'revoked': 1}


def change_user(accounts: Accounts, by: str, user: User, role: str | None,
                people: list[str] | None, is_disabled: bool | None) -> User:
    """
    Change a user, who must log in again if role or state change.

    :raises AccountError: the change is not possible.
    """
    after = accounts.users.change(user.id, by, role=None if role is None else _role(role),
                                  people=people, is_disabled=is_disabled)
    if (after.role, after.is_disabled) != (user.role, user.is_disabled):
        accounts.end_sessions(user=user.id)
    elif after.people != user.people:
        for each in accounts.sessions.of(user.id):
            accounts.rights_changed(each['id'])
    if after.is_disabled:
        accounts.invitations.withdraw(user.id)
    return after


def differences(before: User, after: User) -> dict[str, Any]:
    """Return the details of a change for the audit."""
    old, new = before.as_dict(), after.as_dict()
    return {name: [old[name], new[name]] for name in new if old[name] != new[name]}


def _role(text: str) -> Role:
    try:
        return role_of(text)
    except ValueError:
        raise AccountError(f'there is no role {text[:40]!r}', f'take one of {", ".join(Role)}'
                           ) from None


def _user(accounts: Accounts, user: str) -> User:
    found = accounts.users.get(user[:64])
    if found is None:
        raise refusal(404, *_NO_USER)
    return found

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

"""Login and logout: sessions, one-time links, passwords, emergencies."""

from __future__ import annotations

from typing import Any
from typing import Final

from fastapi import APIRouter
from fastapi import Depends
from fastapi import Request
from fastapi import Response
from fastapi.concurrency import run_in_threadpool
from pydantic import BaseModel
from pydantic import ConfigDict
from pydantic import Field
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.monitor.api.models import EmergencyBegun
from rt_robot_os.monitor.api.models import Ended
from rt_robot_os.monitor.api.models import Invited
from rt_robot_os.monitor.api.models import OwnSession
from rt_robot_os.monitor.api.models import SetUpNeeded
from rt_robot_os.monitor.api.models import ShownSession
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.audit import Somebody
from rt_robot_os.monitor.security.devices import AGE_S as DEVICE_AGE_S
from rt_robot_os.monitor.security.emergencies import LONGEST_REASON
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import address_of
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import check_origin
from rt_robot_os.monitor.security.guard import cookie_name
from rt_robot_os.monitor.security.guard import described
from rt_robot_os.monitor.security.guard import device_cookie_name
from rt_robot_os.monitor.security.guard import device_cookie_of
from rt_robot_os.monitor.security.guard import refusal
from rt_robot_os.monitor.security.guard import secret_of
from rt_robot_os.monitor.security.origins import is_secure
from rt_robot_os.monitor.security.passwords import BusyError
from rt_robot_os.monitor.security.passwords import check_rules
from rt_robot_os.monitor.security.roles import MAY_BREAK_GLASS
from rt_robot_os.monitor.security.roles import Permission
from rt_robot_os.monitor.security.roles import role_of
from rt_robot_os.monitor.security.users import AccountError
from rt_robot_os.monitor.security.users import key_of
from rt_robot_os.monitor.security.users import User

_JSON: Final = 'application/json'
_ANYBODY: Final = Depends(allowed(None))
#: Longest password that is hashed; a longer one is refused immediately.
_PASSWORD: Final = 256


class Strict(BaseModel):
    """A body without unexpected fields."""

    model_config = ConfigDict(extra='forbid', strict=True)


class Login(Strict):
    """Name and password of a user."""

    name: str = Field(max_length=128)
    password: str = Field(max_length=_PASSWORD)


class Unlock(Strict):
    """The password of the session's user."""

    password: str = Field(max_length=_PASSWORD)


class OneTimeLink(Strict):
    """A one-time link."""

    token: str = Field(max_length=128)


class SetUp(OneTimeLink):
    """The use of a one-time link; name and role are for the first account only."""

    name: str = Field('', max_length=128)
    password: str = Field(max_length=_PASSWORD)
    role: str = Field('owner', max_length=16)


class NewPassword(Strict):
    """A change of password."""

    old: str = Field(max_length=_PASSWORD)
    new: str = Field(max_length=_PASSWORD)


class EmergencyRequest(Strict):
    """The reason for access that was not granted."""

    person: str = Field(min_length=1, max_length=128)
    reason: str = Field(max_length=LONGEST_REASON)


def from_here(request: Request) -> None:
    """Refuse requests and forms of other sites when there is no session yet to check."""
    check_origin(request)
    if request.headers.get('content-type', '').partition(';')[0].strip().lower() != _JSON:
        raise refusal(415, 'this is not JSON', f'send it as {_JSON}')


def router(services: Any) -> APIRouter:
    """Make the endpoints."""
    accounts: Accounts = services.accounts
    found = APIRouter(prefix='/api', tags=['session'])
    door = _Door(accounts)
    _add_sessions(found, accounts, door)
    _add_links(found, accounts, door)
    _add_password(found, accounts, door)
    _add_emergencies(found, accounts, getattr(services, 'hub', None))
    return found


class _Door:
    """The common parts of login, one-time links and new passwords."""

    def __init__(self, accounts: Accounts) -> None:
        self._accounts = accounts

    async def compare(self, name: str, stored: str, password: str, address: str,
                      device: str) -> bool:
        """
        Compare a password; repeated guesses are delayed increasingly, for any account.

        :param device: the number of a known device, or the id of the requesting session; wrong
            passwords from elsewhere delay neither. Empty for an unknown device.
        :raises HTTPException: the client must wait.
        """
        lock_out, account = self._accounts.lock_out, key_of(name)
        wait = lock_out.begin(account, address, device)
        if wait:
            raise refusal(429, 'too many wrong passwords', f'wait {int(wait) + 1} s', '', wait)
        try:
            is_right = await self._accounts.passwords.matches_soon(stored, password)
        except BusyError:
            lock_out.withdraw(account, address, device)
            raise refusal(503, 'too many people log in at this moment', 'try again in a moment',
                          '', 1.0) from None
        if is_right:
            lock_out.succeed(account, address, device)
        return is_right

    async def hash_new(self, password: str, name: str) -> str:
        """
        Check a new password and make its hash.

        :raises HTTPException: it is too weak.
        """
        try:
            check_rules(password, name)
            return await self._accounts.passwords.hash_soon(password)
        except BusyError:
            raise refusal(503, 'too many passwords at this moment', 'try again in a moment', '',
                          1.0) from None
        except ValueError as error:
            raise refusal(422, str(error), 'choose another password') from None

    def let_in(self, user: User, request: Request, response: Response,
               action: str) -> dict[str, Any]:
        """Begin a session, replacing the previous one of the browser."""
        accounts, address = self._accounts, address_of(request)
        old = accounts.sessions.find(secret_of(request)) if secret_of(request) else None
        if old is not None:
            accounts.end_sessions(old.id)
        _, secret = accounts.sessions.begin(user.id, address,
                                            request.headers.get('user-agent', ''))
        session = accounts.sessions.find(secret)
        if session is None:
            raise refusal(401, 'this account was just disabled', 'ask an admin', 'login')
        accounts.audit.note(Somebody(user.name, address, user.id, user.role.value), action,
                            user.name)
        response.set_cookie(cookie_name(request), secret, httponly=True, samesite='strict',
                            secure=is_secure(request.scope['scheme']), path='/')
        device = accounts.devices.add(device_cookie_of(request), key_of(user.name))
        response.set_cookie(device_cookie_name(request), device, DEVICE_AGE_S, httponly=True,
                            samesite='strict', secure=is_secure(request.scope['scheme']),
                            path='/')
        return described(session, secret)


def _add_sessions(found: APIRouter, accounts: Accounts, door: _Door) -> None:
    @found.post('/session', dependencies=[Depends(from_here)], response_model=ShownSession)
    async def log_in(login: Login, request: Request, response: Response) -> dict[str, Any]:
        address = address_of(request)
        user = await run_in_threadpool(accounts.users.find, login.name)
        # Unknown names are processed and answered like known ones.
        stored = user.password if user is not None else ''
        device = accounts.devices.number(device_cookie_of(request), key_of(login.name))
        is_right = await door.compare(login.name, stored, login.password, address, device)
        if user is None or not is_right or user.is_disabled:
            await run_in_threadpool(accounts.audit.note, Somebody(login.name, address),
                                    'session.refused', login.name,
                                    **({'device': device} if device else {}))
            raise refusal(401, 'name or password is wrong', 'an admin can send you a new link',
                          'login')
        if accounts.passwords.is_old(user.password):
            fresh = await accounts.passwords.hash_soon(login.password)
            await run_in_threadpool(accounts.users.rehash, user.id, user.password, fresh)
        return await run_in_threadpool(door.let_in, user, request, response, 'session.begin')

    @found.get('/session', response_model=ShownSession)
    def who(request: Request, actor: Actor = _ANYBODY) -> dict[str, Any]:
        secret = secret_of(request)
        session = accounts.sessions.find(secret)
        if session is None:
            raise refusal(401, 'you are not logged in', 'log in', 'login')
        return described(session, secret)

    @found.post('/session/unlock', response_model=ShownSession)
    async def unlock(form: Unlock, request: Request, actor: Actor = _ANYBODY) -> dict[str, Any]:
        # Like a stop and an acknowledgement it also works while the database is unavailable.
        secret, sessions = secret_of(request), accounts.sessions
        if not await door.compare(actor.name, sessions.password_of(secret), form.password,
                                  actor.address, actor.session):
            accounts.audit.note_soon(actor, 'session.unlock_refused', actor.name,
                                     device=actor.session)
            raise refusal(403, 'the password is wrong', 'type it again', 'password')

        def unlock_stored() -> bool:
            sessions.unlock(actor.session)
            return True

        await accounts.questions.ask(unlock_stored, lambda: True)
        accounts.audit.note_soon(actor, 'session.unlock', actor.name)
        session = await accounts.session_of(secret)
        if session is None:
            raise refusal(401, 'this session has ended', 'log in', 'login')
        return described(session, secret)

    @found.delete('/session', response_model=Ended)
    def log_out(request: Request, response: Response, actor: Actor = _ANYBODY
                ) -> dict[str, Any]:
        accounts.end_sessions(actor.session)
        accounts.audit.note(actor, 'session.end', actor.name)
        _forget(request, response)
        return {'ended': 1}

    @found.get('/sessions', response_model=list[OwnSession])
    def own_sessions(actor: Actor = _ANYBODY) -> list[dict[str, Any]]:
        return [{**each, 'is_this': each['id'] == actor.session}
                for each in accounts.sessions.of(actor.id)]

    @found.delete('/sessions', response_model=Ended)
    def log_out_everywhere(request: Request, response: Response, actor: Actor = _ANYBODY
                           ) -> dict[str, Any]:
        count = accounts.end_sessions(user=actor.id)
        accounts.audit.note(actor, 'session.end_all', actor.name, sessions=count)
        _forget(request, response)
        return {'ended': count}

    @found.delete('/sessions/{session}', response_model=Ended)
    def end_own(session: str, actor: Actor = _ANYBODY) -> dict[str, Any]:
        count = accounts.end_sessions(session, actor.id)
        if not count:
            raise refusal(404, 'there is no such session', 'it may have ended by itself')
        accounts.audit.note(actor, 'session.end', actor.name, session=session)
        return {'ended': count}


def _forget(request: Request, response: Response) -> None:
    response.delete_cookie(cookie_name(request), httponly=True, samesite='strict',
                           secure=is_secure(request.scope['scheme']), path='/')
    response.headers['Clear-Site-Data'] = '"cache"'


def _add_links(found: APIRouter, accounts: Accounts, door: _Door) -> None:
    gone = ('this link was used, is too old, or was never one',
            'ask an admin for a new one; for the first account restart the monitor')

    @found.get('/setup', response_model=SetUpNeeded)
    def is_needed() -> dict[str, bool]:
        return {'needed': accounts.users.is_empty()}

    @found.post('/setup/check', dependencies=[Depends(from_here)], response_model=Invited)
    def check(link: OneTimeLink) -> dict[str, Any]:
        invitation = accounts.invitations.find(link.token)
        if invitation is None:
            raise refusal(404, *gone)
        user = invitation.user
        return {'first': user is None, 'name': user.name if user else '',
                'role': user.role.value if user else '', 'expires_ns': invitation.expires_ns}

    @found.post('/setup', dependencies=[Depends(from_here)], response_model=ShownSession)
    async def set_up(form: SetUp, request: Request, response: Response) -> dict[str, Any]:
        invitation = await run_in_threadpool(accounts.invitations.find, form.token)
        if invitation is None:
            raise refusal(404, *gone)
        name = invitation.user.name if invitation.user is not None else form.name
        hashed = await door.hash_new(form.password, name)
        try:
            user = await run_in_threadpool(accounts.invitations.use, form.token, name, hashed,
                                           role_of(form.role))
        except AccountError as error:
            raise refusal(422, error.text, error.remedy) from None
        except ValueError as error:
            raise refusal(422, str(error), 'choose another') from None
        if user is None:
            raise refusal(404, *gone)
        await run_in_threadpool(accounts.end_sessions, None, user.id)
        return await run_in_threadpool(door.let_in, user, request, response, 'session.set_up')


def _add_password(found: APIRouter, accounts: Accounts, door: _Door) -> None:
    @found.post('/password', response_model=ShownSession)
    async def change(form: NewPassword, request: Request, response: Response,
                     actor: Actor = _ANYBODY) -> dict[str, Any]:
        user = await run_in_threadpool(accounts.users.get, actor.id)
        if user is None or not await door.compare(user.name, user.password, form.old,
                                                  actor.address, actor.session):
            await run_in_threadpool(accounts.audit.note, actor, 'password.refused', actor.name,
                                    device=actor.session)
            raise refusal(403, 'the old password is wrong', 'type it again')
        hashed = await door.hash_new(form.new, user.name)
        await run_in_threadpool(accounts.users.set_password, user.id, hashed)
        await run_in_threadpool(accounts.invitations.withdraw, user.id)
        await run_in_threadpool(accounts.end_sessions, None, user.id)
        return await run_in_threadpool(door.let_in, user, request, response, 'password.change')


def _tell_admins(hub: Any, name: str, person: str, ends_ns: int) -> None:
    """Notify each page of an admin that a user began emergency access."""
    text = encode('emergency', {'name': name, 'person': person, 'ends_ns': ends_ns})
    for client in list(hub.clients) if hub is not None else ():
        if client.actor.may(Permission.ADMIN):
            client.send(text)


def _add_emergencies(found: APIRouter, accounts: Accounts, hub: Any) -> None:
    @found.post('/session/emergency', response_model=EmergencyBegun)
    def begin(form: EmergencyRequest, request: Request, actor: Actor = _ANYBODY) -> dict[str, Any]:
        session = accounts.sessions.find(secret_of(request))
        if session is None or session.is_locked:
            raise refusal(401, 'this session was not used for a while',
                          'type your password again', 'locked')
        if actor.role not in MAY_BREAK_GLASS:
            raise refusal(403, f'a {actor.role.value} has no access in emergencies',
                          'call who cares for the person')
        try:
            ends = accounts.emergencies.begin(actor.id, actor.session, form.person, form.reason)
        except AccountError as error:
            raise refusal(422, error.text, error.remedy) from None
        accounts.audit.note(actor, 'emergency.begin', form.person, reason=form.reason,
                            ends_ns=ends, flag='emergency')
        accounts.soon(_tell_admins, hub, actor.name, form.person, ends)
        accounts.rights_changed(actor.session)
        return {'ends_ns': ends}

    @found.delete('/session/emergency', response_model=Ended)
    def end(actor: Actor = _ANYBODY) -> dict[str, Any]:
        count = accounts.emergencies.end(actor.session)
        if count:
            accounts.audit.note(actor, 'emergency.end', actor.name, flag='emergency')
            accounts.rights_changed(actor.session)
        return {'ended': count}

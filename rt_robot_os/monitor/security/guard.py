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

"""Authentication and authorisation of each request and each WebSocket."""

from __future__ import annotations

from collections.abc import Awaitable
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import hmac
from typing import Any
from typing import Final
from typing import TypeVar

from fastapi import HTTPException
from fastapi import Request
from fastapi import WebSocket
from fastapi import WebSocketException
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.accounts import ENDED
from rt_robot_os.monitor.security.origins import is_expected_host
from rt_robot_os.monitor.security.origins import is_same_origin
from rt_robot_os.monitor.security.origins import is_secure
from rt_robot_os.monitor.security.protection import ENDED_CALLBACKS
from rt_robot_os.monitor.security.robots import RobotAccount
from rt_robot_os.monitor.security.roles import Permission
from rt_robot_os.monitor.security.roles import PERMISSIONS
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.sessions import Session
from rt_robot_os.monitor.security.tokens import csrf_token
from rt_robot_os.monitor.security.tokens import kept
from rt_robot_os.monitor.security.users import shown_people
from starlette.requests import HTTPConnection

__all__ = ('Actor', 'Permission', 'RobotAccount', 'allowed', 'robot_of', 'websocket_actor')

SAFE: Final = frozenset({'GET', 'HEAD', 'OPTIONS'})
_FORBIDDEN: Final = 4403
_TRY_LATER: Final = 1013
_TOO_MANY: Final = 4429
_T = TypeVar('_T')
_BEARER: Final = 'bearer '


@dataclass(frozen=True)
class Actor:
    """
    The user who sends a request.

    :ivar people: people they may see; None means everybody.
    :ivar session: the id of their session, which is not secret.
    :ivar emergency: people they may see only because of an emergency.
    :ivar locked: permissions of the role that a locked session lacks until the password is typed.
    """

    id: str  # noqa: A003
    name: str
    role: Role
    permissions: frozenset[Permission]
    people: frozenset[str] | None
    session: str
    address: str
    emergency: frozenset[str] = frozenset()
    locked: frozenset[Permission] = frozenset()

    def may(self, permission: Permission) -> bool:
        """Return whether the actor has a permission."""
        return permission in self.permissions

    def may_see(self, person: str) -> bool:
        """Return whether the actor may see and be notified of a person."""
        return self.people is None or person in self.people


def refusal(status: int, text: str, remedy: str, reason: str = '',
            wait_s: float = 0.0) -> HTTPException:
    """
    Make the response to a refused request.

    :param reason: for the page, such as ``login`` or ``locked``.
    :param wait_s: when to try again.
    """
    detail = {'text': text, 'remedy': remedy}
    if reason:
        detail['reason'] = reason
    headers = {'Retry-After': str(int(wait_s) + 1)} if wait_s else None
    return HTTPException(status, detail, headers)


def lacking(actor: Actor, *permissions: Permission, what: str = '') -> HTTPException:
    """
    Make the response to an action that needs one of some permissions, when the actor has none.

    :param what: the action, in one word; omitted when empty.
    :return: 401 with the reason ``locked`` if the password restores such a permission, else 403.
    """
    if not actor.locked.isdisjoint(permissions):
        return refusal(401, 'this session is locked: it was not used for a while',
                       'type your password again', 'locked')
    needed = ' or '.join(each.value for each in permissions)
    text = (f'{what} needs the permission {needed}' if what else
            f'your role, {actor.role.value}, does not have the permission {needed}')
    return refusal(403, text, 'ask an admin')


def accounts_of(connection: HTTPConnection) -> Accounts:
    """Return the accounts of the server that received a request."""
    found: Accounts = connection.app.state.services.accounts
    return found


def cookie_name(connection: HTTPConnection, name: str = 'session') -> str:
    """
    Return the name of a cookie.

    With TLS the prefix makes the browser ensure that neither another host nor a page without TLS
    has set it. On loopback without TLS the browser would reject this name.
    """
    return f'__Host-{name}' if is_secure(connection.scope['scheme']) else name


def device_cookie_name(connection: HTTPConnection) -> str:
    """Return the name of the cookie of :mod:`~rt_robot_os.monitor.security.devices`."""
    return cookie_name(connection, 'device')


def device_cookie_of(connection: HTTPConnection) -> str:
    """Return the device cookie; empty without one."""
    return connection.cookies.get(device_cookie_name(connection), '')


def secret_of(connection: HTTPConnection) -> str:
    """Return the secret in the cookie; empty without one."""
    return connection.cookies.get(cookie_name(connection), '')


def address_of(connection: HTTPConnection) -> str:
    """Return the address that a request came from."""
    return connection.client.host if connection.client is not None else ''


def check_origin(connection: HTTPConnection) -> None:
    """
    Refuse a request that another site made the browser send.

    :raises HTTPException: the request comes from another site.
    """
    headers, scheme = connection.headers, connection.scope['scheme']
    if not is_expected_host(scheme, headers):
        raise refusal(421, 'this server has no such name',
                      'open it by the address that it printed when it started')
    if not is_same_origin(scheme, headers):
        raise refusal(403, 'this came from the page of another site',
                      'open the page of this server itself')


def allowed(permission: Permission | None) -> Callable[..., Awaitable[Actor]]:
    """
    Make the dependency that returns the actor of a request.

    It checks the session and the permission; for methods that change something also the CSRF token
    and the origin.

    :param permission: None allows every logged-in user.
    """
    # On the event loop: a stop must not wait for threads that are blocked by the database.
    async def dependency(request: Request) -> Actor:
        if not is_expected_host(request.scope['scheme'], request.headers):
            check_origin(request)
        accounts = accounts_of(request)
        secret = secret_of(request)
        session = await accounts.session_of(secret) if secret else None
        if session is None:
            raise refusal(401, 'you are not logged in', 'log in', 'login')
        if request.method not in SAFE:
            check_origin(request)
            if not hmac.compare_digest(request.headers.get('x-csrf-token', '').encode(),
                                       csrf_token(secret).encode()):
                raise refusal(403, 'the header X-CSRF-Token is missing or wrong',
                              'load the page again', 'csrf')
        actor = actor_of(session, request)
        if permission is not None and not actor.may(permission):
            raise lacking(actor, permission)
        if 'x-background' not in request.headers:
            accounts.sessions.touch(session)
        return actor
    dependency.permission = permission  # type: ignore[attr-defined]
    return dependency


async def websocket_actor(websocket: WebSocket, permission: Permission) -> Actor:
    """
    Return the actor who opens a WebSocket; to be called before it is accepted.

    :raises WebSocketException: the request comes from another site, or has no session or no
        permission. The browser sees 403; the page gets the cause by ``GET /api/session``.
    """
    try:
        check_origin(websocket)
    except HTTPException as error:
        raise WebSocketException(_FORBIDDEN, error.detail['text']  # type: ignore[index]
                                 ) from None
    accounts = accounts_of(websocket)
    secret = secret_of(websocket)
    session = await _known(accounts.session_of(secret)) if secret else None
    if session is None:
        raise WebSocketException(ENDED, 'you are not logged in')
    actor = actor_of(session, websocket)
    if not actor.may(permission):
        reason: Any = lacking(actor, permission).detail
        raise WebSocketException(_FORBIDDEN, reason['text'])
    if not accounts.follow(session):
        raise WebSocketException(_TOO_MANY, 'this browser or this user has too many connections '
                                 'open: close other tabs')
    # Called when the connection ends, wherever it is served: see Protection.
    websocket.scope.setdefault(ENDED_CALLBACKS, []).append(partial(accounts.unfollow, session))
    accounts.audit.open(actor, websocket.scope['path'], people=shown_people(actor.people))
    return actor


async def _known(answer: Awaitable[_T]) -> _T:
    """
    Wait for the result of authentication.

    :raises WebSocketException: the database is unavailable, and memory has no answer.
    """
    try:
        return await answer
    except StoreError as error:
        raise WebSocketException(_TRY_LATER, f'the database cannot be used now: {error}'[:120]
                                 ) from error


async def robot_of(websocket: WebSocket) -> RobotAccount:
    """
    Return the robot that opens a WebSocket, by its token; to be called before it is accepted.

    :raises WebSocketException: the token is missing, wrong or revoked.
    """
    header = websocket.headers.get('authorization', '')
    token = header[len(_BEARER):].strip() if header[:len(_BEARER)].lower() == _BEARER else ''
    accounts = accounts_of(websocket)
    robot = await _known(accounts.robot_of(token)) if token else None
    if robot is None:
        raise WebSocketException(ENDED, 'no robot has this token: monitor robot add NAME makes '
                                 'one')
    accounts.follow_robot(robot.id, kept(token))
    return robot


def actor_of(session: Session, connection: HTTPConnection) -> Actor:
    """Return the actor of a session."""
    locked = PERMISSIONS[session.role] - session.permissions if session.is_locked else frozenset()
    return Actor(session.user, session.name, session.role, session.permissions, session.people,
                 session.id, address_of(connection), session.emergency, locked)


def described(session: Session, secret: str) -> dict[str, Any]:
    """Return the data about its session that the page receives."""
    people = shown_people(session.people)
    return {'id': session.id, 'user': session.name, 'role': session.role.value,
            'permissions': sorted(each.value for each in session.permissions),
            'role_permissions': sorted(each.value for each in PERMISSIONS[session.role]),
            'people': people, 'csrf': csrf_token(secret), 'locked': session.is_locked,
            'emergency': sorted(session.emergency),
            'emergency_ends_ns': session.emergency_ends_ns, 'expires_ns': session.expires_ns}

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

"""Why there is no connection to the server, with the remedy."""

from __future__ import annotations

import socket
import ssl
from typing import Final

from rt_robot_os.base.errors import StartError
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.gateway.settings import GatewaySettings
from websockets.exceptions import ConnectionClosed
from websockets.exceptions import InvalidHandshake
from websockets.exceptions import InvalidStatus

#: Codes of X509_V_ERR_* (x509_vfy.h of OpenSSL).
_NOT_YET_VALID: Final = 9
_EXPIRED: Final = 10
_NAMES: Final = (62, 64)
#: Close codes of a server that refuses a connection: 4000 + an HTTP status.
_UNAUTHORIZED: Final = 401
_FORBIDDEN: Final = 403
_NOT_FOUND: Final = 404
_VERSION: Final = 426
_OWN_CODES: Final = 4000
_TEXT: Final = 200


def is_refusal(error: BaseException | None) -> bool:
    """Return whether the server or this side refuses, so that an immediate retry is useless."""
    return isinstance(error, StartError | ssl.SSLCertVerificationError) or _status(error) in (
        _UNAUTHORIZED, _FORBIDDEN, _NOT_FOUND, _VERSION)


def reason_of(error: BaseException | None, settings: GatewaySettings) -> str:
    """Return why there is no connection; never with the token."""
    if isinstance(error, StartError):
        return str(error)
    if isinstance(error, ssl.SSLCertVerificationError):
        return _certificate(error, settings)
    if isinstance(error, ssl.SSLError):
        return (f'no TLS there ({safe_line(str(error.reason))}): does the server listen without '
                'it? Then write ws:// (to this machine only)')
    status = _status(error)
    if status in (_UNAUTHORIZED, _FORBIDDEN):
        return (f'the server does not accept the token in {settings.token_file}: make one there '
                'with `monitor robot add NAME` and put it into that file')
    if status == _NOT_FOUND:
        return 'there is no monitor at this address: check server under /**/gateway'
    if status == _VERSION:
        return 'the server speaks another version: bring both to the same release'
    if isinstance(error, ConnectionClosed):
        return _closed(error)
    if isinstance(error, socket.gaierror):
        return f'the name of the server is not known ({error.strerror}): check server and the DNS'
    if isinstance(error, TimeoutError):
        return 'no answer: check that the server runs and the network works'
    if isinstance(error, ConnectionResetError):
        return str(error) if error.errno is None else 'the connection was reset'
    if isinstance(error, OSError):
        return f'{error.strerror or safe_line(str(error))[:_TEXT]}'
    if isinstance(error, InvalidHandshake):
        return f'what answers is not a monitor: {safe_line(str(error))[:_TEXT]}'
    return f'{type(error).__name__}: {safe_line(str(error))[:_TEXT]}'


def _status(error: BaseException | None) -> int:
    """Return the HTTP status of the server's refusal; 0 without one."""
    if isinstance(error, InvalidStatus):
        return error.response.status_code
    if isinstance(error, ConnectionClosed) and error.rcvd is not None:
        return error.rcvd.code - _OWN_CODES if error.rcvd.code >= _OWN_CODES else 0
    return 0


def _certificate(error: ssl.SSLCertVerificationError, settings: GatewaySettings) -> str:
    if error.verify_code in _NAMES:
        return (f"the server's certificate is for another name ({error.verify_message}): write "
                'the name that is in it, or make one for this name: monitor certificate')
    if error.verify_code == _EXPIRED:
        return ("the server's certificate has expired: make a new one there (monitor "
                'certificate); or the clock of this machine is wrong (timedatectl)')
    if error.verify_code == _NOT_YET_VALID:
        return ("the server's certificate is not valid yet: the clock of this machine is wrong "
                '(timedatectl)')
    wanted = f'that in {settings.ca_file}' if settings.ca_file else 'one that this machine knows'
    return (f"the server's certificate is not signed by {wanted} ({error.verify_message}): copy "
            "the server's ca.pem to this machine and name it as ca_file")


def _closed(error: ConnectionClosed) -> str:
    if error.rcvd is None:
        return 'the connection was cut'
    said = safe_line(error.rcvd.reason)[:_TEXT]
    return f'the server has closed the connection ({error.rcvd.code}{said and ": "}{said})'

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

"""
Whether a request comes from the page of this server, and not from one of somebody else.

A browser sends the cookie with whatever another site makes it send; it also says, in headers that
no page can change, which site that was.
"""

from __future__ import annotations

from collections.abc import Mapping
from ipaddress import ip_address
from typing import Final
from urllib.parse import urlsplit

_PORTS: Final = {'http': 80, 'https': 443, 'ws': 80, 'wss': 443}
_SECURE: Final = ('https', 'wss')


def is_loopback(host: str) -> bool:
    """
    Return whether a name or an address is that of this machine itself.

    :param host: as in the header, with or without a port.
    """
    name = _split(host)[0]
    if name == 'localhost' or name.endswith('.localhost'):
        return True
    try:
        return ip_address(name).is_loopback
    except ValueError:
        return False


def is_secure(scheme: str) -> bool:
    """Return whether it is one with TLS."""
    return scheme in _SECURE


def is_expected_host(scheme: str, headers: Mapping[str, str]) -> bool:
    """
    Return whether the request is meant for this server.

    Without TLS it listens on loopback only; a site whose name was made to point there (DNS
    rebinding) says its own name. With TLS the certificate would not fit.
    """
    return is_secure(scheme) or is_loopback(headers.get('host', ''))


def is_same_origin(scheme: str, headers: Mapping[str, str]) -> bool:
    """
    Return whether no other site than this one sent a request.

    :param scheme: of the request.
    :param headers: with names in small letters.
    """
    if headers.get('sec-fetch-site', 'same-origin') not in ('same-origin', 'none'):
        return False
    origin = headers.get('origin')
    if origin is None:
        return True  # no browser, or one that said above that it is the same
    try:
        parts = urlsplit(origin)
        theirs = parts.scheme, (parts.hostname or ''), parts.port or _PORTS.get(parts.scheme)
    except ValueError:
        return False
    ours_scheme = 'https' if is_secure(scheme) else 'http'
    name, port = _split(headers.get('host', ''))
    return bool(name) and theirs == (ours_scheme, name, port or _PORTS[ours_scheme])


def _split(host: str) -> tuple[str, int | None]:
    try:
        parts = urlsplit(f'//{host}')
        return parts.hostname or '', parts.port
    except ValueError:
        return '', None

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
Checks that a request comes from the page of this server and not from another site.

A browser sends the cookie also with requests caused by another site. Headers that no page can
change name that site.
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
    Return whether a name or an address is a loopback one.

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
    """Return whether the scheme uses TLS."""
    return scheme in _SECURE


def is_expected_host(scheme: str, headers: Mapping[str, str]) -> bool:
    """
    Return whether the request is meant for this server.

    Without TLS the server listens on loopback only; a site whose name points there (DNS rebinding)
    sends its own name. With TLS the certificate would not match.
    """
    return is_secure(scheme) or is_loopback(headers.get('host', ''))


def is_same_origin(scheme: str, headers: Mapping[str, str]) -> bool:
    """
    Return whether a request has the same origin.

    :param scheme: of the request.
    :param headers: with names in lower case.
    """
    if headers.get('sec-fetch-site', 'same-origin') not in ('same-origin', 'none'):
        return False
    origin = headers.get('origin')
    if origin is None:
        return True  # not a browser, or one whose headers above state the same origin
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

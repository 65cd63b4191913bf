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

"""The security headers: what the page may do, and what other sites may not do with it."""

from __future__ import annotations

from typing import Final

from rt_robot_os.monitor.security.origins import is_loopback

#: Only content of this server; nothing inline; no frames of other sites.
POLICY: Final = '; '.join((
    "default-src 'none'", "script-src 'self'", "style-src 'self'", "img-src 'self' blob: data:",
    "media-src 'self' blob:", "connect-src 'self'", "font-src 'self'", "manifest-src 'self'",
    "worker-src 'self'", "base-uri 'none'", "form-action 'self'", "frame-ancestors 'none'",
    "object-src 'none'"))
#: Microphone and camera for calls during teleoperation; unused features are disabled.
FEATURES: Final = ', '.join((
    'microphone=(self)', 'camera=(self)', 'gamepad=(self)', 'autoplay=(self)',
    'fullscreen=(self)', 'screen-wake-lock=(self)', 'geolocation=()', 'payment=()', 'usb=()',
    'serial=()', 'hid=()', 'midi=()', 'display-capture=()'))
_YEAR_S: Final = 365 * 86400
_ALWAYS: Final = (
    (b'content-security-policy', POLICY.encode()),
    (b'permissions-policy', FEATURES.encode()),
    (b'x-content-type-options', b'nosniff'),
    (b'x-frame-options', b'DENY'),
    (b'referrer-policy', b'no-referrer'),
    (b'cross-origin-opener-policy', b'same-origin'),
    (b'cross-origin-resource-policy', b'same-origin'))
_NO_STORE: Final = (b'cache-control', b'no-store')


def headers_for(path: str, is_tls: bool, host: str) -> list[tuple[bytes, bytes]]:
    """
    Return the headers of a response.

    :param host: from the request.
    """
    found = list(_ALWAYS)
    if path.startswith('/api/') or path == '/metrics':
        found.append(_NO_STORE)
    # Browsers accept it only for host names; that of this machine is shared with other programs.
    if is_tls and not is_loopback(host):
        found.append((b'strict-transport-security', f'max-age={_YEAR_S}'.encode()))
    return found

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

"""Random secrets of 256 bits, and their hashes."""

from __future__ import annotations

import hashlib
import secrets
from typing import Final

_BYTES: Final = 32
#: Longest string that is looked up.
_LONGEST: Final = 128


def new_secret() -> str:
    """Return a new secret that fits into a cookie, a header and a link."""
    return secrets.token_urlsafe(_BYTES)


def new_id() -> str:
    """Return a new random id of 128 bits; it is not secret."""
    return secrets.token_hex(16)


def kept(secret: str) -> str:
    """
    Return the hash of a secret, which is stored instead of it.

    One round suffices: unlike passwords, 2^256 secrets cannot be guessed.
    """
    return hashlib.sha256(secret[:_LONGEST].encode('utf-8', 'replace')).hexdigest()


def csrf_token(secret: str) -> str:
    """Return the CSRF token of a session, which a page must send with each change."""
    return kept(f'csrf of {secret}')

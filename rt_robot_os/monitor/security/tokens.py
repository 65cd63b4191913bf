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

"""Random secrets of 256 bits, and what is kept of them."""

from __future__ import annotations

import hashlib
import secrets
from typing import Final

_BYTES: Final = 32
#: The longest text that is looked up at all.
_LONGEST: Final = 128


def new_secret() -> str:
    """Return a new secret that fits into a cookie, a header and a link."""
    return secrets.token_urlsafe(_BYTES)


def new_id() -> str:
    """Return a new name of 128 bits for something; it is no secret."""
    return secrets.token_hex(16)


def kept(secret: str) -> str:
    """
    Return what is kept of a secret: its hash.

    One round is enough: nobody can try 2^256 of them, which they could with passwords.
    """
    return hashlib.sha256(secret[:_LONGEST].encode('utf-8', 'replace')).hexdigest()


def csrf_token(secret: str) -> str:
    """Return what a page must send back with each change; only who has the session knows it."""
    return kept(f'csrf of {secret}')

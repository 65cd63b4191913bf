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
Device cookies: a browser proves that it was used before to log in to an account.

Wrong passwords from elsewhere then do not delay this browser, even after a restart of the server.
The server stores nothing: the cookie carries a random number and, for each account, a tag that
only the server can make (OWASP, "Slow Down Online Guessing Attacks with Device Cookies"). The
cookie grants no access: a thief only gets a separate delay for those accounts.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import secrets
from typing import Final

#: Longest lifetime of a cookie in browsers.
AGE_S: Final = 400 * 24 * 3600
#: Most accounts of one browser, such as the tablet of a ward; the oldest login is dropped.
ACCOUNTS_MOST: Final = 16
_NUMBER_BYTES: Final = 12
_NUMBER_CHARACTERS: Final = 16
_TAG_CHARACTERS: Final = 22
_LONGEST: Final = _NUMBER_CHARACTERS + ACCOUNTS_MOST * (1 + _TAG_CHARACTERS)


class Devices:
    """Makes and checks device cookies; thread-safe."""

    def __init__(self, key: bytes) -> None:
        """
        Make it.

        :param key: of the server; the signing key is derived from it.
        """
        self._key = hmac.digest(key, b'device cookies', 'sha256')

    def number(self, cookie: str, account: str) -> str:
        """
        Return the number of the device, if its cookie is for this account.

        :param account: the normalised name.
        :return: empty when the cookie is missing, wrong, or for other accounts.
        """
        number, tags = _parts(cookie)
        tag = self._tag(number, account)
        is_known = any([hmac.compare_digest(each.encode(), tag.encode()) for each in tags])
        return number if number and is_known else ''

    def add(self, cookie: str, account: str) -> str:
        """
        Return the cookie of a device after a login to an account.

        :param cookie: the previous cookie; when it is empty or wrong the device gets a new number.
        """
        number, tags = _parts(cookie)
        number = number or secrets.token_urlsafe(_NUMBER_BYTES)
        tag = self._tag(number, account)
        others = [each for each in tags if each != tag]
        return '.'.join((number, *others[-(ACCOUNTS_MOST - 1):], tag))

    def _tag(self, number: str, account: str) -> str:
        made = hmac.new(self._key, f'{number} {account}'.encode('utf-8', 'replace'),
                        hashlib.sha256).digest()
        return base64.urlsafe_b64encode(made)[:_TAG_CHARACTERS].decode()


def _parts(cookie: str) -> tuple[str, list[str]]:
    if not cookie.isascii() or len(cookie) > _LONGEST:
        return '', []
    number, *tags = cookie.split('.')
    if len(number) != _NUMBER_CHARACTERS or not set(map(len, tags)) <= {_TAG_CHARACTERS}:
        return '', []
    return number, tags

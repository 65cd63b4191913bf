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

"""Passwords: rules, hashing and comparison."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from typing import Final
import unicodedata

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError
from argon2.exceptions import VerificationError
from rt_robot_os.monitor.security.common_passwords import COMMON

SHORTEST: Final = 12
LONGEST: Final = 128
#: Passwords compared concurrently, at 64 MiB each, and the most that wait for it.
PARALLEL: Final = 2
WAITING: Final = 16


class BusyError(Exception):
    """Too many passwords wait to be compared: try again in a moment."""


def check_rules(password: str, name: str) -> None:
    """
    Check a new password by NIST SP 800-63B: its length, and that it is not a common one.

    :param name: of the account.
    :raises ValueError: it is too weak; the message gives the reason.
    """
    text = _normal(password)
    if len(text) < SHORTEST:
        raise ValueError(f'a password has at least {SHORTEST} characters; this one has '
                         f'{len(text)}. A few words that have nothing to do with each other are '
                         'easy to remember')
    if len(text) > LONGEST:
        raise ValueError(f'a password has at most {LONGEST} characters')
    folded = text.casefold()
    if folded in COMMON or len(set(folded)) < 4 or _stem(folded) in COMMON:
        raise ValueError('this password is one of the first that are tried: take another')
    if name and folded.replace(name.casefold(), '', 1).strip('0123456789!.-_ ') == '':
        raise ValueError('a password that is the name of the account is the first that is tried')


def _stem(folded: str) -> str:
    """Return it without the suffix that people append to a common word."""
    return folded.rstrip('0123456789!.?-_#*$')


def _normal(password: str) -> str:
    """Return it in a normal form that is the same for each keyboard."""
    return unicodedata.normalize('NFKC', password)


class Passwords:
    """
    Argon2id hashes of passwords.

    Each takes 64 MiB for a tenth of a second, by the second recommended option of RFC 9106. A few
    dedicated threads compare them: many logins neither fill the memory nor block the event loop or
    the threads of other endpoints.
    """

    def __init__(self, hasher: PasswordHasher | None = None) -> None:
        """
        Make it.

        :param hasher: one with other parameters; tests use a faster one.
        """
        self._hasher = hasher or PasswordHasher(time_cost=3, memory_cost=64 << 10, parallelism=4)
        self._workers = ThreadPoolExecutor(PARALLEL, 'passwords')
        self._pending = 0
        #: Hash to compare with when the user does not exist.
        self._nobody = self._hasher.hash('nobody')

    def hash(self, password: str) -> str:  # noqa: A003
        """Return the hash of a password; slow."""
        return self._hasher.hash(_normal(password))

    async def hash_soon(self, password: str) -> str:
        """
        Return the hash of a password without blocking the event loop.

        :raises BusyError: too many wait.
        """
        found = await self._run(self.hash, password)
        assert isinstance(found, str)
        return found

    def matches(self, stored: str, password: str) -> bool:
        """
        Compare a password; takes equally long when there is no such user.

        :param stored: the hash; an empty string matches nothing.
        """
        try:
            found = self._hasher.verify(stored or self._nobody, _normal(password))
        except (VerificationError, InvalidHashError):
            return False
        return found and bool(stored)

    async def matches_soon(self, stored: str, password: str) -> bool:
        """
        Compare without blocking the event loop.

        :raises BusyError: too many wait.
        """
        return bool(await self._run(self.matches, stored, password))

    def is_old(self, stored: str) -> bool:
        """Return whether a hash was made with other parameters than the current ones."""
        return self._hasher.check_needs_rehash(stored)

    def close(self) -> None:
        """End the threads."""
        self._workers.shutdown(cancel_futures=True)

    async def _run(self, work: object, *arguments: str) -> object:
        assert callable(work)
        if self._pending >= PARALLEL + WAITING:
            raise BusyError
        self._pending += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._workers, work,
                                                                    *arguments)
        finally:
            self._pending -= 1

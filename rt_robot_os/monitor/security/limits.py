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
Limits: lock-out by delay after wrong passwords, and how many requests an address may send.

In memory and bounded: what is forgotten first is what happened longest ago. What wrong passwords
there were before a start, and from where accounts were opened, comes from the audit
(:mod:`rt_robot_os.monitor.security.login_history`).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import ip_address
from ipaddress import IPv6Address
import threading
import time
from typing import Final

SECOND_NS: Final = 1_000_000_000
#: A mistyped password costs nothing; from then on the delay doubles.
FREE: Final = 2
#: Of an account this many from addresses that are new to it: two addresses' worth, and one more.
ACCOUNT_FREE: Final = 2 * FREE + 1
LONGEST_DELAY_S: Final = 60
#: After that long without a wrong password, all is forgotten.
FORGOTTEN_S: Final = 900
_KEYS: Final = 10_000
_ACCOUNT: Final = 'account'
_ADDRESS: Final = 'address'
#: What one address adds to the count of one account.
_SHARE: Final = 'share'


def network_of(address: str) -> str:
    """Return what of an address one subscriber has: all of IPv4, the first 64 bits of IPv6."""
    try:
        found = ip_address(address.partition('%')[0])
    except ValueError:
        return address[:64]
    if isinstance(found, IPv6Address):
        if found.ipv4_mapped is not None:
            return str(found.ipv4_mapped)
        return f'{IPv6Address(int(found) >> 64 << 64)}/64'
    return str(found)


@dataclass
class _Failures:
    count: int = 0
    last_ns: int = 0


class LockOut:
    """
    After wrong passwords a delay of 1, 2, 4 … 60 s, by device and by address.

    It is never for ever: an alarm must stay within reach. And wrong passwords from elsewhere delay
    no one. Whose delay counts, the first that applies:

    1. a device from which the account was opened before (:mod:`devices`): its own;
    2. an address from which the account was opened before: its own;
    3. all others: that of their address, and that of the account, which guessing from many
       addresses at a time lengthens: of one address only its first :data:`FREE` attempts count
       there, and those of up to two addresses delay no other.

    Names that do not exist are delayed alike.
    """

    def __init__(self, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        """
        Make it.

        :param now_ns: the clock.
        """
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self._failures: OrderedDict[tuple[str, ...], _Failures] = OrderedDict()
        self._known: OrderedDict[tuple[str, str], None] = OrderedDict()

    def begin(self, account: str, address: str, device: str = '') -> float:
        """
        Ask whether a password may be tried; if so it counts as wrong until :meth:`succeed`.

        Counted before it is compared, so that a hundred at once are not one attempt.

        :param account: as its name is compared.
        :param device: its number, where the server knows the device; else empty.
        :return: 0, or how long to wait in seconds.
        """
        now = self._now_ns()
        with self._lock:
            keys = self._keys(account, address, device)
            wait = max(self._wait_ns(key, now) for key in keys)
            if wait > 0:
                return wait / SECOND_NS
            self._count(keys, now)
            return 0.0

    def succeed(self, account: str, address: str, device: str = '') -> None:
        """
        Forget the wrong passwords of the account: the right one came.

        Of the address only that this one was no wrong one: who has an account must not try those
        of others without a wait by logging in to their own between.
        """
        with self._lock:
            for key in self._keys(account, address, device):
                entry = self._failures.get(key)
                if entry is not None and key[0] == _ADDRESS and entry.count > 1:
                    entry.count -= 1
                else:
                    self._failures.pop(key, None)
            self._known.pop((account, network_of(address)), None)
            self._known[account, network_of(address)] = None
            while len(self._known) > _KEYS:
                self._known.popitem(last=False)

    def withdraw(self, account: str, address: str, device: str = '') -> None:
        """Count an attempt no longer as wrong: its password could not be compared."""
        with self._lock:
            for key in self._keys(account, address, device):
                entry = self._failures.get(key)
                if entry is not None:
                    entry.count -= 1

    def restore(self, account: str, address: str, device: str, age_ns: int,
                is_right: bool) -> None:
        """
        Take an attempt of before the start of this process; call it for the oldest first.

        :param age_ns: how long ago it was.
        """
        if is_right:
            self.succeed(account, address, device)
        elif 0 <= age_ns < FORGOTTEN_S * SECOND_NS:
            with self._lock:
                self._count(self._keys(account, address, device), self._now_ns() - age_ns)

    def _count(self, keys: tuple[tuple[str, ...], ...], at_ns: int) -> None:
        """Count an attempt; what of an address counts for the account is bounded."""
        counted = keys
        for key in keys:
            if key[0] == _SHARE and self._entry(key, at_ns).count >= FREE:
                counted = tuple(each for each in keys if each[0] != _ACCOUNT)
        for key in counted:
            entry = self._failures[key] = self._entry(key, at_ns)
            entry.count += 1
            entry.last_ns = at_ns
            self._failures.move_to_end(key)
        while len(self._failures) > _KEYS:
            self._failures.popitem(last=False)

    def _entry(self, key: tuple[str, ...], now: int) -> _Failures:
        entry = self._failures.get(key)
        if entry is None or now - entry.last_ns > FORGOTTEN_S * SECOND_NS:
            return _Failures()
        return entry

    def _keys(self, account: str, address: str, device: str) -> tuple[tuple[str, ...], ...]:
        network = network_of(address)
        if device:
            return ('device', account, device),
        if (account, network) in self._known:
            return ('known', account, network),
        return (_ACCOUNT, account), (_ADDRESS, network), (_SHARE, account, network)

    def _wait_ns(self, key: tuple[str, ...], now: int) -> int:
        entry = self._failures.get(key)
        free = ACCOUNT_FREE if key[0] == _ACCOUNT else FREE
        if entry is None or entry.count < free or key[0] == _SHARE:
            return 0
        delay = min(1 << min(entry.count - free, 16), LONGEST_DELAY_S) * SECOND_NS
        return entry.last_ns + delay - now


class Rate:
    """A token bucket for each key: bounded, and the oldest is forgotten."""

    def __init__(self, per_s: float, burst: int,
                 now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        """
        Make it.

        :param burst: how many may come at once.
        """
        self._per_ns = per_s / SECOND_NS
        self._burst = float(burst)
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self._buckets: OrderedDict[str, tuple[float, int]] = OrderedDict()
        #: How many were refused.
        self.refused = 0

    def take(self, key: str) -> float:
        """
        Take one.

        :return: 0, or after how many seconds there is one.
        """
        now = self._now_ns()
        with self._lock:
            level, then = self._buckets.pop(key, (self._burst, now))
            level = min(self._burst, level + (now - then) * self._per_ns)
            wait = 0.0
            if level >= 1.0:
                level -= 1.0
            else:
                wait = (1.0 - level) / self._per_ns / SECOND_NS
                self.refused += 1
            self._buckets[key] = level, now
            while len(self._buckets) > _KEYS:
                self._buckets.popitem(last=False)
            return wait

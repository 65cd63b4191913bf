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
Limits: delays after wrong passwords, and the request rate of an address.

They are in memory and bounded: the oldest entry is evicted first. Wrong passwords before a
restart, and the addresses of earlier logins, come from the audit
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
#: Attempts without a delay; after them the delay doubles.
FREE: Final = 2
#: Free attempts on an account from new addresses: those of two addresses, and one more.
ACCOUNT_FREE: Final = 2 * FREE + 1
LONGEST_DELAY_S: Final = 60
#: Wrong passwords are forgotten after this time without another one.
FORGOTTEN_S: Final = 900
_KEYS: Final = 10_000
_ACCOUNT: Final = 'account'
_ADDRESS: Final = 'address'
#: Attempts that one address adds to the count of one account.
_SHARE: Final = 'share'


def network_of(address: str) -> str:
    """Return the part of an address that identifies a subscriber: IPv4, or 64 bits of IPv6."""
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
    Delays of 1, 2, 4 … 60 s after wrong passwords, by device and by address.

    No lock-out is permanent: alarms must stay accessible. Wrong passwords from elsewhere do not
    delay known devices. The first delay that applies counts:

    1. a device with an earlier login to the account (:mod:`devices`): its own;
    2. an address with an earlier login to the account: its own;
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
        Check whether a password may be tried; it then counts as wrong until :meth:`succeed`.

        It is counted before it is compared, so that concurrent attempts all count.

        :param account: its normalised name.
        :param device: its number if the server knows the device; else empty.
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
        Clear the wrong passwords of the account after the right one.

        For the address only this attempt is removed: logging in to one's own account in between
        must not allow attempts on other accounts without delays.
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
        """Remove an attempt whose password could not be compared."""
        with self._lock:
            for key in self._keys(account, address, device):
                entry = self._failures.get(key)
                if entry is not None:
                    entry.count -= 1

    def restore(self, account: str, address: str, device: str, age_ns: int,
                is_right: bool) -> None:
        """
        Add an attempt from before the start of this process; the oldest must come first.

        :param age_ns: its age.
        """
        if is_right:
            self.succeed(account, address, device)
        elif 0 <= age_ns < FORGOTTEN_S * SECOND_NS:
            with self._lock:
                self._count(self._keys(account, address, device), self._now_ns() - age_ns)

    def _count(self, keys: tuple[tuple[str, ...], ...], at_ns: int) -> None:
        """Count an attempt; the share of one address in the account's count is bounded."""
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
    """A token bucket for each key; bounded, the oldest is evicted."""

    def __init__(self, per_s: float, burst: int,
                 now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        """
        Make it.

        :param burst: capacity of a bucket.
        """
        self._per_ns = per_s / SECOND_NS
        self._burst = float(burst)
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self._buckets: OrderedDict[str, tuple[float, int]] = OrderedDict()
        #: Refused requests.
        self.refused = 0

    def take(self, key: str) -> float:
        """
        Take one.

        :return: 0, or the seconds until a token is available.
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

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

"""The right to drive a robot: one client at a time; taking over must be explicit."""

from __future__ import annotations

import secrets
from typing import Generic
from typing import TypeVar

WhoT = TypeVar('WhoT')


class HeldByAnotherError(Exception):
    """Another page drives; the request must say that it takes over."""


class Lease(Generic[WhoT]):
    """
    The right to drive a robot.

    :ivar holder: the client that has it; None when it is free.
    :ivar key: key of this period, different for each, so that commands of an earlier one are
        ignored. Empty when it is free.
    """

    def __init__(self) -> None:
        self.holder: WhoT | None = None
        self.key = ''

    def take(self, who: WhoT, over: bool) -> WhoT | None:
        """
        Acquire it; the holder keeps the same period.

        :param over: take it from another client, too.
        :return: the previous holder; None when it was free or held by this client.
        :raises HeldByAnotherError: another client holds it, and ``over`` is false.
        """
        former = self.holder
        if former == who:
            return None
        if former is not None and not over:
            raise HeldByAnotherError
        self.holder, self.key = who, secrets.token_hex(8)
        return former

    def give(self, who: WhoT) -> str:
        """
        Release it.

        :return: the key of the ended period; empty when this client did not hold it.
        """
        if self.holder != who:
            return ''
        key, self.key, self.holder = self.key, '', None
        return key

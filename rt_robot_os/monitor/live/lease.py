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

"""Who may drive a robot: one at a time, and who takes it over does so knowingly."""

from __future__ import annotations

import secrets
from typing import Generic
from typing import TypeVar

WhoT = TypeVar('WhoT')


class HeldByAnotherError(Exception):
    """Somebody else has it; it takes a word more to take it over."""


class Lease(Generic[WhoT]):
    """
    The right to drive a robot.

    :ivar holder: who has it; None when it is free.
    :ivar key: of this time; another with each taking, so that what was said under an earlier one
        counts no more. Empty when it is free.
    """

    def __init__(self) -> None:
        self.holder: WhoT | None = None
        self.key = ''

    def take(self, who: WhoT, over: bool) -> WhoT | None:
        """
        Have it from now on; who has it already keeps it as it is.

        :param over: also from somebody else.
        :return: from whom it was taken; None when it was free, or theirs.
        :raises HeldByAnotherError: somebody else has it, and ``over`` is not said.
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
        Give it back.

        :return: the key that ends; empty when it was not theirs.
        """
        if self.holder != who:
            return ''
        key, self.key, self.holder = self.key, '', None
        return key

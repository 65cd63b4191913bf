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

"""The result of a check: a state, what was found, why it matters, and the remedy."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rt_robot_os.tools.doctor.system import System


class State(Enum):
    """How a finding stands."""

    OK = 'ok'
    WARN = 'warn'
    BAD = 'bad'
    UNKNOWN = 'unknown'
    ABSENT = 'absent'


@dataclass(frozen=True)
class Remedy:
    """
    What mends it.

    :ivar commands: lines to paste into a shell, in this order.
    :ivar note: what else has to be known, such as that a reboot has to follow.
    """

    commands: tuple[str, ...] = ()
    note: str = ''


@dataclass(frozen=True)
class Finding:
    """
    One line of the doctor.

    :ivar found: what is there, with its value; for UNKNOWN the reason.
    :ivar remedy: None when there is nothing to fix.
    :ivar subject: of which there may be several, such as ``/dev/ttyUSB0``.
    :ivar weight: 0..100, how much mending it is worth; the summary begins with the greatest.
    :ivar why: replaces that of the check.
    """

    state: State
    found: str
    remedy: Remedy | None = None
    subject: str = ''
    weight: int = 0
    why: str = ''


@dataclass(frozen=True)
class Check:
    """
    One question.

    :ivar key: stable, ``group.name``; what JSON and the documentation call it.
    :ivar title: at most 20 characters.
    :ivar why: one short sentence.
    :ivar ask: examines a system and gives its findings.
    """

    key: str
    title: str
    why: str
    ask: Callable[[System], Iterable[Finding]]


@dataclass(frozen=True)
class Line:
    """A finding and the check that made it."""

    group: str
    check: Check
    finding: Finding

    @property
    def why(self) -> str:
        """Why it matters."""
        return self.finding.why or self.check.why


def ok(found: str, remedy: Remedy | None = None, *, subject: str = '') -> Finding:
    """Say that all is well; a remedy here is what would be better still."""
    return Finding(State.OK, found, remedy, subject)


def warn(found: str, remedy: Remedy | None = None, *, weight: int, subject: str = '',
         why: str = '') -> Finding:
    """Say that it works, but worse than it could."""
    return Finding(State.WARN, found, remedy, subject, weight, why)


def bad(found: str, remedy: Remedy | None = None, *, weight: int, subject: str = '',
        why: str = '') -> Finding:
    """Say that a robot cannot be run like this."""
    return Finding(State.BAD, found, remedy, subject, weight, why)


def unknown(reason: str, remedy: Remedy | None = None, *, subject: str = '') -> Finding:
    """Say that it could not be found out, and why."""
    return Finding(State.UNKNOWN, reason, remedy, subject)


def absent(found: str) -> Finding:
    """Report that the check does not apply here; left out unless everything is requested."""
    return Finding(State.ABSENT, found)

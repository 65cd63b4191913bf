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


"""Handshakes: commands that a device must acknowledge, one after the other; never blocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.units import NS_PER_MS


class HandshakeStep(NamedTuple):
    """
    One command.

    :ivar name: for errors.
    :ivar data: the bytes to send.
    :ivar key: identifies the acknowledgement for the driver.
    :ivar pause_ns: time that the device needs after the acknowledgement.
    """

    name: str
    data: bytes
    key: int = 0
    pause_ns: int = 0


class Handshake:
    """
    A sequence of commands; safe in the real-time loop.

    Each is repeated a few times until it is acknowledged. The driver calls :meth:`due` in its
    ``write`` to send, and :meth:`acknowledged` in its ``handle``.
    """

    def __init__(self, name: str, steps: Sequence[HandshakeStep], remedy: str, *,
                 retry_ns: int = 200 * NS_PER_MS, tries: int = 5) -> None:
        """
        Start with the first command, which is due immediately.

        :param name: of the device, for errors.
        :param remedy: what to do if the device does not answer.
        :param retry_ns: time-out of an answer.
        """
        self._name = name
        self._steps = list(steps)
        self._remedy = remedy
        self._retry_ns = retry_ns
        self._limit = tries
        self._tries = 0
        self._due_ns = 0
        self._answer = ''

    @property
    def step(self) -> HandshakeStep | None:
        """Return the current command; None when all are acknowledged."""
        return self._steps[0] if self._steps else None

    @property
    def done(self) -> bool:
        """Return whether all commands are acknowledged."""
        return not self._steps

    def ready(self, now_ns: int) -> bool:
        """Return whether all commands are acknowledged, and the last pause has passed."""
        return not self._steps and now_ns >= self._due_ns

    def due(self, now_ns: int) -> bytes | None:
        """
        Return the bytes to send now; None if there are none.

        :raises DeviceError: the device has answered none of the tries.
        """
        if not self._steps or now_ns < self._due_ns:
            return None
        step = self._steps[0]
        if self._tries >= self._limit:
            how = f'does not do {step.name} ({self._answer}; ' if self._answer else (
                f'does not answer {step.name} (')
            raise DeviceError(f'{self._name}: it {how}{self._tries} tries): {self._remedy}')
        self._tries += 1
        self._due_ns = now_ns + self._retry_ns
        return step.data

    def again(self, now_ns: int, answer: str) -> None:
        """
        Repeat the command with the next ``due``.

        :param answer: the refusal of the device, for the error if it never succeeds.
        """
        self._answer = answer
        self._due_ns = now_ns

    def acknowledged(self, now_ns: int) -> None:
        """Go on to the next command."""
        step = self._steps.pop(0)
        self._tries = 0
        self._answer = ''
        self._due_ns = now_ns + step.pause_ns

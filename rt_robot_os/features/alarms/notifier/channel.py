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

"""The interface of a channel, and what all channels use."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
from contextlib import suppress
import ipaddress
import socket
import threading
from typing import Any
from typing import Final
from typing import Protocol

from rt_robot_os.base.schema import Field
from rt_robot_os.messages.notification import Notification

#: A setting that begins with it names a variable of the environment.
VARIABLE: Final = '$'
#: The time-out of a single read or write exceeds the deadline of the whole by it.
GRACE_S: Final = 0.5


class DeliveryError(Exception):
    """A notification was not delivered, or the outcome is unknown; the text says why."""


class Channel(Protocol):
    """
    Delivers notifications; used by one thread.

    :cvar SETTINGS: the keys of its section, in addition to the common ones.
    """

    SETTINGS: tuple[Field, ...]

    def deliver(self, notification: Notification, again: bool) -> str:
        """
        Deliver it, within the time-out of the channel.

        :param again: it may have been delivered before; a channel that can checks.
        :return: a short text about the delivery.
        :raises DeliveryError: it is not delivered, as far as the channel knows.
        """


def environment_value(text: str, environ: Mapping[str, str]) -> str:
    """
    Return a value; ``$NAME`` is that of the environment variable ``NAME``.

    :raises ValueError: there is no such variable, or it is empty.
    """
    if not text.startswith(VARIABLE):
        return text
    value = environ.get(text[1:], '').strip()
    if not value:
        raise ValueError(f'the environment has no variable {text[1:]}: set it where the notifier '
                         'is started')
    return value


def is_own_machine(host: str) -> bool:
    """Return whether a host is this machine, so that no network is crossed."""
    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host.strip('[]')).is_loopback
    except ValueError:
        return False


class Deadline:
    """
    Cut a connection at its deadline, even when the other side sends a byte now and then.

    :param timeout_s: for the whole delivery.
    """

    def __init__(self, timeout_s: float) -> None:
        self.over = False
        self._timeout_s = timeout_s
        self._socket: socket.socket | None = None
        self._lock = threading.Lock()

    @contextmanager
    def watch(self) -> Iterator[Deadline]:
        """Start the time."""
        timer = threading.Timer(self._timeout_s, self._end)
        timer.daemon = True
        timer.start()
        try:
            yield self
        finally:
            timer.cancel()
            with self._lock:
                self._socket = None

    def guard(self, connection: Any) -> None:
        """Register the connection, as soon as there is one."""
        with self._lock:
            self._socket = connection
        if self.over:
            self._end()

    def _end(self) -> None:
        self.over = True
        with self._lock:
            if self._socket is not None:
                with suppress(OSError):
                    self._socket.shutdown(socket.SHUT_RDWR)

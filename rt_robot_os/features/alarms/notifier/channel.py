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

"""What a channel is, and what all of them need."""

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

#: A value of a channel's settings that begins so names a variable of the environment.
VARIABLE: Final = '$'
#: A single read or write may take so much longer than the whole: the deadline is to come first.
GRACE_S: Final = 0.5


class DeliveryError(Exception):
    """A notification was not delivered, or nobody knows; the text says why."""


class Channel(Protocol):
    """
    Tells a notification to somebody; used by one thread.

    :cvar SETTINGS: the keys of its section beside the common ones.
    """

    SETTINGS: tuple[Field, ...]

    def deliver(self, notification: Notification, again: bool) -> str:
        """
        Tell it, within the channel's time-out.

        :param again: it may have been told before: a channel that can find out does.
        :return: a word about it.
        :raises DeliveryError: it is not told, as far as the channel knows.
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
    """Return whether a host is this machine: what goes there crosses no network."""
    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host.strip('[]')).is_loopback
    except ValueError:
        return False


class Deadline:
    """
    Cut a connection when its time is over, whatever the other side sends a byte at a time.

    :param timeout_s: for the whole delivery.
    """

    def __init__(self, timeout_s: float) -> None:
        self.over = False
        self._timeout_s = timeout_s
        self._socket: socket.socket | None = None
        self._lock = threading.Lock()

    @contextmanager
    def watch(self) -> Iterator[Deadline]:
        """Let the time begin."""
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
        """Name the connection, as soon as it is there."""
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

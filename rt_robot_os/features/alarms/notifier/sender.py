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

"""Delivery workers: each channel has its own thread and queue, so that none waits for another."""

from __future__ import annotations

from collections.abc import Callable
import queue
import threading
import time
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.notifier.channel import DeliveryError
from rt_robot_os.features.alarms.notifier.settings import ChannelSettings
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification
from rt_robot_os.messages.notification import REPORT_CHARACTERS

_END: Final = None


class ChannelSender:
    """
    Delivers by one channel, one notification after the other.

    :param begin: called by its thread before each delivery, with the notification.
    :param end: called by its thread with the report.
    :param expires_s: a notification that has waited longer is not delivered any more.
    :ivar delivered: so far.
    :ivar failed: so far.
    :ivar problem: why the last delivery failed; empty when it went well.
    :ivar busy_since_ns: when the present delivery began, on CLOCK_MONOTONIC; 0 without.
    """

    def __init__(self, settings: ChannelSettings, begin: Callable[[Notification], None],
                 end: Callable[[DeliveryReport], None], expires_s: float) -> None:
        self.settings = settings
        self.delivered = self.failed = 0
        self.problem = ''
        self.busy_since_ns = 0
        self._begin = begin
        self._end = end
        self._expires_ns = round(expires_s * NS_PER_S)
        self._queue: queue.Queue[tuple[Notification, bool, int] | None] = queue.Queue(
            settings.queue)
        self._thread = threading.Thread(
            target=self._run, name=f'sender {settings.name}', daemon=True)
        self._thread.start()

    def send(self, notification: Notification, again: bool, stamp_ns: int) -> bool:
        """
        Queue a notification; False when too many wait already.

        :param stamp_ns: when it was made, on CLOCK_MONOTONIC.
        """
        try:
            self._queue.put_nowait((notification, again, stamp_ns))
        except queue.Full:
            return False
        return True

    def stop(self, timeout_s: float) -> bool:
        """Start no more deliveries, and wait for the running one; return whether it has ended."""
        while True:
            try:
                self._queue.put_nowait(_END)
                break
            except queue.Full:
                try:
                    self._queue.get_nowait()  # not started: it is sent again after a restart
                except queue.Empty:
                    pass
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        busy_ns = self.busy_since_ns and time.monotonic_ns() - self.busy_since_ns
        return {'type': self.settings.type, 'waiting': self._queue.qsize(),
                'delivered': self.delivered, 'failed': self.failed,
                'busy_s': round(busy_ns / NS_PER_S, 1), 'problem': self.problem}

    def _run(self) -> None:
        while (item := self._queue.get()) is not _END:
            notification, again, stamp_ns = item
            self.busy_since_ns = time.monotonic_ns()
            ok, text = self._deliver(notification, again, self.busy_since_ns - stamp_ns)
            self.busy_since_ns = 0
            self.delivered += ok
            self.failed += not ok
            text = text[:REPORT_CHARACTERS]
            self.problem = '' if ok else text
            self._end(DeliveryReport(notification.key, notification.channel, ok, text))

    def _deliver(self, notification: Notification, again: bool, age_ns: int) -> tuple[bool, str]:
        if age_ns > self._expires_ns:
            return False, f'was {age_ns / NS_PER_S:.0f} s old when its turn came'
        try:
            self._begin(notification)
            return True, self.settings.channel.deliver(notification, again)
        except DeliveryError as error:
            return False, str(error)
        except Exception as error:  # the thread continues, whatever a channel raises
            return False, f'{type(error).__name__} in the channel'

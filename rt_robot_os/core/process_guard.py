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


"""The external supervision of the core's process: Linux, the machine, the service manager."""

from __future__ import annotations

from collections.abc import Mapping
import faulthandler
import math
import os
from pathlib import Path
import time

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.core.watchdog import TIMEOUTS_UNTIL_DEATH
from rt_robot_os.core.watchdog import Watchdog
from rt_robot_os.linux.dead_man_timer import DeadManTimer
from rt_robot_os.linux.machine_watchdog import MachineWatchdog
from rt_robot_os.linux.machine_watchdog import open_machine_watchdog
from rt_robot_os.linux.realtime import RtResult
from rt_robot_os.linux.service_manager import ServiceManager
from rt_robot_os.settings import WatchdogSettings

# After the request to stop; the node kills the core after 3 s.
END_NS = 2500 * NS_PER_MS


class ProcessGuard:
    """
    The timers and watchdogs that a healthy core feeds; nothing is open before :meth:`equip`.

    :param environment: with the address of a service manager.
    """

    def __init__(self, settings: WatchdogSettings,
                 environment: Mapping[str, str] = os.environ) -> None:
        self.manager = ServiceManager(environment)
        self.machine: MachineWatchdog | None = None
        self._settings = settings
        self._handle: DeadManTimer | None = None
        self._end: DeadManTimer | None = None
        self._ending = False
        self._notified = False

    def equip(self, watchdog: Watchdog | None) -> list[RtResult]:
        """
        Open everything that the watchdog feeds.

        :return: the result of each step.
        """
        results = self._open_end_timer()
        if watchdog is None:
            if not self.manager.watchdog_ns:
                return results
            seconds = self.manager.watchdog_ns / 1e9
            return [*results, RtResult(
                False, 'heartbeat of the service manager', 'it expects one every '
                f'{seconds:g} s. Remedy: set watchdog.timeout_s')]
        results.append(self._open_handle(watchdog))
        if self._settings.device:
            result, self.machine = open_machine_watchdog(
                Path(self._settings.device),
                max(1, math.ceil(TIMEOUTS_UNTIL_DEATH * self._settings.timeout_s)))
            results.append(result)
        if self.machine is not None:
            watchdog.feeders.append(self.machine.feed)
        if self.manager.watchdog_ns:
            watchdog.feeders.append(self._feed_manager)
        return results

    def _open_end_timer(self) -> list[RtResult]:
        """Create the timer that ends a process which hangs at its end; report only a failure."""
        faulthandler.enable()  # it writes the place of a hanging call to standard error
        try:
            self._end = DeadManTimer()
        except OSError as error:
            return [RtResult(False, 'limit for the end of the process', f'{error.strerror}. '
                             'Remedy: raise the limit of pending signals (ulimit -i)')]
        return []

    def begin_end(self) -> None:
        """
        Set a final deadline for the process, once; safe in the real-time loop.

        Then the process is ended, even in a native call that does not return.
        """
        if self._end is not None and not self._ending:
            self._ending = True
            self._end.push(time.monotonic_ns() + END_NS)

    def _open_handle(self, watchdog: Watchdog) -> RtResult:
        step = 'end of a process that hangs'
        try:
            watchdog.handle = self._handle = DeadManTimer()
        except OSError as error:
            return RtResult(False, step, f'{error.strerror}. Remedy: raise the limit of pending '
                            'signals (ulimit -i)')
        return RtResult(True, step)

    def _feed_manager(self) -> None:
        self.manager.notify('WATCHDOG=1')

    def ready(self) -> None:
        """Notify the service manager, once, that everything runs."""
        if not self._notified:
            self._notified = True
            self.manager.notify('READY=1')

    def leave(self) -> None:
        """Notify the service manager that the core is stopping."""
        self.manager.notify('STOPPING=1')

    def release(self) -> None:
        """Stop the timer of the watchdog: the following steps are bounded in time."""
        if self._handle is not None:
            self._handle.release()

    def close(self, stop: bool = True) -> None:
        """
        Close everything; may be called twice.

        :param stop: stop the machine's watchdog; otherwise the machine restarts unless the next
            core opens it in time.
        """
        for handle in (self._handle, self._end):
            if handle is not None:
                handle.close()
        if self.machine is not None:
            self.machine.close(stop)
        self.manager.close()

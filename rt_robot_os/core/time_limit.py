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


"""Call a function with a time limit, after the kernel has stopped, which could have aborted it."""

from __future__ import annotations

from collections.abc import Callable
import signal
import threading
import time
from types import FrameType
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel import TaskAborted
from rt_robot_os.kernel.failure import drop_context
from rt_robot_os.linux.raising import signal_and_raise
from rt_robot_os.linux.timer import SignalTimer

LIMIT_SIGNAL: Final = signal.SIGRTMIN + 7


_GRACE_NS: Final = 20 * NS_PER_MS


class _Limit:
    """
    The signal handler that raises an exception in the function repeatedly until it ends.

    If the function still runs 20 ms after the first exception, an exception is raised at every
    point at which Python runs signal handlers.
    """

    def __init__(self, name: str, limit_ns: int) -> None:
        self.inside = True
        self._name = name
        self._limit_ns = limit_ns
        self._always_ns = 0

    def __call__(self, signum: int, frame: FrameType | None) -> None:
        if not self.inside:
            return
        now_ns = time.monotonic_ns()
        self._always_ns = self._always_ns or now_ns + _GRACE_NS
        error = TaskAborted(self._name, self._limit_ns, 0,
                            f'did not end within {self._limit_ns // NS_PER_MS} ms')
        if now_ns >= self._always_ns:
            drop_context()
            next(signal_and_raise(LIMIT_SIGNAL, error))
        raise error


def call_within(name: str, function: Callable[[], object], limit_ns: int) -> BaseException | None:
    """
    Call a function; when it takes too long, TaskAborted is raised in it repeatedly.

    In a thread other than the main thread there are no signals, and so no limit. For a native call
    that does not return see :class:`rt_robot_os.linux.dead_man_timer.DeadManTimer`.

    :return: the exception that the function raised, if any.
    """
    if threading.current_thread() is not threading.main_thread():
        return _call(function, None)
    limit = _Limit(name, limit_ns)
    signal.signal(LIMIT_SIGNAL, limit)  # never restored: a pending signal would end the process
    timer = SignalTimer(LIMIT_SIGNAL)
    try:
        timer.arm(time.monotonic_ns() + limit_ns)
        return _call(function, limit)
    finally:
        timer.close()


def _call(function: Callable[[], object], limit: _Limit | None) -> BaseException | None:
    # The outer block catches an exception that is raised while the inner one is left.
    try:
        try:
            function()
        except BaseException as error:
            if limit is not None:
                limit.inside = False
            return error
        if limit is not None:
            limit.inside = False
    except BaseException as error:
        return error
    return None

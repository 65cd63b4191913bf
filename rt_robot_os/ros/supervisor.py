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

"""The thread that keeps a core running and connected, and reads what it sends."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import signal
import threading
import time
from typing import Any

from rt_robot_os.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.link.client import CoreStatistics
from rt_robot_os.link.stamps import StampMapper
from rt_robot_os.reports import Severity
from rt_robot_os.ros.core_process import CONFIGURATION_EXIT_CODE
from rt_robot_os.ros.core_process import CoreProcess

_PUMP_S = 0.05
_CONNECT_TRY_S = 0.05
_PAUSE_FIRST_S = 0.5
_PAUSE_MAXIMUM_S = 10.0
_LONG_LIFE_S = 30.0
_DEAD_AFTER_BEATS = 3
_START_TIMEOUT_S = 15.0
_ANSWER_MINIMUM_S = 0.5
# A core that its watchdog ends says goodbye before it is gone, and its exit code says why.
_GOODBYE_S = 1.0

Log = Callable[[int, str], None]
Relay = Callable[[int, int, str, str], None]
INFO, WARN, ERROR = int(Severity.INFO), int(Severity.WARN), int(Severity.ERROR)


class _Killed(LinkError):
    """We have ended the core ourselves."""


class Supervisor:
    """
    Keep a core running, stay connected, and hand on what it sends.

    :param process: the core to start; None attaches to one that somebody else starts.
    :param on_connect: called in the supervisor's thread with each new connection.
    :param on_disconnect: called there when it is lost.
    :param log: called with (severity as in ROS 2, text) from any thread.
    :param relay: called by the supervisor's thread with what the core says: severity, moment on
        CLOCK_MONOTONIC, source, text.
    :param heartbeat_s: silence after which the core is reported; after three times that a core
        of our own is killed and started anew.
    :param watchdog_code: exit code of a core whose watchdog ended it; 0 when it has none.
    :ivar fatal: why no core can run with this configuration; empty otherwise.
    """

    def __init__(self, path: Path, process: CoreProcess | None, mapper: StampMapper, log: Log,
                 relay: Relay, *, name: str, on_connect: Callable[[LinkClient], None],
                 on_disconnect: Callable[[], None], heartbeat_s: float,
                 statistics_period_s: float, watchdog_code: int = 0) -> None:
        self.process = process
        self.fatal = ''
        self.client: LinkClient | None = None
        self.connected = threading.Event()
        self.connections = 0
        self.statistics: CoreStatistics | None = None
        self.statistics_at_s = 0.0
        self._path = path
        self._mapper = mapper
        self._log = log
        self._relay = relay
        self._name = name
        self._on_connect = on_connect
        self._on_disconnect = on_disconnect
        self._heartbeat_s = heartbeat_s
        self._statistics_period_s = statistics_period_s
        self._watchdog_code = watchdog_code
        self._stopping = threading.Event()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, name='rt_robot_os link', daemon=True)

    def start(self) -> None:
        """Start the thread, and with it the core."""
        self._thread.start()

    def stop(self) -> None:
        """End the core in order and the thread; may be called twice."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()

    def wait(self, timeout_s: float) -> bool:
        """Wait until the core is connected, or cannot be; whether it is."""
        self._ready.wait(timeout_s)
        return self.connected.is_set()

    # ---- the thread --------------------------------------------------------------------------

    def _run(self) -> None:
        pause_s = _PAUSE_FIRST_S
        try:
            while not self._stopping.is_set():
                started_s = time.monotonic()
                reason = self._one_life()
                if self._stopping.is_set() or self.fatal:
                    return
                if time.monotonic() - started_s > _LONG_LIFE_S:
                    pause_s = _PAUSE_FIRST_S
                if reason:
                    self._log(ERROR, f'{reason}; again in {pause_s:g} s')
                self._stopping.wait(pause_s)
                pause_s = min(2 * pause_s, _PAUSE_MAXIMUM_S)
        finally:
            self._ready.set()
            if self.process is not None:
                self.process.stop()

    def _one_life(self) -> str:
        """Start or find a core and stay with it; say why it ended."""
        process = self.process
        if process is not None and not process.alive():
            process.start()
        client = self._connect()
        if client is None:
            return self._why_ended() if process is not None else ''
        self.client = client
        try:
            self._welcome(client)
            self._stay(client)
            return ''
        except LinkError as error:
            if process is None or self._stopping.is_set() or isinstance(error, _Killed):
                return str(error)
            if process.ended_within(_GOODBYE_S):
                return self._how_ended(process.exit_code)
            process.stop()  # it does not answer any more
            return str(error)
        except Exception as error:
            # Whatever it was, without this thread there would be no supervision at all.
            return f'{type(error).__name__} while reading from the core: {error}'
        finally:
            self.connected.clear()
            self.client = None
            self._on_disconnect()
            self._part(client)

    def _connect(self) -> LinkClient | None:
        deadline_s = time.monotonic() + _START_TIMEOUT_S
        while not self._stopping.is_set():
            if self.process is not None and not self.process.alive():
                return None
            if self.process is not None and time.monotonic() > deadline_s:
                self._log(ERROR, f'the core did not answer within {_START_TIMEOUT_S:g} s')
                self.process.kill()
                return None
            try:
                return LinkClient(self._path, self._name,
                                  max(_ANSWER_MINIMUM_S, _DEAD_AFTER_BEATS * self._heartbeat_s))
            except LinkError:
                if self.process is None and not self._ready.is_set():
                    self._log(WARN, f'no core at {self._path} yet; waiting for one')
                    self._ready.set()
                self._stopping.wait(_CONNECT_TRY_S)
        return None

    def _welcome(self, client: LinkClient) -> None:
        client.on_report = self._report
        self.connections += 1
        self._on_connect(client)
        self.connected.set()
        self._ready.set()
        self._log(INFO, f'connected to the core (pid {client.core["pid"]}): '
                  f'{len(client.topics)} topics, {len(client.core["tasks"])} tasks')

    def _stay(self, client: LinkClient) -> None:
        beat_s = statistics_s = 0.0
        warned = False
        while not self._stopping.is_set():
            client.pump(_PUMP_S)
            now_s = time.monotonic()
            self._mapper.compare()
            if now_s >= beat_s:
                client.beat()
                beat_s = now_s + self._heartbeat_s / 3
            if now_s >= statistics_s:
                statistics_s = now_s + self._statistics_period_s
                self.statistics = client.statistics()
                self.statistics_at_s = time.monotonic()
            silent_s = time.monotonic() - client.last_beat_ns / 1e9
            if silent_s > _DEAD_AFTER_BEATS * self._heartbeat_s and self.process is not None:
                self.process.kill()
                raise _Killed(f'the core did not beat for {silent_s:.1f} s and was killed')
            if silent_s > self._heartbeat_s and not warned:
                self._log(WARN, f'no heart-beat of the core for {silent_s:.1f} s')
            warned = silent_s > self._heartbeat_s

    def _part(self, client: LinkClient) -> None:
        if self._stopping.is_set() and self.process is not None:
            self.process.stop()
            try:  # its last words
                while client.pump(0.0):
                    pass
            except LinkError:
                pass
        client.close()

    def _why_ended(self) -> str:
        code = self.process.exit_code if self.process is not None else None
        if code == CONFIGURATION_EXIT_CODE:
            self.fatal = 'the core refused its configuration; see its message above'
            self._log(ERROR, self.fatal)
            return self.fatal
        return self._how_ended(code)

    def _how_ended(self, code: int | None) -> str:
        if self._watchdog_code and code == self._watchdog_code:
            return (f'the core ended with code {code}: a critical task stood still; see the '
                    'report of its watchdog above')
        if code is None or code >= 0:
            return f'the core ended with code {code}'
        name = _signal_name(-code)
        if self._watchdog_code and -code in (signal.SIGABRT, signal.SIGKILL):
            return (f'the core was ended by {name}: its watchdog did not come to run, so some '
                    'native call may not have returned; the traceback above says which')
        return f'the core was ended by {name}'

    def _report(self, content: dict[str, Any]) -> None:
        if content.get('dropped'):
            self._log(WARN, f'{content["dropped"]} reports of the core were dropped')
        self._relay(int(content['severity']), int(content['at_ns']), str(content['source']),
                    str(content['text']))


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f'signal {number}'

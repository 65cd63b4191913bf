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

"""The thread that keeps a core running and connected, and reads its packets."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
import signal
import threading
import time
from typing import Any

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.reports import Severity
from rt_robot_os.link import LinkClient
from rt_robot_os.link.client import LinkSilent
from rt_robot_os.link.client import Question
from rt_robot_os.link.core_statistics import collect
from rt_robot_os.link.core_statistics import CoreStatistics
from rt_robot_os.link.liveness import LivenessReader
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.ros.core_health import connection_problem
from rt_robot_os.ros.core_health import DEAD_AFTER_BEATS
from rt_robot_os.ros.core_health import SilenceTimer
from rt_robot_os.ros.core_health import StarvationDetector
from rt_robot_os.ros.core_process import CONFIGURATION_EXIT_CODE
from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.ros.core_process import FORCED_EXIT_CODE

_PUMP_S = 0.05
_POLL_S = 0.1
_CONNECT_TRY_S = 0.05
_PAUSE_FIRST_S = 0.5
_PAUSE_MAXIMUM_S = 10.0
_LONG_LIFE_S = 30.0
_START_TIMEOUT_S = 15.0
_START_TIMEOUT_MAXIMUM_S = 240.0
_LAST_REPORTS_S = 1.0
# The longest duration of one attempt to connect.
_TRY_MAXIMUM_S = 5.0
_STOP_PATIENCE_S = 15.0
_ANSWER_MINIMUM_S = 0.5
# A core that its watchdog ends disconnects before it exits, and its exit code gives the reason.
_EXIT_TIMEOUT_S = 1.0

Log = Callable[[int, str], None]
Relay = Callable[[int, int, str, str], None]
INFO, WARN, ERROR = int(Severity.INFO), int(Severity.WARN), int(Severity.ERROR)


class _Killed(LinkError):
    """This process has ended the core."""


class Supervisor:
    """
    Keep a core running and connected, and dispatch what it sends.

    :param process: the core to start; None attaches to a core that is started elsewhere.
    :param on_connect: called in the supervisor's thread with each new connection.
    :param on_disconnect: called there when it is lost.
    :param log: called with (severity as in ROS 2, text) from any thread.
    :param relay: called by the supervisor's thread with each report of the core: severity, time
        on CLOCK_MONOTONIC in ns, source, text.
    :param heartbeat_s: time without a change of the liveness counter after which the core is
        reported; after three times this an own core is killed and restarted. A core is alive as
        long as its kernel ticks, even if its tasks starve the link; time in which this process
        does not run does not count.
    :param watchdog_code: exit code of a core whose watchdog ended it; 0 without a watchdog.
    :ivar fatal: why no core can run with this configuration; empty otherwise.
    :ivar reason: why there is no core, if known; empty while there is one.
    :ivar starved: why a connected core is unresponsive; empty otherwise.
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
        self.reason = self.starved = ''
        self._liveness: LivenessReader | None = None
        self._silence = SilenceTimer()
        self._starvation = StarvationDetector()
        self._logged = ''
        self._start_limit_s = _START_TIMEOUT_S
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
            self._thread.join(_STOP_PATIENCE_S)

    def wait(self, timeout_s: float, give_up: Callable[[], bool] = lambda: False) -> bool:
        """
        Wait until the core is connected or has failed; return whether it is connected.

        :param give_up: called regularly; True ends the wait.
        """
        deadline_s = time.monotonic() + timeout_s
        while not give_up() and (left_s := deadline_s - time.monotonic()) > 0:
            if self._ready.wait(min(left_s, _POLL_S)):
                break
        return self.connected.is_set()

    # ---- the thread --------------------------------------------------------------------------

    def _run(self) -> None:
        pause_s = _PAUSE_FIRST_S
        try:
            while not self._stopping.is_set():
                started_s = time.monotonic()
                try:
                    reason = self._run_core()
                except Exception as error:
                    # Any error: without this thread there is no supervision.
                    reason = _error_text('supervision', error)
                if self._stopping.is_set() or self.fatal:
                    return
                if time.monotonic() - started_s > _LONG_LIFE_S:
                    pause_s = _PAUSE_FIRST_S
                self.reason = reason or self.reason
                if reason:
                    self._log(ERROR, f'{reason}; again in {pause_s:g} s')
                self._stopping.wait(pause_s)
                pause_s = min(2 * pause_s, _PAUSE_MAXIMUM_S)
        finally:
            self._ready.set()
            self._close_liveness()
            if self.process is not None:
                with suppress(OSError):
                    self.process.stop()

    def _run_core(self) -> str:
        """Start or find a core and stay connected; return why it ended."""
        process = self.process
        if process is not None and not process.alive():
            self._close_liveness()
            try:
                process.start()
                self._liveness = process.take_liveness()
            except OSError as error:
                return f'the core cannot be started: {error.strerror or error}'
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
            if process.ended_within(_EXIT_TIMEOUT_S):
                return self._how_ended(process.exit_code)
            return str(error)  # it is alive: the next round connects to it again
        except Exception as error:
            return _error_text('reading from the core', error)
        finally:
            self.connected.clear()
            self.client = None
            self.starved = self._logged = ''
            # Kept: it shows whether the core is alive while there is no connection.
            self._liveness, client.liveness = client.liveness or self._liveness, None
            try:
                self._on_disconnect()
            finally:
                self._disconnect(client)

    def _connect(self) -> LinkClient | None:
        limit_s, logged = self._start_limit_s, False
        started_s = time.monotonic()
        self._silence.restart()
        while not self._stopping.is_set():
            if self.process is not None and not self.process.alive():
                return None
            try:
                client = LinkClient(self._path, self._name,
                                    max(_ANSWER_MINIMUM_S, DEAD_AFTER_BEATS * self._heartbeat_s))
                self._start_limit_s = _START_TIMEOUT_S
                return client
            except LinkError as error:
                if self.process is None:
                    if not logged and (not self._ready.is_set() or _is_odd(error)):
                        self._log(WARN, f'no core at {self._path} yet; waiting for one: {error}')
                        logged = True
                        self._ready.set()
                elif self._is_lost(started_s, limit_s, error):
                    return None
                if self.process is None or not self.process.wait_until_ready(_CONNECT_TRY_S):
                    self._stopping.wait(_CONNECT_TRY_S)
        return None

    def _is_lost(self, started_s: float, limit_s: float, error: LinkError) -> bool:
        """Kill an own core that does not answer, unless it was connected and ticks."""
        if self.process is None:
            return False
        liveness = self._liveness.read() if self._liveness is not None else None
        if liveness is not None and liveness.ticks and not _is_closed(error):
            silent_s = self._silence.update(liveness.ticks, _TRY_MAXIMUM_S)
            starved = self._is_starved(silent_s)
            if silent_s <= DEAD_AFTER_BEATS * self._heartbeat_s or starved:
                self._warn(*connection_problem(liveness, silent_s, starved, self._heartbeat_s))
                return False
            self._log(ERROR, f'the core was unresponsive for {silent_s:.1f} s and is killed')
        elif time.monotonic() - started_s > limit_s:
            self._start_limit_s = min(2 * limit_s, _START_TIMEOUT_MAXIMUM_S)
            self._log(ERROR, f'the core did not answer within {limit_s:g} s and is killed; the '
                      f'next start may take {self._start_limit_s:g} s ({error})')
        else:
            return False
        self.process.kill()
        return True

    def _close_liveness(self) -> None:
        if self._liveness is not None:
            self._liveness.close()
            self._liveness = None

    def _welcome(self, client: LinkClient) -> None:
        client.on_report = self._report
        if client.liveness is not None:
            self._close_liveness()
        self.connections += 1
        self._on_connect(client)
        self.reason = ''
        self.connected.set()
        self._ready.set()
        self._log(INFO, f'connected to the core (pid {client.core.get("pid")}): '
                  f'{len(client.topics)} topics, {len(client.core.get("tasks", ()))} tasks')

    def _stay(self, client: LinkClient) -> None:
        poll_s = beat_s = statistics_s = 0.0
        question: Question | None = None
        self._silence.restart()
        while not self._stopping.is_set():
            client.pump(_PUMP_S)
            self._mapper.compare()
            now_s = time.monotonic()
            if now_s < poll_s:
                continue  # samples come often; the rest is less urgent
            poll_s = now_s + _PUMP_S / 2
            if now_s >= beat_s:
                with suppress(LinkSilent):  # its socket is full: the liveness counter decides
                    client.beat()
                beat_s = now_s + self._heartbeat_s / 3
            if question is None and now_s >= statistics_s:
                statistics_s = now_s + self._statistics_period_s
                with suppress(LinkSilent):
                    question = client.begin('statistics')
            elif question is not None and question.answered():
                question.drop()
                self.store_statistics(question)
                question = None
            self._check_liveness(client)

    def store_statistics(self, question: Question) -> None:
        """Store the statistics of a complete answer, or why there are none."""
        try:
            self.statistics, self.reason = collect(question.packets), ''
        except LinkError as error:  # the mirrors are not affected: the connection stays
            self.statistics, self.reason = None, f'the core sends no statistics: {error}'

    def _check_liveness(self, client: LinkClient) -> None:
        """Check whether the core is alive, after everything that arrived was read."""
        liveness = client.liveness.read() if client.liveness is not None else None
        silent_s = self._silence.update(liveness.ticks if liveness else client.last_beat_ns)
        starved = self._is_starved(silent_s)
        if (silent_s > DEAD_AFTER_BEATS * self._heartbeat_s and self.process is not None
                and not starved):
            if client.pump(0.0):
                return  # it is alive after all
            self.process.kill()
            raise _Killed(f'the core was unresponsive for {silent_s:.1f} s and was killed')
        self._warn(*connection_problem(liveness, silent_s, starved, self._heartbeat_s))

    def _warn(self, kind: str, text: str) -> None:
        self.starved = text
        if kind and kind != self._logged:
            self._log(WARN, text)
        self._logged = kind

    def _is_starved(self, silent_s: float) -> bool:
        """Return whether an own core is unresponsive because Linux does not let it run."""
        if self.process is None:
            return False
        return self._starvation.update(
            self.process.pid, silent_s if silent_s > self._heartbeat_s else 0.0)

    def _disconnect(self, client: LinkClient) -> None:
        if self._stopping.is_set() and self.process is not None:
            self.process.stop()
            deadline_s = time.monotonic() + _LAST_REPORTS_S
            try:
                while client.pump(0.0) and time.monotonic() < deadline_s:
                    pass
            except Exception as error:
                if not isinstance(error, LinkError):
                    self._log(WARN, _error_text('the last reports of the core', error))
        client.close()

    def _why_ended(self) -> str:
        code = self.process.exit_code if self.process is not None else None
        if code == CONFIGURATION_EXIT_CODE and self.connections:
            # It has run with this configuration: the cause may be temporary.
            return 'the core did not restart; see its message above'
        if code == CONFIGURATION_EXIT_CODE:
            self.fatal = 'the core refused its configuration; see its message above'
            self._log(ERROR, self.fatal)
            return self.fatal
        return self._how_ended(code)

    def _how_ended(self, code: int | None) -> str:
        if self._watchdog_code and code == self._watchdog_code:
            return (f'the core ended with code {code}: a critical task was unhealthy; see the '
                    'report of its watchdog above')
        if code == FORCED_EXIT_CODE:
            return (f'the core ended with code {code}: it was stopped, and a job, a module or a '
                    'device had to be ended by force; see its reports above')
        if code is None:
            return 'the core was killed and has not ended yet: it gets no CPU (see `doctor`)'
        if code >= 0:
            return f'the core ended with code {code}'
        name = _signal_name(-code)
        if self._watchdog_code and -code in (signal.SIGABRT, signal.SIGKILL):
            return (f'the core was ended by {name}: its watchdog could not run, so a native call '
                    'may not have returned; see the traceback above')
        return f'the core was ended by {name}'

    def _report(self, content: dict[str, Any]) -> None:
        """Relay a report of the core; a malformed one is logged and dropped."""
        try:
            line = (int(content['severity']), int(content['at_ns']), str(content['source']),
                    str(content['text']))
            dropped = int(content.get('dropped') or 0)
        except (KeyError, TypeError, ValueError) as error:
            self._log(WARN, _error_text('a report of the core', error))
            return
        if dropped:
            self._log(WARN, f'{dropped} reports of the core were dropped')
        self._relay(*line)


def _error_text(where: str, error: Exception) -> str:
    return f'{type(error).__name__} in {where}: {error}'


def _is_odd(error: LinkError) -> bool:
    """Whether a process answers, but not with the protocol of a core."""
    return not isinstance(error, LinkSilent) and not isinstance(error.__cause__, OSError)


def _is_closed(error: LinkError) -> bool:
    """Whether no process listens at the socket."""
    return isinstance(error.__cause__, FileNotFoundError | ConnectionRefusedError)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f'signal {number}'

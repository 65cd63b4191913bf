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

"""
One device under the SensorManager: polled, read on interrupt, closed after a fault, reopened.

A fault is never final: the port is closed and reopened after a back-off, which doubles up to a
limit and is reset when a frame arrives. Valid frames that give no sample are not a fault, because
the device is alive, but cause a warning with a remedy.
"""

from __future__ import annotations

from dataclasses import replace

from rt_robot_os.base.reports import LogEntry
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.gaps import EMPTIED_NS
from rt_robot_os.devices.gaps import Gaps
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.devices.state import reason_of
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.devices.state import SensorStatistics
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OneShot
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskState
from rt_robot_os.topics import Bus

_CHECKS_PER_TIMEOUT = 8
# A sample that is late by more than this many periods of the main topic is reported.
_PERIODS_WITHOUT_SAMPLE = 3


class ManagedDevice:
    """
    One device under the manager; its ``poll`` is the function of the task that reads it.

    :ivar arrival: the task that bytes and inputs release; None when the device is only polled.
    :ivar guards: the device moves something by its inputs, so it is brought to rest whenever it is
        opened or closed or goes to FAULT, and while one of its tasks is held.
    :ivar replay_gate: each of its rounds is released by a replay, and by nothing else.
    """

    def __init__(self, device: Device, kernel: Kernel, recovery: RecoverySettings,
                 reports: Reports) -> None:
        self.device = device
        self.arrival: Task | None = None
        self.replay_gate = False
        self._receives = device.receives()
        self.guards = self._receives and device.has_safe_state()
        self._at_rest = False
        self._interrupt = False
        self._due: OneShot | None = None
        self._due_ns = 0
        self.state = DeviceState.CLOSED
        self.reason = ''
        self.faults = self.opened = 0
        self.task: Task | None = None
        self._gaps = Gaps(kernel.clock)
        self._kernel = kernel
        self._now_ns = kernel.now_ns
        self._recovery = recovery
        self._reports = reports
        self._pause_ns = recovery.retry_ns
        self._retry_at_ns = 0
        self._alive_ns = 0
        self._sample_ns = 0
        self._checked_ns = self._emptied_ns = 0
        self._bytes_when_alive = 0
        self._bytes_noted_ns = 0
        self._port_open = False
        self._interrupt_fd: int | None = None
        self._told = ''
        self._undiagnosed = ''
        rates_hz = [p.rate_hz for p in device.publications()[:1] if p.rate_hz > 0]
        self._sample_late_ns = round(_PERIODS_WITHOUT_SAMPLE * NS_PER_S / rates_hz[0]) if (
            rates_hz) else 0

    def poll(self) -> None:
        """Write the command, read and publish; safe in the real-time loop."""
        self._exchange(command=True)

    def add_arrival(self, task: Task, interrupt: bool) -> None:
        """
        Set the task that runs :meth:`serve_arrival`.

        :param interrupt: bytes release it.
        """
        self.arrival = task
        self._interrupt = interrupt
        self._due = self._kernel.timer(task)

    def connect(self, bus: Bus) -> None:
        """
        Connect the inputs of the device; outputs have been bound.

        :raises TopicError: the topic of an input is not declared, or has another type.
        """
        if self.task is not None:
            self.device.connect(bus, self.task, self.arrival)

    def serve_arrival(self) -> None:
        """Receive, read and publish bytes that have just arrived; safe in the real-time loop."""
        if self._receives and _is_held(self.task):
            self._stay_at_rest()
        else:
            self._exchange(command=False)

    def _exchange(self, command: bool) -> None:
        state = self.state
        if state is not DeviceState.ACTIVE and state is not DeviceState.OPENING:
            return
        device, now_ns = self.device, self._now_ns()
        if (tap := device.tap) is not None:
            tap.command = command
        try:
            if self._gaps.round(now_ns, self.task.period_ns if self.task is not None else 0):
                self._wake_up(now_ns)
            if device.changes:
                device.apply_changes()
            if self._receives:
                self._receive(now_ns, command)
            if command:
                device.write(now_ns)
            if device.unread_since_ns and now_ns >= self._emptied_ns:
                device.unread_since_ns = 0
            samples = device.read(now_ns)
        except Exception as error:
            if tap is not None:
                tap.failed(now_ns)
            self._fault(reason_of(error))
            return
        if samples:
            self._alive_ns = self._sample_ns = now_ns
            if self.state is DeviceState.OPENING or self.reason:
                self._recovered()
        elif now_ns - self._checked_ns > self._recovery.timeout_ns // _CHECKS_PER_TIMEOUT:
            self._check(now_ns)

    def _wake_up(self, now_ns: int) -> None:
        """After a gap: first stop what moves. The missing bytes are not the device's fault."""
        self.rest()
        self.device.wake_up(now_ns)
        self.device.unread_since_ns = self._gaps.since_ns
        self._emptied_ns = now_ns + EMPTIED_NS
        if self.guards:
            self._note(Severity.WARN,
                       f'not served for {self._gaps.last_ns / NS_PER_S:.1f} s, because the core '
                       'or the machine was suspended: brought to rest; only later commands are '
                       'executed')
        # The device did send; it was not read.
        self._alive_ns = self._sample_ns = now_ns

    def _receive(self, now_ns: int, polled: bool) -> None:
        """Let the device process its inputs; an actuator not while its other task is held."""
        if self.guards and _is_held(self.arrival):
            self._stay_at_rest()
            return
        self._at_rest = False
        due_ns = self.device.receive(now_ns, polled)
        if due_ns and self._due is not None and not self.replay_gate and (
                not self._due.started or due_ns < self._due_ns):
            self._due_ns = due_ns
            self._due.start_at(due_ns)

    def _stay_at_rest(self) -> None:
        if not self._at_rest and self._port_open:
            self.rest()

    def rest(self) -> None:
        """Bring the device to rest if its port is open; an error is reported."""
        if not self.guards or not self._port_open or self._at_rest:
            return
        self._at_rest = True
        try:
            self.device.rest()
        except Exception as error:
            self._note(Severity.ERROR, f'could not be brought to rest: {reason_of(error)}')

    def _check(self, now_ns: int) -> None:
        """Check periodically whether valid frames arrive although nothing is published."""
        self._checked_ns = now_ns
        counters = self.device.statistics()
        if self._bytes_noted_ns < self._alive_ns:
            # Samples arrived since the last check: bytes count as garbage from here on.
            self._bytes_noted_ns = now_ns
            self._bytes_when_alive = counters.bytes_read
        if counters.last_frame_ns > self._alive_ns:
            self._alive_ns = counters.last_frame_ns
            self._bytes_when_alive = counters.bytes_read
            if self.state is DeviceState.OPENING:
                self._recovered()
            elif not self.reason:
                self._warn_of_no_sample(now_ns, counters.frames)
        elif now_ns - self._alive_ns > self._silence_ns():
            self._give_up(counters.bytes_read - self._bytes_when_alive)

    def _give_up(self, came: int) -> None:
        """Go to FAULT because no valid frame arrived; the bytes are identified later."""
        seconds = self._silence_ns() / NS_PER_S
        if came:
            self._undiagnosed = f'{came} bytes but no valid frame for {seconds:g} s'
            self._fault(f'{self._undiagnosed}: {self.device.IF_GARBAGE}')
        else:
            self._fault(f'silent for {seconds:g} s: {self.device.silence()}')

    def _diagnose(self) -> None:
        """Identify the bytes by the signatures of all devices, and report; not in the loop."""
        text, self._undiagnosed = self._undiagnosed, ''
        try:
            remedy = self.device.diagnosis()
        except Exception as error:
            # An error of the driver must not keep other devices from being opened.
            remedy = ''
            self._note(Severity.WARN, f'could not be diagnosed: {reason_of(error)}')
        self.reason = f'{text}: {remedy or self.device.IF_GARBAGE}'
        self._report('garbage')

    def _warn_of_no_sample(self, now_ns: int, frames: int) -> None:
        """Report, once until a sample arrives, that valid frames give no sample."""
        late_ns = max(self._patience_ns(), self._sample_late_ns)
        if now_ns - self._sample_ns > late_ns:
            remedy = self.device.unused() or self.device.IF_UNUSED
            self.reason = (f'{frames} valid frames, but no sample for {late_ns / NS_PER_S:g} s: '
                           f'{remedy}')
            self._note(Severity.WARN, self.reason)

    def _patience_ns(self) -> int:
        opening_s = self.device.opening_s() if self.state is DeviceState.OPENING else 0.0
        return max(self._recovery.timeout_ns, round(opening_s * NS_PER_S))

    def _silence_ns(self) -> int:
        return max(self._patience_ns(), round(self.device.quiet_s() * NS_PER_S))

    def recover(self) -> None:
        """Close the device if it failed and reopen it if due; slow, so at low priority."""
        if self.state is DeviceState.FAULT and self._port_open:
            self._close_port()
        # At its end: the device is brought to rest before anything is read.
        if self.state is DeviceState.FAULT and self._undiagnosed:
            self._diagnose()
        if self.state is DeviceState.ACTIVE or self.state is DeviceState.OPENING:
            self._maintain()
            return
        waits = self.state is DeviceState.FAULT and self._kernel.now_ns() < self._retry_at_ns
        if waits or self.state not in (DeviceState.FAULT, DeviceState.CLOSED):
            return
        try:
            self.device.open()
            self._at_rest = self.guards
            self._port_open = True
            if self.guards:
                self.device.rest()
        except Exception as error:
            self._fault(reason_of(error))
            return
        self.opened += 1
        self._gaps.restart()
        self._alive_ns = self._checked_ns = self._bytes_noted_ns = self._kernel.now_ns()
        self._sample_ns = self._alive_ns
        self._bytes_when_alive = self.device.statistics().bytes_read
        self.state = DeviceState.OPENING
        if self.device.tap is not None:
            self.device.tap.opened(self._alive_ns)
        if self.arrival is not None and self._interrupt:
            self._watch(self.arrival)

    def _maintain(self) -> None:
        try:
            self.device.maintain(self._kernel.now_ns())
        except Exception as error:
            if self.state is DeviceState.ACTIVE or self.state is DeviceState.OPENING:
                self._fault(reason_of(error))

    def _watch(self, arrival: Task) -> None:
        """Let the port release the task; without a descriptor the device is only polled."""
        fd = self.device.fileno()
        text = 'it has no file descriptor'
        if fd is not None:
            try:
                self._kernel.add_interrupt(fd, arrival)
                self._interrupt_fd = fd
                return
            except OSError as error:
                text = str(error)
        if self.opened == 1:
            self._note(Severity.WARN, f'cannot be read on interrupt, so it is polled: {text}; '
                       'set read: poll')

    def restart(self) -> None:
        """Have the port closed and reopened; for the kernel, after a failure."""
        if self.state is not DeviceState.CLOSED:
            self.reason = 'restarted'
            self._retry_at_ns = self._kernel.now_ns()
            self.state = DeviceState.FAULT

    def safe_state(self) -> None:
        """Bring the device to its safe state, if its port is open; for the kernel."""
        is_open = self.state is DeviceState.ACTIVE or self.state is DeviceState.OPENING
        if is_open and not self._at_rest:  # both of its tasks may call this
            self.device.rest()
            self._at_rest = self.guards

    def close(self) -> None:
        """Bring the device to rest and close the port finally; may be called twice."""
        self.state = DeviceState.CLOSED
        self._close_port()
        if self._undiagnosed:
            self._diagnose()

    def _close_port(self) -> None:
        self.rest()
        self._port_open = False
        fd, self._interrupt_fd = self._interrupt_fd, None
        if fd is not None:
            self._kernel.remove_interrupt(fd)
        try:
            self.device.close()
        except Exception as error:
            self._note(Severity.ERROR, f'could not be closed: {reason_of(error)}')

    def statistics(self) -> SensorStatistics:
        """Take the statistics."""
        counters = self.device.statistics()
        if self._receives:
            counters = replace(counters, more={**counters.more, **self.device.input_counters()})
        if self._gaps.count:
            counters = replace(counters, more={
                **counters.more, 'gaps': self._gaps.count,
                'gap_maximum_ms': self._gaps.longest_ns / NS_PER_MS})
        last_ns = counters.last_frame_ns
        reason = self.reason or str(counters.more.get('warning', ''))
        return SensorStatistics(
            self.device.name, self.state, reason, self.faults, self.opened,
            self._kernel.now_ns() - last_ns if last_ns else -1, counters)

    def _fault(self, reason: str) -> None:
        """Close the device until its back-off has passed."""
        reason = reason.removeprefix(f'{self.device.name}: ')
        self.reason = reason
        self.faults += 1
        self._retry_at_ns = self._kernel.now_ns() + self._pause_ns
        self._pause_ns = min(2 * self._pause_ns, self._recovery.retry_maximum_ns)
        tells_now = not self._undiagnosed
        self.rest()
        # Last: a recovery task of higher priority reacts immediately.
        self.state = DeviceState.FAULT
        self.rest()  # in case a round has moved it in between
        if tells_now:
            self._report(reason)

    def _report(self, kind: str) -> None:
        """
        Report why the device went to FAULT, unless that was reported before.

        :param kind: equal for reasons whose texts differ only in numbers.
        """
        if kind != self._told:
            self._told = kind
            self._note(Severity.ERROR, self.reason)

    def _note(self, severity: Severity, text: str) -> None:
        self._reports.note(LogEntry(self._kernel.now_ns(), severity, self.device.name, text))

    def _recovered(self) -> None:
        self.state = DeviceState.ACTIVE
        self._pause_ns = self._recovery.retry_ns
        text = f'active again after {self.reason!r}' if self.reason else 'active'
        self.reason = self._told = ''
        self._note(Severity.INFO, text)


def _is_held(task: Task | None) -> bool:
    return task is not None and task.state is not TaskState.ACTIVE

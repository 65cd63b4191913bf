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
From an obstacle's byte on the wire of a sensor to the stop on the wire of the motors.

Beside the program that is measured stands the world: a process that is an ultrasonic sensor on one
pty and a motor board on another, so that both moments are of one clock, and of nobody who has to
react.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
from contextlib import ExitStack
import os
from pathlib import Path
import pty
import random
import select
import threading
import time
import tty
from typing import Any
from typing import Final

from benchmarks.shared import work_queues
from benchmarks.shared.sine import Moments
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.actuator import Actuator
from rt_robot_os.devices.framing import FrameDecoder
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.maxbotix.driver import MaxBotix
from rt_robot_os.devices.maxbotix.wire import MaxBotixDecoder
from rt_robot_os.devices.maxbotix.wire import MaxBotixFrame
from rt_robot_os.devices.maxbotix.wire import reading
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.features.navigation.collision_guard import CollisionGuard
from rt_robot_os.features.navigation.velocity_mux import VelocityMux
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux import realtime as linux_realtime
from rt_robot_os.modules import Module
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.compute import compute
from rt_robot_os.topics import Bus
from rt_robot_os.topics.ports import Input

BUSY_NS: Final = 20 * NS_PER_MS
# No multiple of the commands' period: obstacles meet every phase of both.
_BUSY_PERIOD_NS: Final = 27 * NS_PER_MS
_COMMAND_HZ: Final = 50.0
_TWIST: Final = 'geometry_msgs/msg/Twist'
_SPEED_M_S: Final = 0.3
_NEAR_MM: Final = 300
_CLEAR, _OBSTACLE = reading(5000), reading(_NEAR_MM)
_FROM_S, _TO_S = 0.02, 0.06
_FIFO: Final = 70
_CHUNK: Final = 4096
_PATIENCE_S: Final = 2.0
# The board answers nothing, and is not opened again for that.
_NEVER_NS: Final = 3600 * NS_PER_S
Worker = Callable[[Harness], Measurement]
_WORLD: Final = f'{__name__}:world'


def order(left_m_s: float, right_m_s: float) -> bytes:
    """Write an order to the board: a line with the speeds of the wheels in mm/s."""
    return b'm %d %d\r' % (round(left_m_s * 1000), round(right_m_s * 1000))


STOP: Final = order(0.0, 0.0)


# --- the world: a sensor, and a board --------------------------------------------------------


def world(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """
    Be the sensor and the board; note when an obstacle was sent and when the stop was there.

    Each obstacle comes while the board is told to drive, at no regular time.
    """
    sonar, board = (_plug(arguments[name]) for name in ('sonar', 'board'))
    sent, stopped = (Moments(Path(arguments[name]), arguments['count'])
                     for name in ('sent', 'stopped'))
    chance = random.Random(1)
    linux_realtime.set_fifo(_FIFO)  # where it may: it is the clock of the measurement
    ready()
    for number in range(arguments['count']):
        if not _wait(board, sonar, lambda line: line != STOP):
            return
        until_s = time.monotonic() + chance.uniform(_FROM_S, _TO_S)
        while (left_s := until_s - time.monotonic()) > 0:
            _lines(board, left_s)
        sent.note(number)
        os.write(sonar, _OBSTACLE)
        if _wait(board, -1, lambda line: line == STOP):
            stopped.note(number)
    while True:
        time.sleep(1.0)


def _plug(link: str) -> int:
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.symlink(os.ttyname(slave), link)
    return master


def _wait(board: int, sonar: int, wanted: Callable[[bytes], bool]) -> bool:
    """Wait for an order; meanwhile the sensor, if given, says that all is clear."""
    end_s = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end_s:
        if sonar >= 0:
            os.write(sonar, _CLEAR)
        if any(wanted(line) for line in _lines(board, 0.02)):
            return True
    return False


def _lines(board: int, timeout_s: float) -> list[bytes]:
    """Return the orders that came; short ones, which a pty gives whole."""
    if not select.select([board], [], [], timeout_s)[0]:
        return []
    return os.read(board, _CHUNK).splitlines(keepends=True)


class _Trial:
    """The world beside a measurement, and its notes."""

    def __init__(self, harness: Harness) -> None:
        self._harness = harness
        a = harness.arguments
        self.count: int = a['count']
        self.duration_ns: int = a['measure_ns']
        folder = harness.folder
        self.sent, self.stopped = (Moments(folder / name, self.count, new=True)
                                   for name in ('sent', 'stopped'))
        self.sonar, self.board = str(folder / 'sonar'), str(folder / 'board')
        self._here = work_queues.mask() >> harness.own_cpu & 1

    @contextmanager
    def running(self) -> Iterator[None]:
        """Have the world there; ``alone`` without work queues on the measured CPU."""
        harness = self._harness
        with ExitStack() as stack:
            if harness.arguments['alone']:
                stack.enter_context(work_queues.kept_off(harness.own_cpu))
            helper = stack.enter_context(harness.helper(_WORLD, {
                'sonar': self.sonar, 'board': self.board, 'count': self.count,
                'sent': str(harness.folder / 'sent'),
                'stopped': str(harness.folder / 'stopped')}, same_cpu=False))
            assert helper is not None
            yield

    def measured(self) -> Measurement:
        """
        Compare the notes.

        :raises RuntimeError: no obstacle was answered.
        """
        sent, stopped = self.sent.taken(), self.stopped.taken()
        known = (sent > 0) & (stopped > 0)
        if not known.any():
            raise RuntimeError('no obstacle stopped the motors')
        # The last one may have been on its way at the end.
        due = max(1, int((sent > 0).sum()) - 1)
        return Measurement({'reaction_ns': (stopped - sent)[known]},
                           {'answered_percent': 100.0 * min(1.0, float(known.sum()) / due),
                            'workers_here': float(self._here)})


# --- the robot -------------------------------------------------------------------------------


class _NoAnswer(FrameDecoder[MaxBotixFrame]):
    """The board says nothing."""

    STARTS, SHORTEST, LONGEST, PATTERN = b'\xff', 1, 1, rb'\xff'

    def end(self, buffer: bytes, at: int) -> int:
        return at + 1

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> None:
        return None


class Board(Actuator, SerialDevice[MaxBotixFrame]):
    """A board that takes the speeds of two wheels, and answers nothing."""

    command = Input('cmd_vel_safe', wake=True, message=_TWIST)
    SETTINGS = serial_settings(
        baud=115200, frame_id='base_link', topic='board', rate_hz=50.0)

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        super().__init__(name, settings, _NoAnswer())

    def publications(self) -> tuple[Any, ...]:
        """Publish nothing."""
        return ()

    def handle(self, frame: MaxBotixFrame, arrival_ns: int) -> int:
        """Take nothing."""
        return 0

    def actuate(self, now_ns: int) -> None:
        """Tell the speeds."""
        twist = self.command.msg
        self.send(order(*wheel_speeds(twist.linear.x, twist.angular.z, 0.3)))

    def safe_state(self) -> None:
        """Stop."""
        self.send(STOP)


class _Steering(Module):
    """Drive ahead, as a control loop does."""

    def __init__(self, name: str, publisher: Any) -> None:
        super().__init__(name, {})
        self._publisher = publisher

    def step(self) -> None:
        """Publish a command."""
        self._publisher.msg.linear.x = _SPEED_M_S
        self._publisher.publish()


def _values(kind: Any, **changes: Any) -> dict[str, Any]:
    return {**{field.name: field.default for field in kind.fields()}, **changes}


def robot(trial: _Trial) -> tuple[Kernel, SensorManager]:
    """Wire sensor, steering, multiplexer, guard and board as a robot does."""
    kernel = Kernel()
    bus = Bus(kernel)
    sensors = SensorManager(kernel, bus, Reports())
    sensors.add(MaxBotix('sonar', _values(MaxBotix, port=trial.sonar)), rate_hz=20.0, priority=60,
                interrupt=True)
    sensors.add(Board('board', _values(Board, port=trial.board)), rate_hz=50.0, priority=75,
                recovery=RecoverySettings(timeout_ns=_NEVER_NS))
    command = bus.declare('cmd_vel', _TWIST)
    for topic in ('estop', 'estop_release'):
        bus.declare(topic, 'std_msgs/msg/Bool')
    modules: tuple[tuple[Module, int], ...] = (
        (VelocityMux('mux', _values(
            VelocityMux, sources=['ros'], source_topics=[command.name], source_priorities=[1],
            source_timeouts_s=[0.5])), 65),
        (CollisionGuard('guard', _values(
            CollisionGuard, scan_topics=[], range_topics=['range'])), 70))
    for module, _ in modules:
        module.mountings = {'sonar_link': Mounting((0.2, 0.0, 0.1))}
        module.declare(bus, 0.0)
    for module, priority in modules:
        module.bind(bus, kernel.add_task(module.name, module.job, priority=priority))
        module.configure()
        module.activate()
    sensors.connect()
    steering = _Steering('steering', bus.publisher(command.name))
    kernel.add_task('steering', steering.job, priority=50, rate_hz=_COMMAND_HZ)
    return kernel, sensors


def realtime(harness: Harness) -> Measurement:
    """Measure a robot of the core; ``busy`` computations of 20 ms run at the lowest priority."""
    trial = _Trial(harness)
    with trial.running():
        kernel, sensors = robot(trial)
        for i in range(harness.arguments['busy']):
            kernel.add_task(f'busy{i}', lambda: compute(BUSY_NS), priority=1,
                            rate_hz=NS_PER_S / _BUSY_PERIOD_NS)
        harness.prepare(freeze=True)
        try:
            kernel.run(trial.duration_ns)
        finally:
            sensors.close()
        return trial.measured()


# --- the same with threads -------------------------------------------------------------------


def plain(harness: Harness) -> Measurement:
    """
    Measure the same of three threads of an ordinary process: sensor, steering, computation.

    The sensor's thread reads, judges and writes the stop itself: nothing can be shorter.
    """
    trial = _Trial(harness)
    with trial.running():
        sonar, board = (os.open(path, os.O_RDWR | os.O_NOCTTY)
                        for path in (trial.sonar, trial.board))
        harness.prepare()
        robot_state = _Threads(sonar, board)
        threads = [threading.Thread(target=target, daemon=True) for target in (
            robot_state.sense, *(robot_state.compute,) * harness.arguments['busy'])]
        for thread in threads:
            thread.start()
        robot_state.steer(time.monotonic_ns() + trial.duration_ns)
    for thread in threads:
        thread.join()  # the world is gone, and with it the sensor
    for fd in (sonar, board):
        os.close(fd)
    return trial.measured()


class _Threads:
    """What the threads share."""

    def __init__(self, sonar: int, board: int) -> None:
        self._sonar, self._board = sonar, board
        self._limit_m_s = 0.0
        self._ended = False

    def steer(self, end_ns: int) -> None:
        while time.monotonic_ns() < end_ns:
            os.write(self._board, order(self._limit_m_s, self._limit_m_s))
            time.sleep(1 / _COMMAND_HZ)
        self._ended = True

    def sense(self) -> None:
        decoder = MaxBotixDecoder()
        while True:
            try:
                data = os.read(self._sonar, _CHUNK)
            except OSError:
                return
            for frame in decoder.feed(data):
                near = frame.value <= _NEAR_MM
                self._limit_m_s = 0.0 if near else _SPEED_M_S
                if near:
                    os.write(self._board, STOP)

    def compute(self) -> None:
        next_ns = time.monotonic_ns()
        while not self._ended:
            compute(BUSY_NS)
            next_ns += _BUSY_PERIOD_NS
            time.sleep(max(0, next_ns - time.monotonic_ns()) / NS_PER_S)

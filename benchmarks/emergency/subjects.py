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
From the last byte of an alarm frame on the sink's wire to the first command on the motors' wire.

A robot of the modules that ship with the package, in a core like the real one: sink, readings,
rule, alarms with their journal, agent, multiplexer, guard, base. Beside it stands the world: a
process that is the sink mote on one pty and the motor board on another, so that both moments are
of one clock, and of nobody who has to react.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
from contextlib import ExitStack
import json
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
from benchmarks.sink.subjects import BAUD
from benchmarks.sink.subjects import number_of
from benchmarks.sink.subjects import reading
from benchmarks.sink.subjects import send
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.devices.arduino_bridge import wire
from rt_robot_os.features.agent.module import AgentModule
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.linux import realtime as linux_realtime
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.modules import Module
from rt_robot_os.settings import load
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.compute import compute
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

#: The stages of the chain, by the names of their tasks; devices by their own.
CHAIN: Final = ('sink', 'dangers', 'smoke', 'alarms', 'agent', 'velocity_mux', 'collision_guard',
                'base')
#: A computing task takes so much of each period: 20 of them 80 % of a CPU.
BUSY_NS: Final = 4 * NS_PER_MS
BUSY_PERIOD_NS: Final = 97 * NS_PER_MS
NODE: Final = 7
_HERE: Final = __name__
_FIFO: Final = 70
_CHUNK: Final = 4096
_FROM_S, _TO_S = 0.03, 0.09
_PATIENCE_S: Final = 3.0
# Until the program that is measured runs.
_START_S: Final = 30.0
_TAIL_NS: Final = NS_PER_S // 5
# Where few alarms are asked for, the measurement ends with the last of them.
_END_HZ: Final = 10.0
# So long the operator looks on before the emergency is resolved.
_RESOLVE_NS: Final = 30 * NS_PER_MS
_STILL: Final = (0, 0)
Worker = Callable[[Harness], Measurement]


# --- the world: a sink, and a board -----------------------------------------------------------


def world(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """
    Be the sink mote and the motor board; note when an alarm was sent and when the wheels turn.

    Each alarm comes while the robot stands, at no regular time.
    """
    sink, board = (_plug(arguments[name]) for name in ('sink', 'board'))
    sent, moved = (Moments(Path(arguments[name]), arguments['count'])
                   for name in ('sent', 'moved'))
    chance, sleeper = random.Random(1), Sleeper()
    linux_realtime.set_fifo(_FIFO)  # where it may: it is the clock of the measurement
    ready()
    motors = _Motors(board)
    motors.serve(_START_S, lambda: motors.asked)
    motors.serve(arguments['delay_ns'] / NS_PER_S)
    for number in range(arguments['count']):
        motors.serve(_PATIENCE_S, lambda: motors.speeds == _STILL)
        motors.serve(chance.uniform(_FROM_S, _TO_S))
        motors.at_first = lambda: moved.note(number)  # noqa: B023
        send(sink, sleeper, reading(NODE, 2 * number, Kind.SMOKE, 1), time.monotonic_ns(), 1,
             sent, number)
        motors.serve(_PATIENCE_S, lambda: motors.speeds != _STILL)
        send(sink, sleeper, reading(NODE, 2 * number + 1, Kind.SMOKE, 0), time.monotonic_ns(), 1,
             sent, -1)
    while True:
        motors.serve(1.0)


def _plug(link: str) -> int:
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.symlink(os.ttyname(slave), link)
    return master


class _Motors:
    """
    An Arduino with two motors, that do at once what they are told.

    :ivar speeds: in counts for each round of its loop.
    :ivar at_first: called when they begin to turn.
    :ivar asked: somebody has begun to talk to it.
    """

    def __init__(self, board: int) -> None:
        self.speeds = _STILL
        self.at_first: Callable[[], object] = bool
        self.asked = False
        self._board = board
        self._held = b''
        self._counts = [0.0, 0.0]
        self._since_s = time.monotonic()

    def serve(self, for_s: float, until: Callable[[], bool] = bool) -> None:
        """Answer for a while, or until something is so."""
        end_s = time.monotonic() + for_s
        while not until() and (left_s := end_s - time.monotonic()) > 0:
            if select.select([self._board], [], [], left_s)[0]:
                *orders, self._held = (self._held + os.read(self._board, _CHUNK)).split(b'\r')
                for each in orders:
                    os.write(self._board, self._answer(each.strip()) + b'\r\n')

    def _answer(self, order: bytes) -> bytes:
        self.asked = True
        self._turn()
        if order == b'e':
            return b'%d %d' % tuple(self._counts)
        if order == b'b':
            return b'%d' % BAUD
        if order.startswith(b'm '):
            wanted = tuple(map(int, order.split()[1:]))
            if self.speeds == _STILL and wanted != _STILL:
                self.at_first()
            self.speeds = wanted[0], wanted[1]
        return wire.DONE

    def _turn(self) -> None:
        now_s = time.monotonic()
        for wheel, speed in enumerate(self.speeds):
            self._counts[wheel] += speed * wire.PID_RATE_HZ * (now_s - self._since_s)
        self._since_s = now_s


# --- what stands beside the chain in the core --------------------------------------------------


class Pose(Module):
    """Knows that the robot is where it was, as localization does."""

    pose = Output('pose', 'geometry_msgs/msg/PoseWithCovarianceStamped',
                  {'header.frame_id': 'map'})

    def step(self) -> None:
        """Publish where it is, and how well that is known."""
        covariance = self.pose.msg.pose.covariance
        covariance[0] = covariance[7] = covariance[35] = 1e-4
        self.pose.msg.pose.pose.orientation.w = 1.0
        self.pose.publish()


class Operator(Module):
    """Resolves each emergency a moment after it was raised, so that the next may come."""

    events = Input('alarms/events', message='std_msgs/msg/String')
    command = AgentModule.alarm_command  # of two writers of a topic both say the same of it

    _waiting: tuple[tuple[int, str], ...] = ()

    def step(self) -> None:
        """Resolve what has waited for long enough."""
        now_ns = self.command.topic.kernel.now_ns()
        while self.events.take():
            event = json.loads(str(self.events.msg.data))
            if event['event'] == 'raised':
                self._waiting += ((now_ns + _RESOLVE_NS, str(event['alarm'])),)
        while self._waiting and self._waiting[0][0] <= now_ns:
            self.command.msg.data = f'resolve {self._waiting[0][1]} by bench'
            self.command.publish()
            self._waiting = self._waiting[1:]


_ROBOT: Final = """
/**/robot:
  ros__parameters:
    core: {{spawn: false, scheduler_priority: 0}}
    devices: [base, sink, journal]
    base: {{type: arduino_bridge, port: {board}, baud: 0, reset_wait_s: 0.0, rate_hz: 50.0,
           wheel_radius_m: 0.075, wheel_separation_m: 0.34, ticks_per_revolution: 4096.0,
           priority: 75}}
    sink: {{type: sink, port: {sink}, baud: 57600, read: interrupt, rate_hz: 20.0, priority: 44}}
    journal: {{type: journal, port: {journal}, rate_hz: 10.0, priority: 25}}
    modules: [where, dangers, smoke, alarms, agent, velocity_mux, collision_guard, operator]
    where: {{type: '{here}:Pose', rate_hz: 20.0, priority: 57}}
    dangers: {{type: sensor_readings, packets_topic: wsn/packets/alarm, quantities: [smoke],
              nodes: ['kitchen -3.0 1.0 2.0 id {node} smoke'], rate_hz: 0.0, priority: 43}}
    smoke: {{type: rule, when: 'wsn/kitchen/smoke.data > 0.5', kind: smoke, subject: kitchen,
            level: critical, node: kitchen, rate_hz: 1.0, priority: 42}}
    alarms: {{type: alarms, again_s: 0.0, rate_hz: 10.0, priority: 41}}
    agent: {{type: agent, nodes: ['kitchen -3.0 1.0 2.0 id {node} smoke'], home: [0.0, 0.0, 0.0],
            observe: [], rate_hz: 0.0, priority: 40}}
    velocity_mux: {{type: velocity_mux, sources: [agent], source_topics: [cmd_vel_agent],
                   source_priorities: [50], source_timeouts_s: [0.5], rate_hz: 20.0, priority: 65}}
    collision_guard: {{type: collision_guard, scan_topics: [], bumper_topic: bumper,
                      bumper_timeout_s: 0.0, rate_hz: 50.0, priority: 66}}
    operator: {{type: '{here}:Operator', rate_hz: 50.0, priority: 10}}
    topics: [agent_command, answer, observed, planner_state, report, bumper, estop_in, release,
             battery]
    agent_command: {{topic: agent/command, message: std_msgs/msg/String, tail: 100}}
    answer: {{topic: agent/answer, message: std_msgs/msg/String, tail: 100}}
    observed: {{topic: agent/observed, message: std_msgs/msg/String, tail: 1000}}
    planner_state: {{topic: planner/state, message: std_msgs/msg/String, tail: 200}}
    report: {{topic: alarms/report, message: std_msgs/msg/String, tail: 2000}}
    battery: {{topic: battery, message: sensor_msgs/msg/BatteryState}}
    bumper: {{topic: bumper, message: std_msgs/msg/UInt8}}
    estop_in: {{topic: estop, message: std_msgs/msg/Bool}}
    release: {{topic: estop_release, message: std_msgs/msg/Bool}}
"""


def configuration(folder: Path) -> Path:
    """Write the configuration of the robot, with its ports in a folder, and return its path."""
    path = folder / 'emergency.yaml'
    path.write_text(_ROBOT.format(
        board=folder / 'board', sink=folder / 'sink', journal=folder / 'journal', here=_HERE,
        node=NODE))
    return path


class _Trial:
    """The world beside a measurement, and its notes."""

    def __init__(self, harness: Harness) -> None:
        self._harness = harness
        a = harness.arguments
        self.count: int = a['count']
        self.duration_ns: int = a['start_ns'] + a['measure_ns'] + _TAIL_NS
        folder = harness.folder
        self.sent, self.moved = (Moments(folder / name, self.count, new=True)
                                 for name in ('sent', 'moved'))
        self._here = work_queues.mask() >> harness.own_cpu & 1

    def core(self) -> Core:
        """Make the robot; its ports need not be there yet."""
        return Core(load([configuration(self._harness.folder)]), socket_path('bench'))

    @contextmanager
    def running(self) -> Iterator[None]:
        """Have the world there; ``alone`` without work queues on the measured CPU."""
        harness, folder = self._harness, self._harness.folder
        with ExitStack() as stack:
            if harness.arguments['alone']:
                stack.enter_context(work_queues.kept_off(harness.own_cpu))
            stack.enter_context(harness.helper(f'{_HERE}:world', {
                'sink': str(folder / 'sink'), 'board': str(folder / 'board'),
                'count': self.count, 'delay_ns': harness.arguments['start_ns'],
                'sent': str(folder / 'sent'), 'moved': str(folder / 'moved')}, same_cpu=False))
            yield

    @property
    def done(self) -> bool:
        """Return whether every alarm has moved the robot; safe in the real-time loop."""
        return bool(self.moved.times[-1])

    def measured(self) -> Measurement:
        """
        Compare the notes.

        :raises RuntimeError: no alarm moved the robot.
        """
        sent, moved = self.sent.taken(), self.moved.taken()
        known = (sent > 0) & (moved > 0)
        if not known.any():
            raise RuntimeError('no alarm moved the robot')
        # The last one may have been on its way at the end.
        due = max(1, int((sent > 0).sum()) - 1)
        return Measurement({'delay_ns': (moved - sent)[known]}, {
            'answered_percent': 100.0 * min(1.0, float(known.sum()) / due),
            'workers_here': float(self._here)})


def realtime(harness: Harness) -> Measurement:
    """Measure a robot of the core; ``busy`` tasks of the lowest priority compute beside it."""
    trial = _Trial(harness)
    with trial.running():
        tested = trial.core()
        for number in range(harness.arguments['busy']):
            tested.kernel.add_task(f'busy{number}', lambda: compute(BUSY_NS), priority=1,
                                   rate_hz=NS_PER_S / BUSY_PERIOD_NS)
        tested.kernel.add_task('end', lambda: tested.stop('measured') if trial.done else None,
                               priority=1, rate_hz=_END_HZ)
        harness.prepare(freeze=True)
        tested.run(trial.duration_ns)
    return trial.measured()


# --- the same without all that ----------------------------------------------------------------


def plain(harness: Harness) -> Measurement:
    """
    Measure a thread of an ordinary process that turns the wheels itself; ``busy`` others compute.

    It waits for bytes, decodes, and writes to the board: no alarm is kept, nobody is told, and
    nothing can be shorter.
    """
    trial = _Trial(harness)
    with trial.running():
        sink, board = (os.open(harness.folder / name, os.O_RDWR | os.O_NOCTTY)
                       for name in ('sink', 'board'))
        harness.prepare()
        end_ns = time.monotonic_ns() + trial.duration_ns
        for _ in range(harness.arguments['busy']):
            threading.Thread(target=_busy, args=(end_ns,), daemon=True).start()
        _serve(sink, board, end_ns, lambda: trial.done)
    for fd in (sink, board):
        os.close(fd)
    return trial.measured()


def _serve(sink: int, board: int, end_ns: int, done: Callable[[], bool]) -> None:
    os.write(board, wire.BAUD)
    reader, decoder = FrameReader(), PacketDecoder(TINYOS_1.name)
    until_ns = end_ns
    while (now_ns := time.monotonic_ns()) < end_ns and not done():
        if now_ns >= until_ns:
            os.write(board, wire.HALT)
            until_ns = end_ns
        left_s = (min(until_ns, end_ns) - now_ns) / NS_PER_S
        ready, _, _ = select.select([sink, board], [], [], max(left_s, 0.0))
        if board in ready:
            os.read(board, _CHUNK)
        if sink in ready:
            for each in reader.feed(os.read(sink, _CHUNK)):
                # Of two frames of the node the first is the alarm.
                if decoder.decode(each.packet).origin == NODE and not number_of(each.packet) % 2:
                    os.write(board, wire.speeds(-4, 4))
                    until_ns = time.monotonic_ns() + _RESOLVE_NS


def _busy(end_ns: int) -> None:
    next_ns = time.monotonic_ns()
    while next_ns < end_ns:
        compute(BUSY_NS)
        next_ns += BUSY_PERIOD_NS
        time.sleep(max(0, next_ns - time.monotonic_ns()) / NS_PER_S)

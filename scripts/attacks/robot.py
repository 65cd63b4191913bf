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
A whole simulated robot to attack: its core can be killed, stopped and continued.

The robot is that of ``config/service_robot.yaml`` with a motor board of choice, before a wall.
Its simulated devices run in a process of their own (:mod:`hardware`), as real ones would, so that
they go on when the core does not. What truly happened is read from the simulated world::

    with Robot('arduino_bridge', start_free_m=2.0) as robot:
        robot.drive(0.5)                                 # 20 commands a second on cmd_vel
        robot.until(lambda now: now.free_m < 0.8, 'the place')
        robot.kill_core()                                # or stop_core(), later continue_core()
        robot.drive(None)                                # the sender ends
        robot.until_rest()
        print(robot.now.contacts, robot.now.impact_m_s)

Needs no ROS 2, except for ``node=True``, which starts the node with the core as its child. Run it
under ``chrt``-capable rights, or with ``realtime=False``.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
import json
import math
import os
from pathlib import Path
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from types import TracebackType
from typing import Any
from typing import NamedTuple

import numpy as np
import yaml

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from rt_robot_os.base.errors import LinkError  # noqa: E402
from rt_robot_os.core.simulators import device_folder  # noqa: E402, I100
from rt_robot_os.link import LinkClient  # noqa: E402
from rt_robot_os.linux.paths import socket_path  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.settings import load  # noqa: E402
from rt_robot_os.sim.commands import send_command  # noqa: E402

SHIPPED = ROOT / 'config' / 'service_robot.yaml'
PATIENCE_S = 30.0
# On a machine that computes something else the node takes long.
START_PATIENCE_S = 120.0
REST_M_S = 0.005
REST_RAD_S = 0.01
COMMAND_HZ = 20.0
# The face of the wall, and half the width of the room, in m.
WALL_X_M = 6.0
HALF_WIDTH_M = 3.0
_RESOLUTION_M = 0.05
_STANDING_S = 0.5

#: What each board of the matrix is configured with, apart from its port.
BOARDS: dict[str, dict[str, Any]] = {
    'roboclaw': {'wheel_radius_m': 0.075, 'wheel_separation_m': 0.34,
                 'ticks_per_revolution': 4096.0},
    'arduino_bridge': {'wheel_radius_m': 0.05, 'wheel_separation_m': 0.3,
                       'ticks_per_revolution': 1440.0, 'pid_gains': [20, 12, 0, 20]},
    'kobuki': {'wheel_radius_m': 0.035, 'wheel_separation_m': 0.23},
    'odrive': {'wheel_radius_m': 0.05, 'wheel_separation_m': 0.3},
}
# What every board takes from the shipped robot.
_COMMON = ('port', 'maximum_wheel_speed_m_s', 'output_rate_hz', 'rate_hz', 'priority',
           'command_timeout_s')
# The chain from a command to the wheels, and what it needs; the whole robot has all.
_CHAIN = {'devices': ('base', 'laser', 'sonar', 'infrared'),
          'modules': ('velocity_mux', 'collision_guard'),
          'topics': ('cmd_vel', 'cmd_vel_teleop', 'cmd_vel_agent', 'estop', 'estop_release'),
          'mirrors': ('ros_cmd_vel', 'teleop', 'estop_in', 'release', 'joints', 'faults', 'scan',
                      'steering', 'stop_reason'),
          'services': ()}
# Sections that no list names.
_PARTS = ('core', 'watchdog', 'log')
_TWIST = {'message': 'geometry_msgs/msg/Twist', 'rate_hz': 20.0}


class Truth(NamedTuple):
    """
    A line of the track: what the simulated world says.

    :ivar at_ns: CLOCK_MONOTONIC.
    :ivar ahead_m_s: true speed of the body.
    :ivar turning_rad_s: true rate of turning.
    :ivar impact_m_s: the largest speed into anything, from the start.
    :ivar contacts: how often it has begun to push against something, from the start.
    :ivar free_m: from its outline straight to the wall.
    """

    at_ns: int
    x_m: float
    y_m: float
    yaw_rad: float
    ahead_m_s: float
    turning_rad_s: float
    impact_m_s: float
    contacts: int
    free_m: float

    @property
    def is_moving(self) -> bool:
        """Return whether the body moves."""
        return abs(self.ahead_m_s) > REST_M_S or abs(self.turning_rad_s) > REST_RAD_S


class Robot:
    """
    One robot in a temporary folder; a context manager.

    :param board: one of :data:`BOARDS`.
    :param start_free_m: from the outline of the robot to the wall ahead of it.
    :param whole: all of the shipped robot except its camera; else the chain from commands to the
        wheels with laser, sonar and infrared.
    :param node: start the ROS 2 node, with the core as its child.
    :param realtime: at SCHED_FIFO on a CPU of its own; else as an ordinary process.
    :param changes: laid over the configuration: section, then key; a new section such as that of
        a module of your own has to be listed, too.
    :param modules: further modules, by name; their settings are in ``changes``.
    :ivar track: all that has been read of the truth.
    :ivar folder: with ``core.log``, ``hardware.log``, ``robot.yaml``.
    :ivar socket: of the core.
    :ivar environment: of all its processes, for further ones of this robot.
    """

    def __init__(self, board: str = 'roboclaw', *, start_free_m: float = 2.0, whole: bool = False,
                 node: bool = False, realtime: bool = True,
                 changes: dict[str, dict[str, Any]] | None = None,
                 modules: tuple[str, ...] = ()) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix='rta'))
        self.track: list[Truth] = []
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._client: LinkClient | None = None
        self._sender: Sender | None = None
        self._rest = ''
        self._node = node
        self.environment = {
            **os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(self.folder), 'OPENBLAS_NUM_THREADS': '1',
            'ROS_HOME': str(self.folder / 'home'),
            'PYTHONPATH': os.pathsep.join([
                str(ROOT), str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')])}
        os.environ['RT_ROBOT_OS_RUNTIME_DIR'] = str(self.folder)
        self.socket = socket_path()
        self._hardware = device_folder(self.socket).with_suffix('.hardware')
        parameters = _configuration(board, whole, realtime, changes or {}, modules)
        self._radius_m = float(parameters['collision_guard']['robot_radius_m'])
        parameters['world'] = {
            'map': str(_room(self.folder / 'room.yaml')), 'robot_radius_m': self._radius_m,
            **parameters.get('world', {}),
            'start': [WALL_X_M - start_free_m - self._radius_m, 0.0, 0.0]}
        self._parameters = parameters

    def __enter__(self) -> Robot:
        try:
            self._start_hardware()
            self.start_core()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if error is not None:
            sys.stderr.write(self.log('core')[-3000:])
        self.close()

    # ---- processes -----------------------------------------------------------------------------

    def _start_hardware(self) -> None:
        """Start the simulated devices, then write the configuration with their ports."""
        path = self.folder / 'robot.yaml'
        _write(path, self._parameters)
        settings = load([path])
        devices = {each.name: {'type': each.type, 'device': dict(each.settings),
                               'sim': dict(each.sim or {})} for each in settings.devices}
        self._hardware.mkdir(mode=0o700)
        given = json.dumps({'devices': devices, 'world': asdict(settings.world), 'mountings': {
            frame: asdict(each) for frame, each in settings.mountings.items()}}, default=dict)
        with (self.folder / 'hardware.log').open('wb') as log:
            process = self._processes['hardware'] = subprocess.Popen(
                [sys.executable, str(Path(__file__).with_name('hardware.py')),
                 str(self._hardware)],
                stdin=subprocess.PIPE, stdout=log, stderr=log, env=self.environment)
        assert process.stdin is not None
        process.stdin.write(given.encode())
        process.stdin.close()
        for name in devices:
            self._parameters[name]['port'] = str(self._hardware / name)
            self._parameters[name].pop('sim', None)
        del self._parameters['world']
        _write(path, self._parameters)
        wait(lambda: self._poll() and self.track, 'the hardware', lambda: self.log('hardware'))

    def start_core(self) -> None:
        """Start the core, or the node with its core; wait until all devices deliver."""
        program = 'ros' if self._node else 'core'
        with (self.folder / 'core.log').open('ab') as log:
            self._processes['node' if self._node else 'core'] = subprocess.Popen(
                [sys.executable, '-m', f'rt_robot_os.{program}.program', '--ros-args',
                 '--params-file', str(self.folder / 'robot.yaml')],
                stdout=log, stderr=log, env=self.environment, cwd=self.folder)
        for condition, what in ((self._connected, 'the core'),
                                (self._delivers, 'a core whose devices deliver')):
            wait(condition, what, lambda: self.log('core'), START_PATIENCE_S)

    def _connected(self) -> bool:
        if self._client is not None:
            self._client.close()
            self._client = None
        with suppress(LinkError):
            self._client = LinkClient(self.socket, 'attack')
        return self._client is not None

    def _delivers(self) -> bool:
        devices = self.client.statistics().devices
        return bool(devices) and all(each['state'] == 'active' for each in devices)

    @property
    def client(self) -> LinkClient:
        """Return the connection to the core."""
        assert self._client is not None, 'the core was not started'
        return self._client

    @property
    def core_pid(self) -> int:
        """Return the process of the core that :attr:`client` speaks with."""
        return int(self.client.core['pid'])

    def kill_core(self) -> int:
        """End the core with SIGKILL; return the time, in ns."""
        return self._signal(signal.SIGKILL)

    def stop_core(self) -> int:
        """Freeze the core with SIGSTOP; return the time, in ns."""
        return self._signal(signal.SIGSTOP)

    def continue_core(self) -> int:
        """Have a stopped core go on; return the time, in ns."""
        return self._signal(signal.SIGCONT)

    def _signal(self, number: signal.Signals) -> int:
        at_ns = time.monotonic_ns()
        os.kill(self.core_pid, number)
        return at_ns

    def log(self, name: str) -> str:
        """Return what ``core`` (and the node) or ``hardware`` has written."""
        return (self.folder / f'{name}.log').read_text(errors='replace')

    # ---- commands ------------------------------------------------------------------------------

    def drive(self, ahead_m_s: float | None, turning_rad_s: float = 0.0, *,
              topic: str = 'cmd_vel', rate_hz: float = COMMAND_HZ) -> None:
        """
        Command a velocity again and again from now on, through the link; None ends it.

        For two sources at once, or other times, use :class:`Sender`.
        """
        if self._sender is not None:
            self._sender.end()
            self._sender = None
        if ahead_m_s is not None:
            self._sender = Sender(self.socket, topic, ahead_m_s, turning_rad_s, rate_hz)

    def send_command(self, line: str) -> str:
        """
        Have something happen to a device or to the world, such as ``laser silent 3``.

        :raises ConfigError: it cannot happen.
        """
        return send_command(self._hardware, line)

    # ---- the truth -----------------------------------------------------------------------------

    def _poll(self) -> bool:
        path = self._hardware / 'track'
        if not path.exists():
            return False
        with path.open() as track:
            track.seek(self._offset if self.track else 0)
            text = track.read()
        *lines, rest = text.split('\n')
        self._offset = (self._offset if self.track else 0) + len(text) - len(rest)
        for line in lines:
            at, x, y, yaw, ahead, turning, impact, contacts = line.split()
            self.track.append(Truth(
                int(at), float(x), float(y), float(yaw), float(ahead), float(turning),
                float(impact), int(contacts), WALL_X_M - float(x) - self._radius_m))
        return True

    @property
    def now(self) -> Truth:
        """Return what is true now, at most some 20 ms old."""
        self._poll()
        return self.track[-1]

    def since(self, at_ns: int) -> list[Truth]:
        """Return the truth from a time on."""
        self._poll()
        return [each for each in self.track if each.at_ns >= at_ns]

    def until(self, condition: Callable[[Truth], Any], what: str,
              patience_s: float = PATIENCE_S) -> Truth:
        """Wait for something to be true of the robot; return the first truth of which it is."""
        wait(lambda: condition(self.now), what, lambda: f'{self.now}', patience_s)
        return self.now

    def until_rest(self, patience_s: float = PATIENCE_S) -> Truth:
        """Wait until it has stood for half a second; return the last truth of its way."""
        def stands() -> bool:
            now = self.now
            recent = self.since(now.at_ns - round(_STANDING_S * 1e9))
            return len(recent) > 10 and not any(each.is_moving for each in recent)

        wait(stands, 'standstill', lambda: f'{self.now}', patience_s)
        return next((each for each in reversed(self.track) if each.is_moving), self.track[0])

    def close(self) -> None:
        """End all processes and remove the folder; may be called twice."""
        self.drive(None)
        if self._client is not None:
            with suppress(OSError):
                os.kill(self.core_pid, signal.SIGCONT)
            self._client.close()
            self._client = None
        for name in ('node', 'core', 'hardware'):
            process = self._processes.pop(name, None)
            if process is None:
                continue
            process.terminate()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


class Sender:
    """
    A source of commands: a thread with a connection of its own to the core.

    It goes on when the core does not read, as a program would that knows nothing of it.

    :ivar last_ns: when the last command was handed over, on CLOCK_MONOTONIC.
    :ivar sent: commands that were handed over.
    """

    def __init__(self, socket: Path, topic: str, ahead_m_s: float, turning_rad_s: float = 0.0,
                 rate_hz: float = COMMAND_HZ) -> None:
        self.last_ns = self.sent = 0
        self._twist = twist(ahead_m_s, turning_rad_s)
        self._client = LinkClient(socket, 'sender', timeout_s=0.2)
        self._channel = self._client.advertise(topic)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(1.0 / rate_hz,), daemon=True)
        self._thread.start()

    def _run(self, period_s: float) -> None:
        while not self._ended.wait(period_s):
            with suppress(LinkError, OSError):
                self._client.pump(0.0)
                self._client.publish(self._channel, self._twist)
                self.last_ns = time.monotonic_ns()
                self.sent += 1

    def end(self) -> None:
        """Send no more; may be called twice."""
        self._ended.set()
        self._thread.join(5.0)
        self._client.close()


def twist(ahead_m_s: float, turning_rad_s: float = 0.0) -> bytes:
    """Return a geometry_msgs/msg/Twist in CDR."""
    return struct.pack('<4B6d', 0, 1, 0, 0, ahead_m_s, 0.0, 0.0, 0.0, 0.0, turning_rad_s)


def wait(condition: Callable[[], Any], what: str, tell: Callable[[], str] = str,
         patience_s: float = PATIENCE_S) -> None:
    """
    Wait until something is true.

    :raises RuntimeError: it does not come, with what there is to tell.
    """
    end_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > end_s:
            raise RuntimeError(f'{what} did not come within {patience_s:g} s\n{tell()[-3000:]}')
        time.sleep(0.005)


# ---- configuration and world --------------------------------------------------------------------


def _configuration(board: str, whole: bool, realtime: bool,
                   changes: dict[str, dict[str, Any]], modules: tuple[str, ...]
                   ) -> dict[str, Any]:
    """Return the parameters of the robot, with simulated devices."""
    parameters: dict[str, Any] = yaml.safe_load(SHIPPED.read_text())['/**/robot'][
        'ros__parameters']
    shipped = parameters['base']
    parameters['base'] = {'type': board, **{key: shipped[key] for key in _COMMON},
                          **BOARDS[board]}
    if whole:
        # A camera is another process, and no part of what is attacked.
        parameters['devices'].remove('camera')
        parameters['mirrors'].remove('image')
        for each in ('stargazer', 'planner', 'alarms', 'vital_signs', 'surroundings', 'network'):
            for key, value in parameters[each].items():
                if isinstance(value, str) and value.startswith('maps/'):
                    parameters[each][key] = str(SHIPPED.parent / value)
        parameters['odometry'].update({key: BOARDS[board][key] for key in (
            'wheel_radius_m', 'wheel_separation_m')})
        if BOARDS[board].get('battery_pin', -1) < 0 and board == 'arduino_bridge':
            parameters['mirrors'].remove('battery')
    else:
        for kind, names in _CHAIN.items():
            parameters[kind] = list(names)
        parameters['topics'].append('cmd_vel_trajectory')
        parameters['cmd_vel_trajectory'] = _TWIST
    parameters['modules'] = [*parameters['modules'], *modules]
    parameters['core'] = ({'cpu': -1, 'scheduler_priority': 80} if realtime
                          else {'cpu': -2, 'scheduler_priority': 0})
    parameters.pop('world')
    listed = {name for kind in _CHAIN for name in parameters[kind]}
    for name in [each for each in parameters if isinstance(parameters[each], dict)]:
        if name not in listed and name not in _PARTS:
            del parameters[name]
    for section, values in changes.items():
        parameters.setdefault(section, {}).update(values)
    return parameters


def _write(path: Path, parameters: dict[str, Any]) -> None:
    path.write_text(yaml.safe_dump({'/**/robot': {'ros__parameters': parameters}}))


def _room(path: Path) -> Path:
    """Draw a room whose far wall is at :data:`WALL_X_M`."""
    margin = round(0.5 / _RESOLUTION_M)
    columns = round(WALL_X_M / _RESOLUTION_M)
    rows = round(2 * HALF_WIDTH_M / _RESOLUTION_M)
    cells = np.full((rows + 2 * margin, columns + 2 * margin), 100, np.int8)
    cells[margin:-margin, margin:-margin] = 0
    GridMap(cells, _RESOLUTION_M, (-0.5, -HALF_WIDTH_M - 0.5, 0.0)).save(path)
    return path


def stopping(track: list[Truth]) -> tuple[float, float]:
    """
    Return how long and how far a robot went on.

    :param track: from the attack on.
    :return: in s and m, until its last movement.
    """
    moving = [each for each in track if each.is_moving]
    if not moving:
        return 0.0, 0.0
    way_m = sum(math.dist(before[1:3], after[1:3]) for before, after in zip(track, track[1:]))
    return (moving[-1].at_ns - track[0].at_ns) / 1e9, way_m

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

"""Start the program `robot` as a user does, and listen for its first message."""

# mypy: allow-untyped-calls

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time
from typing import Any

from benchmarks.shared.memory import descendants
from benchmarks.shared.memory import proportional_bytes
from benchmarks.shared.memory import resident_bytes
import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link import LinkClient
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.linux.process import end_child
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.topics.resolve import message_class

TOPIC = '/imu/data'
_CORE = 'rt_robot_os.core.program'
_FIRST_TIMEOUT_S = 30.0
_SETTLE_S = 2.0
_END_S = 10.0
_LOOK_S = 0.5
_TRY_S = 0.01
# Ends with us even when nobody can tell it to.
_PROGRAM = ('import signal, sys; from rt_robot_os.linux.process import die_with_parent; '
            'die_with_parent({parent}, signal.SIGTERM); '
            'from rt_robot_os.ros.program import main; sys.exit(main())')


class FirstSample:
    """
    A thread that waits for the first sample of a topic at the link of a core that is starting.

    :ivar at_ns: when it came; 0 before.
    """

    def __init__(self, path: Path) -> None:
        self.at_ns = 0
        self._path = path
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; may be called twice."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        while not (self._stopping.is_set() or self.at_ns):
            try:
                with LinkClient(self._path, 'bench') as link:
                    link.on_data = self._note
                    link.mirror(TOPIC.lstrip('/'))
                    while not (self._stopping.is_set() or self.at_ns):
                        link.pump(_LOOK_S)
            except LinkError:
                self._stopping.wait(_TRY_S)

    def _note(self, head: object, cdr: object) -> None:
        if not self.at_ns:
            self.at_ns = time.monotonic_ns()


def robot(harness: Harness) -> Measurement:
    """
    Start the robot with its default configuration: simulated devices.

    :return: how long until the first sample in the core and the first message, and the resident
        sizes of core and node: after two seconds of running, and for ``watch_ns`` from there.
    """
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    listener = Node('bench_listener', start_parameter_services=False, enable_rosout=False)
    executor = SingleThreadedExecutor()
    executor.add_node(listener)
    first: list[int] = []

    def note(message: Any) -> None:
        if not first:
            first.append(time.monotonic_ns())

    listener.create_subscription(
        message_class(IMU), TOPIC, note, qos_profile_sensor_data, raw=True)
    sample = FirstSample(socket_path())
    begin_ns = time.monotonic_ns()
    process = subprocess.Popen([sys.executable, '-c', _PROGRAM.format(parent=os.getpid())])
    try:
        deadline = time.monotonic() + _FIRST_TIMEOUT_S
        while not first:
            executor.spin_once(timeout_sec=_LOOK_S)
            if process.poll() is not None:
                raise RuntimeError(f'robot ended with code {process.returncode}')
            if time.monotonic() > deadline:
                raise RuntimeError(f'nothing came on {TOPIC} within {_FIRST_TIMEOUT_S:g} s')
        sample.stop()
        listener.destroy_node()  # what it would receive from here on is not measured
        time.sleep(_SETTLE_S)
        samples, figures = _watch(process.pid, harness.arguments['watch_ns'])
    finally:
        sample.stop()
        end_child(process, _END_S, signal.SIGINT)
        rclpy.try_shutdown()
    if sample.at_ns:
        figures['first_sample_ns'] = sample.at_ns - begin_ns
    figures['first_message_ns'] = first[0] - begin_ns
    return Measurement(samples, figures)


def _watch(robot_pid: int, watch_ns: int) -> tuple[dict[str, Any], dict[str, float]]:
    cores = [pid for pid, command in descendants(robot_pid).items() if _CORE in command]
    if not cores:
        raise RuntimeError('the robot has no core')
    sizes, moments = [resident_bytes(cores[0])], [time.monotonic_ns()]
    figures: dict[str, float] = {
        'core_resident': sizes[0], 'node_resident': resident_bytes(robot_pid)}
    try:
        figures['core_proportional'] = proportional_bytes(cores[0])
    except OSError:
        pass  # not told on this kernel
    end_ns = time.monotonic_ns() + watch_ns
    while time.monotonic_ns() < end_ns:
        time.sleep(min(_LOOK_S, watch_ns / NS_PER_S))
        sizes.append(resident_bytes(cores[0]))
        moments.append(time.monotonic_ns())
    return {'core_resident': np.array(sizes, np.int64),
            'moments': np.array(moments, np.int64)}, figures

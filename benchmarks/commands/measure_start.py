#!/usr/bin/env python3
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
Measure how long a robot takes from its start to its first message in ROS 2.

    ./scripts/bench measure_start      # the shipped robot
    ./scripts/bench measure_start config/service_robot.yaml
    ./scripts/bench measure_start --tree ../before --tree .  # two trees, in turns
    ./scripts/bench measure_start --help-of-all      # `--help` of all programs

A subscriber runs before the robot starts, so its own start does not count. The devices are
simulated. The variants (trees and builds) take turns; one start of each before the first counts
for nothing. The result is the median of each column, and the least and the greatest total.

checked     the settings are read and checked (the line that says what is simulated)
process     the core's process is started (to 10 ms)
active      the first device delivers: its first sample is in the core
connected   the node says that it is connected to the core
message     the first message of a mirrored topic is with the subscriber
all         that of the last of these topics which get a message within --patience seconds
CPU         seconds of all processes of the robot up to ``message``, and of node and core alone
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
import os
from pathlib import Path
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any
from typing import IO

# Imported, it begins this process anew where ROS comes from wheels.
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from rt_robot_os.ros.conversions import is_lacking
from rt_robot_os.ros.conversions import ros_class
from rt_robot_os.settings.load import load_from_arguments
from rt_robot_os.settings.mirror_types import ros_type
from rt_robot_os.settings.names import full_topic

ROOT = Path(__file__).resolve().parents[2]
BUILDS = {'pure': '0', 'compiled': '1'}
CONNECTED = re.compile(r'connected to the core \(pid (\d+)\)')
ACTIVE = re.compile(r'(\S+) INFO \S+: active$', re.MULTILINE)
CHECKED = 'robot: simulated: '
START_PATIENCE_S = 60.0
NS_PER_S = 1_000_000_000
COLUMNS = ('checked', 'process', 'active', 'connected', 'message', 'all')
CPU_COLUMNS = ('CPU', 'node CPU', 'core CPU')


def cpu_s(pid: int) -> float:
    """Return the processor time of a process so far (its CLOCK_PROCESS_CPUTIME_ID)."""
    try:
        return time.clock_gettime(((~pid) << 3) | 2)
    except OSError:  # it has ended
        return 0.0


def descendants(pid: int) -> list[int]:
    """Return a process and all that it has started, and those have."""
    found = [pid]
    for parent in found:
        for path in Path(f'/proc/{parent}/task').glob('*/children'):
            try:
                found += map(int, path.read_text().split())
            except OSError:
                pass
    return found


def started_s(pid: int) -> float:
    """Return when a process was started, on CLOCK_MONOTONIC."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    boot_s = int(fields[19]) / os.sysconf('SC_CLK_TCK')
    return boot_s - time.clock_gettime(time.CLOCK_BOOTTIME) + time.monotonic()


class Listener:
    """A node that waits for the first message of each topic."""

    def __init__(self, topics: dict[str, Any]) -> None:
        self.first_s: dict[str, float] = {}
        self._node = rclpy.create_node('measure_start')
        self._subscriptions = [self._subscribe(topic, kind) for topic, kind in topics.items()]
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def _subscribe(self, topic: str, kind: Any) -> Any:
        def note(_: bytes) -> None:
            self.first_s.setdefault(topic, time.monotonic())

        return self._node.create_subscription(kind, topic, note, qos_profile_sensor_data, raw=True)

    def clear(self) -> None:
        """Forget what has come, and what comes of a robot that has ended."""
        deadline_s = time.monotonic() + 0.5
        while time.monotonic() < deadline_s:
            self._executor.spin_once(0.05)
        self.first_s.clear()

    def wait(self, count: int, patience_s: float) -> bool:
        """Return whether that many topics have a message."""
        deadline_s = time.monotonic() + patience_s
        while len(self.first_s) < count and time.monotonic() < deadline_s:
            self._executor.spin_once(0.1)
        return len(self.first_s) >= count


class Output(threading.Thread):
    """Reads what a robot prints, and notes when."""

    def __init__(self, stream: IO[str]) -> None:
        super().__init__(daemon=True)
        self.lines: list[tuple[float, str]] = []
        self._stream = stream
        self.start()

    def run(self) -> None:
        for line in self._stream:
            self.lines.append((time.monotonic(), line))

    def find(self, what: str | re.Pattern[str]) -> tuple[float, re.Match[str]] | None:
        """Return the first line that has it, and when it came."""
        found = ((at_s, re.search(what, line)) for at_s, line in list(self.lines))
        return next(((at_s, match) for at_s, match in found if match), None)


@contextmanager
def robot_of(tree: Path, build: str, arguments: list[str], before: list[str]
             ) -> Iterator[tuple[subprocess.Popen[str], Output, Path]]:
    """Start a robot, and end it."""
    with tempfile.TemporaryDirectory(prefix='start-') as name:
        folder = Path(name)
        environment = {
            **os.environ, 'PYTHONPATH': str(tree), 'RT_ROBOT_OS_COMPILE': BUILDS[build],
            'RT_ROBOT_OS_RUNTIME_DIR': name, 'ROS_LOG_DIR': str(folder / 'log')}
        # What `ros2 run` has, and not what this process has got by being started.
        for variable in ('_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'LD_LIBRARY_PATH'):
            if '_ROS_WHEELS_BOOTSTRAP_COMPLETE' in os.environ:
                environment.pop(variable, None)
        process = subprocess.Popen(
            [*before, sys.executable, '-m', 'rt_robot_os.ros.program', *arguments],
            cwd=tree, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert process.stdout is not None
        output = Output(process.stdout)
        try:
            yield process, output, folder / 'log'
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(20)
            output.join()


def one_start(listener: Listener, tree: Path, build: str, arguments: list[str],
              before: list[str], topics: int, patience_s: float) -> dict[str, float]:
    """
    Start a robot once.

    :return: milliseconds by column, and seconds of processor time.
    :raises SystemExit: no message came.
    """
    listener.clear()
    began_s, wall_offset_s = time.monotonic(), time.time() - time.monotonic()
    with robot_of(tree, build, arguments, before) as (process, output, log):
        if not listener.wait(1, START_PATIENCE_S):
            raise SystemExit('no message came:\n' + ''.join(line for _, line in output.lines))
        used = {pid: cpu_s(pid) for pid in descendants(process.pid)}
        times = {'message': min(listener.first_s.values())}
        listener.wait(topics, patience_s)
        times['all'] = max(listener.first_s.values())
        if checked := output.find(CHECKED):
            times['checked'] = checked[0]
        deadline_s = time.monotonic() + START_PATIENCE_S
        while (core := output.find(CONNECTED)) is None:  # its console may be later
            if time.monotonic() > deadline_s:
                raise SystemExit('the robot does not say that it is connected')
            time.sleep(0.01)
        times['connected'], pid = core[0], int(core[1][1])
        times['process'] = started_s(pid)
        told = [datetime.fromisoformat(each).timestamp() - wall_offset_s
                for path in log.glob('*.log') for each in ACTIVE.findall(path.read_text())]
        if told:
            times['active'] = min(told)
    return {**{name: 1000 * (at_s - began_s) for name, at_s in times.items()},
            'CPU': sum(used.values()), 'node CPU': used[process.pid], 'core CPU': used.get(pid, 0)}


def measure(arguments: argparse.Namespace) -> None:
    """Start all variants in turns, and print the medians."""
    words = ['--simulate', *(str(path.resolve()) for path in arguments.files)]
    settings, ros = load_from_arguments(words, True, arguments.files)
    topics = {full_topic(each.ros_topic, ros.namespace, ros.node_name): ros_class(each)
              for each in settings.mirrors
              if each.direction == 'out' and not is_lacking(ros_type(each))}
    before = ['chrt', '--rr', '1'] if arguments.first else []
    if arguments.first:  # this one, too, with the threads of its DDS
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(2))
    rclpy.init()
    listener = Listener(topics)
    variants = [(tree.resolve(), build) for tree in arguments.tree or [ROOT]
                for build in arguments.build or BUILDS]
    results: dict[tuple[Path, str], list[dict[str, float]]] = {each: [] for each in variants}
    load = os.getloadavg()[0]
    for count in range(arguments.runs + 1):
        for variant in variants:
            result = one_start(listener, *variant, words, before, len(topics),
                               arguments.patience)
            if count:
                results[variant].append(result)
    print(f'medians of {arguments.runs} starts in turns; ms from the start of the program, CPU in '
          f's; {os.cpu_count()} CPUs, load {load:.1f} before and {os.getloadavg()[0]:.1f} after'
          f'{", SCHED_RR" if arguments.first else ""}')
    print(f'{"":26}' + ''.join(f'{name:>11}' for name in (*COLUMNS, *CPU_COLUMNS)) +
          '  message, least to greatest')
    for (tree, build), rows in results.items():
        def middle(name: str) -> float:
            return statistics.median(row.get(name, float('nan')) for row in rows)

        messages = [row['message'] for row in rows]
        print(f'{tree.name[:16]:16} {build:9}' +
              ''.join(f'{middle(name):11.0f}' for name in COLUMNS) +
              ''.join(f'{middle(name):11.2f}' for name in CPU_COLUMNS) +
              f'  {min(messages):.0f} to {max(messages):.0f}')


def programs() -> dict[str, str]:
    """Return the modules of all programs of the package, by name."""
    found = re.findall(r"'([a-z0-9_]+) = ([\w.]+):main'", (ROOT / 'setup.py').read_text())
    return dict(found)


def measure_help(arguments: argparse.Namespace) -> None:
    """Print the median processor time of ``--help`` of each program, by tree."""
    trees = [tree.resolve() for tree in arguments.tree or [ROOT]]
    used: dict[tuple[str, Path], list[float]] = {}
    for _ in range(arguments.runs):
        for name, module in programs().items():
            for tree in trees:
                before = os.times()
                subprocess.run([sys.executable, '-m', module, '--help'], check=True, cwd=tree,
                               env={**os.environ, 'PYTHONPATH': str(tree)},
                               stdout=subprocess.DEVNULL)
                after = os.times()
                used.setdefault((name, tree), []).append(
                    after.children_user + after.children_system
                    - before.children_user - before.children_system)
    print(f'processor time of `--help` in ms, medians of {arguments.runs}')
    for name in programs():
        print(f'{name:12}' + ''.join(f'{1000 * statistics.median(used[name, tree]):8.0f}'
                                     for tree in trees))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('files', metavar='FILE', nargs='*', type=Path, default=[],
                        help='parameter files; none for the shipped robot')
    parser.add_argument('--tree', action='append', type=Path, help='a tree; may be repeated')
    parser.add_argument('--build', action='append', choices=BUILDS, help='by default both')
    parser.add_argument('--runs', type=int, default=5)
    parser.add_argument('--patience', type=float, default=1.0, metavar='S')
    parser.add_argument('--first', action='store_true', help='the robots run before all ordinary '
                        'processes (SCHED_RR), for a machine that is busy; as root')
    parser.add_argument('--help-of-all', action='store_true')
    arguments = parser.parse_args()
    if arguments.help_of_all:
        measure_help(arguments)
    else:
        measure(arguments)


if __name__ == '__main__':
    main()

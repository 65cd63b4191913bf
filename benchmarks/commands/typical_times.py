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
Measure what the shipped drivers and modules take, and write rt_robot_os/tools/plan/typical.json.

    ./scripts/bench typical_times [--seconds 20] [--runs 5] [CONFIG.yaml ...]

Run it on a quiet machine, with the right to SCHED_FIFO; it takes a quarter of an hour. It runs the
real core of each shipped configuration that needs no hardware; what is given as CONFIG is
measured besides. A time in the table is the 99.9th percentile of the run that was disturbed least,
times FACTOR: what others compute, on this machine or on one that shares it, only ever makes jobs
longer. Of link/service it is the median: it is released by each sample, and its longest jobs
answer requests. Modules have more to do while the robot drives, so it drives as well: to somebody
who has pressed her button, and exploring with `mapping` beside it; the dearer of both counts.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable
from collections.abc import Mapping
from contextlib import ExitStack
import json
import math
import os
from pathlib import Path
import platform
import subprocess
import sys
import tempfile
import threading

from rt_robot_os.core.simulators import device_folder
from rt_robot_os.kernel import TaskStatistics
from rt_robot_os.link import LinkClient
from rt_robot_os.linux.folders import RUNTIME_VARIABLE
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.messages.cdr import string_message
from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.settings import load
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
from rt_robot_os.sim.commands import send_command
from rt_robot_os.tools.plan.measure import measure
from rt_robot_os.tools.plan.measured import Measured
from rt_robot_os.tools.plan.typical import FORMAT
from rt_robot_os.tools.plan.typical import PATH
from rt_robot_os.tools.plan.wiring import Wiring

CONFIG = Path(__file__).resolve().parents[2] / 'config'
FACTOR = 2.0
CONNECTIONS_HZ = 1.0
ACCEPT_US = 500.0
# How often bytes release a motor board for each sample: an answer that comes in a dozen pieces
# costs little more than one that comes at once.
BOARD_ARRIVALS = {'arduino_bridge': 1.0, 'kobuki': 1.0, 'odrive': 2.0, 'roboclaw': 1.0}
HELP_AFTER_S = 3.0
EXPLORE_AFTER_S = 6.0
DRIVES_S = 40.0

REALTIME = {'core.scheduler_priority': 95}

Times = dict[tuple[str, str], float]
Begun = Callable[[ExitStack, Path], object]


def usual_ns(task: TaskStatistics) -> int:
    """Give the time that counts of a task."""
    # Its longest jobs answer requests, once a second; a release by a sample costs far less.
    return task.execution.p50_ns if task.name == 'link/service' else task.execution.p999_ns


def measured(settings: RobotSettings, seconds: float, begun: Begun | None = None) -> Measured:
    """Run the core of a robot once."""
    with tempfile.TemporaryDirectory(prefix='rtt') as folder, ExitStack() as stack:
        os.environ[RUNTIME_VARIABLE] = folder
        path = socket_path()
        return measure(settings, CoreProcess(to_json(settings), path), path, seconds,
                       lambda text: print(f'  {text}', file=sys.stderr), usual_ns,
                       None if begun is None else lambda: begun(stack, path))


def somebody_needs_help(stack: ExitStack, path: Path) -> None:
    """Have her press her button in a while."""
    later(stack, HELP_AFTER_S, lambda: send_command(device_folder(path), 'world press anna help'))


def it_explores(stack: ExitStack, path: Path) -> None:
    """Map beside the core, and explore."""
    mapping = subprocess.Popen(
        [sys.executable, '-m', 'rt_robot_os.features.mapping.cli.program', '--ros-args',
         '--params-file', CONFIG / 'service_robot.yaml', '--params-file', CONFIG / 'mapping.yaml'],
        stdout=subprocess.DEVNULL)
    stack.callback(mapping.wait)
    stack.callback(mapping.terminate)

    def explore() -> None:
        with LinkClient(path, 'typical_times') as client:
            client.publish(client.advertise('mapping/command'), string_message('explore'))

    later(stack, EXPLORE_AFTER_S, explore)


def later(stack: ExitStack, seconds: float, do: Callable[[], object]) -> None:
    """Do something beside the measurement."""
    timer = threading.Timer(seconds, do)
    stack.callback(timer.join)
    timer.start()


DRIVES: Mapping[tuple[str, ...], Begun] = {
    ('assisted_living',): somebody_needs_help, ('service_robot', 'mapping'): it_explores}


def note_drives(runs: int, seconds: float, times: Times) -> None:
    """Measure the modules of robots that drive; the dearer counts."""
    for names, begun in DRIVES.items():
        settings = load([CONFIG / f'{name}.yaml' for name in names], REALTIME)
        found: dict[tuple[str, str], list[float]] = defaultdict(list)
        for run in range(runs):
            print(f'{" and ".join(names)}, driving, run {run + 1} of {runs}', file=sys.stderr)
            note(settings, measured(settings, seconds, begun), found)
        for key, values in found.items():
            if key[0] == 'module':
                times[key] = max(times.get(key, 0.0), min(values))


def note(settings: RobotSettings, found: Measured,
         times: dict[tuple[str, str], list[float]]) -> None:
    """Sort the times of one run by kind."""
    seconds, wiring = found.elapsed_ns / 1e9, Wiring(settings)
    kinds = {device.name: ('driver', device.type) for device in settings.devices}
    kinds |= {f'{device.name}/arrival': ('arrival', device.type) for device in settings.devices}
    kinds |= {module.name: ('module', module.type) for module in settings.modules}
    for name, task in found.tasks.items():
        if name.removesuffix('/arrival') in found.idle:
            raise SystemExit(f'{name}: {found.idle[name.removesuffix("/arrival")]}')
        if task.runs:
            times[kinds.get(name, ('core', name))].append(task.execution_ns / 1000)
    for device in settings.devices:
        samples_hz = wiring.samples_hz(device.name)
        times['samples', device.type].append(max(1.0, samples_hz / device.rate_hz))
        arrival = found.tasks.get(f'{device.name}/arrival')
        times['arrivals', device.type].append(BOARD_ARRIVALS.get(
            device.type, arrival.releases / seconds / samples_hz) if arrival else 0.0)


def rounded(value: float) -> float:
    """Round up to two digits."""
    step = 10 ** (math.floor(math.log10(value)) - 1)
    return float(f'{math.ceil(value / step - 1e-9) * step:.6g}')


def table(times: Times, source: str) -> dict[str, object]:
    """Make what the file holds."""
    def us(kind: str) -> dict[str, float]:
        return {name: rounded(FACTOR * value)
                for (its, name), value in sorted(times.items()) if its == kind and value}

    arrivals = us('arrival')
    drivers = {name: {'execution_us': time_us, 'arrival_us': arrivals.get(name, 0.0),
                      'samples': round(times['samples', name], 2),
                      'arrivals': round(times['arrivals', name], 2)}
               for name, time_us in us('driver').items()}
    core = {'link/accept': ACCEPT_US, **us('core')}
    return {'format': FORMAT, 'source': source, 'drivers': drivers, 'modules': us('module'),
            'core': core, 'connections_hz': CONNECTIONS_HZ}


def main() -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--seconds', type=float, default=20.0)
    parser.add_argument('--runs', type=int, default=5)
    parser.add_argument('--machine', default='a virtual machine with two x86-64 CPUs')
    parser.add_argument('more', nargs='*', type=Path)
    arguments = parser.parse_args()
    times: Times = {}
    # The link costs the more the more there is to mirror: of each task the dearest robot counts.
    paths = [CONFIG / f'{name}.yaml' for name in ('robot', 'all_devices', 'camera',
                                                  'service_robot', 'assisted_living')]
    per_robot: list[dict[tuple[str, str], list[float]]] = []
    for path in (*paths, *arguments.more):
        settings = load([path], REALTIME)
        per_robot.append(defaultdict(list))
        for run in range(arguments.runs):
            print(f'{path.name}, run {run + 1} of {arguments.runs}', file=sys.stderr)
            note(settings, measured(settings, arguments.seconds), per_robot[-1])
    for found in per_robot:
        for key, values in found.items():
            dearer = max if key[0] == 'core' else min
            least = min(values)
            times[key] = dearer(times.get(key, least), least)
    note_drives(arguments.runs, max(DRIVES_S, arguments.seconds), times)
    source = (f'{arguments.machine}, Python {platform.python_version()}, '
              f'{FACTOR:g} times the 99.9th percentile in the best of '
              f'{arguments.runs} runs of {arguments.seconds:g} s, on simulated devices')
    if os.getloadavg()[0] > 1.0:
        source += ', others computing beside them'
    PATH.write_text(json.dumps(table(times, source), indent=1) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())

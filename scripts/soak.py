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
Run a whole robot for long, under device faults, and check that nothing leaks, stops or goes uncounted.

    PYTHONPATH=. python3 scripts/soak.py [--minutes 60] [--faults 2700] [--seed 1]

The robot is `config/all_devices.yaml` with random faults on every device (their number, kinds and
times follow from the seed). Every few seconds the statistics of the core are taken and checked:
each release and each mirrored sample is accounted for, the same core is still there, it has one
thread. At the end every device must be active again, and memory and descriptors as in the
beginning. The exit code is 0 when all of it held.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
import json
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client import CoreStatistics
from rt_robot_os.link.client import LinkClient
from rt_robot_os.sim.faults import FAULTS
from rt_robot_os.sim.faults import I2C_FAULTS
import yaml

ROOT = Path(__file__).resolve().parents[1]
I2C_TYPES = ('mpu6050', 'bmp280', 'bmp388', 'ms5611')
EVENTS_A_DEVICE = 250
QUIET_S = 45.0          # without new faults, before the end: long enough for the longest back-off
SAMPLE_EVERY_S = 5.0
GROWTH_ALLOWED = 0.05
START_S = 30.0


@dataclass
class Sample:
    """What the processes used at a moment."""

    at_s: float
    core_kb: int
    node_kb: int
    core_descriptors: int
    node_descriptors: int
    core_threads: int


@dataclass
class Findings:
    """What was seen; ``problems`` is empty when all held."""

    faults: int = 0
    samples: list[Sample] = field(default_factory=list)
    cores: list[int] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    def add(self, problem: str) -> None:
        """Note a problem, each once and at most a hundred."""
        if problem not in self.problems and len(self.problems) < 100:
            self.problems.append(problem)
            print(f'PROBLEM: {problem}', flush=True)


def schedule(kinds: list[str], count: int, until_s: float, rng: random.Random) -> list[str]:
    """Give ``count`` faults at random moments, none longer than eight seconds."""
    moments = sorted(rng.uniform(5.0, max(6.0, until_s - 8.0)) for _ in range(count))
    return [f'{rng.choice(kinds)} at {at_s:.2f} for {rng.uniform(0.1, 8.0):.2f}'
            for at_s in moments]


def configuration(source: Path, faults: int, duration_s: float, seed: int) -> tuple[str, int]:
    """
    Give the robot's YAML with faults on each simulated device.

    :return: the text, and how many faults there are.
    """
    tree: dict[str, Any] = yaml.safe_load(source.read_text())
    parameters = next(iter(tree.values()))['ros__parameters']
    devices = [name for name in parameters['devices'] if parameters[name].get('port') == 'sim']
    each = min(EVENTS_A_DEVICE, max(1, faults // max(1, len(devices))))
    rng = random.Random(seed)
    for name in devices:
        kinds = I2C_FAULTS if parameters[name]['type'] in I2C_TYPES else FAULTS
        simulated = parameters[name].setdefault('sim', {})
        simulated['faults'] = schedule(list(kinds), each, duration_s - QUIET_S, rng)
        simulated['seed'] = rng.randrange(1 << 16)
    return yaml.safe_dump(tree, default_flow_style=None, width=1000), each * len(devices)


def resident_kb(pid: int) -> int:
    """Give the resident memory of a process."""
    for line in Path(f'/proc/{pid}/status').read_text().splitlines():
        if line.startswith('VmRSS'):
            return int(line.split()[1])
    return 0


def descriptors(pid: int) -> int:
    """Count the open descriptors of a process."""
    return len(os.listdir(f'/proc/{pid}/fd'))


def threads(pid: int) -> int:
    """Count the threads of a process."""
    return len(os.listdir(f'/proc/{pid}/task'))


def unaccounted(statistics: CoreStatistics) -> Iterator[str]:
    """Tell every release and every mirrored sample that is neither here nor there."""
    for task in statistics.tasks:
        open_jobs = task.releases - task.runs - task.missed - task.coalesced
        if not 0 <= open_jobs <= 2:
            yield (f'task {task.name}: {task.releases} releases, but {task.runs} runs, '
                   f'{task.missed} missed, {task.coalesced} coalesced')
    for client in statistics.clients:
        for mirror in client.get('mirrors', ()):
            parts = [mirror[key] for key in (
                'sent', 'full', 'lost', 'skipped', 'limited', 'waiting')]
            if sum(parts) != mirror['published']:
                yield f'mirror of {mirror["topic"]} to {client["name"]}: {mirror}'


class Robot:
    """The node and its core, as `ros2 run` starts them."""

    def __init__(self, folder: Path, config: Path) -> None:
        self.log = folder / 'robot.log'
        code = 'import sys; from rt_robot_os.ros.program import main; sys.exit(main())'
        environment = {
            **os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(folder / 'run'),
            'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')]),
            'ROS_LOG_DIR': str(folder / 'log'),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(random.SystemRandom().randint(1, 101))}
        self.socket = folder / 'run' / 'robot.sock'
        self._output = self.log.open('wb')
        self.process = subprocess.Popen(
            [sys.executable, '-c', code, '--ros-args', '--params-file', str(config)],
            env=environment, stdout=self._output, stderr=subprocess.STDOUT)

    def connect(self, timeout_s: float) -> LinkClient | None:
        """Connect to the core that runs now; None when none does within the time."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline and self.process.poll() is None:
            try:
                return LinkClient(self.socket, 'soak')
            except LinkError:
                time.sleep(0.2)
        return None

    def end(self) -> int:
        """Press Ctrl-C and wait."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(30.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()
        finally:
            self._output.close()


def watch(robot: Robot, duration_s: float, findings: Findings) -> CoreStatistics | None:
    """Look at the robot until the time is over; give the last statistics."""
    began = time.monotonic()
    client: LinkClient | None = None
    statistics: CoreStatistics | None = None
    while (passed_s := time.monotonic() - began) < duration_s:
        if robot.process.poll() is not None:
            findings.add(f'the robot ended by itself with {robot.process.returncode}')
            return None
        try:
            if client is None:
                client = robot.connect(START_S)
                if client is None:
                    findings.add(f'no core answered at {passed_s:.0f} s')
                    continue
                findings.cores.append(int(client.core['pid']))
            statistics = client.statistics()
        except LinkError as error:
            findings.add(f'at {passed_s:.0f} s the core was lost: {error}')
            if client is not None:
                client.close()
            client = None
            continue
        for problem in unaccounted(statistics):
            findings.add(problem)
        core, node = findings.cores[-1], robot.process.pid
        findings.samples.append(Sample(
            passed_s, resident_kb(core), resident_kb(node), descriptors(core),
            descriptors(node), threads(core)))
        if len(findings.samples) % 12 == 1:
            print(f'{passed_s:6.0f} s  {describe(findings.samples[-1], statistics)}', flush=True)
        client.pump(0.0)
        time.sleep(SAMPLE_EVERY_S)
    if client is not None:
        client.close()
    return statistics


def describe(sample: Sample, statistics: CoreStatistics) -> str:
    """Give a line for a person."""
    faults = sum(int(device['faults']) for device in statistics.devices)
    missed = sum(task.missed for task in statistics.tasks)
    return (f'core {sample.core_kb} KB, {sample.core_descriptors} descriptors; '
            f'node {sample.node_kb} KB, {sample.node_descriptors} descriptors; '
            f'devices faulted {faults} times, {missed} releases missed')


def judge(findings: Findings, last: CoreStatistics | None, code: int) -> None:
    """Say what does not hold at the end."""
    if code != 0:
        findings.add(f'the robot ended with exit code {code} after Ctrl-C')
    if len(set(findings.cores)) > 1:
        findings.add(f'the core was restarted: {findings.cores}')
    for device in last.devices if last is not None else ():
        if device['state'] != 'active':
            findings.add(f'device {device["name"]} is {device["state"]} at the end: '
                         f'{device["reason"]}')
    settled = findings.samples[len(findings.samples) // 5:]
    for name in ('core_kb', 'node_kb'):
        half = len(settled) // 2
        if half < 3:
            continue
        before = sorted(getattr(s, name) for s in settled[:half])[half // 2]
        after = sorted(getattr(s, name) for s in settled[half:])[half // 2]
        if after > before * (1 + GROWTH_ALLOWED):
            findings.add(f'{name} grew from {before} to {after} (medians of the two halves)')
    if findings.samples and max(s.core_threads for s in findings.samples) > 1:
        findings.add('the core had more than one thread')


def main() -> int:
    """Run it; the exit code says whether all held."""
    parser = argparse.ArgumentParser(description='Run a robot for long under device faults.')
    parser.add_argument('--minutes', type=float, default=60.0)
    parser.add_argument('--faults', type=int, default=2700, help='at most 250 a device')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--config', type=Path, default=ROOT / 'config' / 'all_devices.yaml')
    parser.add_argument('--json', type=Path, help='where the findings are written')
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # the robot must not outlive this
    duration_s = options.minutes * 60.0
    findings = Findings()
    with tempfile.TemporaryDirectory(prefix='soak') as name:
        folder = Path(name)
        (folder / 'run').mkdir(mode=0o700)
        text, findings.faults = configuration(
            options.config, options.faults, duration_s, options.seed)
        config = folder / 'soak.yaml'
        config.write_text(text)
        robot = Robot(folder, config)
        try:
            last = watch(robot, duration_s, findings)
        finally:
            code = robot.end()
        judge(findings, last, code)
        log = robot.log.read_text(errors='replace')
    report = {'faults': findings.faults, 'cores': findings.cores, 'problems': findings.problems,
              'first': vars(findings.samples[0]) if findings.samples else None,
              'last': vars(findings.samples[-1]) if findings.samples else None,
              'samples': len(findings.samples)}
    print(json.dumps(report, indent=2))
    if findings.problems:
        print(log[-20000:])
    if options.json:
        options.json.write_text(json.dumps({**report, 'log': log}, indent=1))
    return 1 if findings.problems else 0


if __name__ == '__main__':
    sys.exit(main())

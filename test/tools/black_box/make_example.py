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
Record ``example.rtbb.gz``: a real run of 40 ms in which much goes wrong on purpose.

Run it by hand where SCHED_FIFO is allowed: ``python3 test/tools/black_box/make_example.py``.
"""

from __future__ import annotations

import os
from pathlib import Path
import random

from rt_robot_os.core.dumps.dump_parts import parts
from rt_robot_os.kernel import BlackBoxDump
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux import realtime
from rt_robot_os.tools.black_box import write_parts
from rt_robot_os.topics import Bus

FILE = Path(__file__).with_name('example.rtbb.gz')
US, MS = 1_000, 1_000_000
_NUMBERS = random.Random(7).sample(range(20_000), 20_000)


class Example:
    """Tasks that preempt, block, overspend and fail."""

    def __init__(self) -> None:
        self.kernel = kernel = Kernel()
        self.bus = Bus(kernel)
        self.map = kernel.resource('map')
        self.spend = kernel.clock.spend
        self.receiver, self.sender = os.pipe2(os.O_NONBLOCK)
        for topic in ('imu/data', 'cmd_vel'):
            self.bus.declare(topic, 'geometry_msgs/msg/Vector3')
        self.imu, self.command = self.bus.publisher('imu/data'), self.bus.publisher('cmd_vel')
        uart = kernel.add_task('uart', self.receive, priority=90)
        kernel.add_interrupt(self.receiver, uart)
        kernel.add_task('imu', self.measure, priority=80, rate_hz=500.0)
        kernel.add_task('control', self.control, priority=60, rate_hz=250.0, phase_ns=250 * US,
                        deadline_ns=2 * MS, resources=[self.map])
        kernel.add_task('mapping', self.draw, priority=40, rate_hz=100.0, phase_ns=1200 * US,
                        resources=[self.map])
        kernel.add_task('planner', self.plan, priority=20, rate_hz=50.0, phase_ns=500 * US)
        kernel.add_task('vision', self.look, priority=10, rate_hz=25.0, phase_ns=22 * MS,
                        budget_ns=4 * MS, on_budget=BudgetPolicy.ABORT)
        kernel.add_task('logger', self.log, priority=5, rate_hz=25.0, phase_ns=30 * MS)

    def receive(self) -> None:
        os.read(self.receiver, 100)
        self.spend(60 * US)

    def measure(self) -> None:
        self.spend(180 * US)
        self.imu.publish()

    def control(self) -> None:
        self.spend(250 * US)
        with self.map:
            self.spend(100 * US)
        self.command.publish()

    def draw(self) -> None:
        self.spend(300 * US)
        with self.map:
            self.spend(700 * US)
        self.spend(400 * US)

    def plan(self) -> None:
        self.spend(2 * MS)
        os.write(self.sender, b'?')
        self.spend(800 * US)
        sorted(_NUMBERS)  # a native call: nothing preempts it
        self.spend(2500 * US)

    def look(self) -> None:
        while True:
            self.spend(100 * US)

    def log(self) -> None:
        self.kernel.black_box.mark(self.kernel.now_ns(), 'disk is full')
        self.spend(1200 * US)
        raise OSError('no space left')

    def run(self) -> BlackBoxDump:
        self.kernel.run(36 * MS)
        return self.kernel.black_box_dump("task 'logger': OSError: no space left")


def main() -> None:
    """Record it."""
    example = Example()
    for result in (realtime.set_affinity(-1), realtime.freeze_garbage(), realtime.set_fifo(80)):
        print(result)
    dump = example.run()
    size = write_parts(parts(dump, {'robot': 'example'}), FILE)
    print(f'{FILE}: {len(dump.records)} records, {size} bytes')


if __name__ == '__main__':
    main()

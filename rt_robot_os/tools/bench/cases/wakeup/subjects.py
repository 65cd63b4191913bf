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

"""How late an idle process wakes up: the kernel, a bare loop, and cyclictest."""

from __future__ import annotations

from collections.abc import Mapping
import inspect
import os
import re
import shutil
import subprocess
import time
from typing import Any

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.cases.preemption.subjects import sleep_loop
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.harness import Unavailable
from rt_robot_os.tools.bench.stamps import Stamps

_PATH = os.pathsep.join((os.environ.get('PATH', os.defpath), '/usr/sbin', '/usr/local/bin'))
_REMEDY = 'cyclictest is not installed (remedy: apt-get install rt-tests)'
_LINE = re.compile(rb'^ *\d+: *\d+: *(\d+)', re.MULTILINE)


def make_kernel(**options: Any) -> Kernel:
    """
    Make a kernel with options that older versions do not have.

    :raises Unavailable: this version has not got one of them.
    """
    known = inspect.signature(Kernel).parameters
    for name in options:
        if name not in known:
            raise Unavailable(f'this version of the kernel has no option {name}')
    return Kernel(**options)


def kernel(harness: Harness) -> Measurement:
    """Run one periodic task and nothing else; ``spin_ns`` wakes earlier and spins."""
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    stamps = Stamps(2 * total_ns // a['period_ns'] + 1000)
    tested = make_kernel(spin_ns=a['spin_ns']) if a['spin_ns'] else Kernel()
    tested.add_task('fast', stamps.stamp, priority=50, rate_hz=NS_PER_S / a['period_ns'])
    harness.prepare(freeze=True)
    if a['dma_latency_us'] >= 0:
        with _power(a['dma_latency_us']):
            return _run(tested, stamps, a)
    return _run(tested, stamps, a)


def _run(tested: Kernel, stamps: Stamps, a: Mapping[str, Any]) -> Measurement:
    cpu_ns = time.process_time_ns()
    total_ns = a['warmup_ns'] + a['measure_ns']
    tested.run(total_ns)
    used_ns = time.process_time_ns() - cpu_ns
    return _late(stamps.taken(), tested.start_ns, a, 100.0 * used_ns / total_ns)


def _power(latency_us: int) -> Any:
    """Keep the CPU out of deep idle states while the file is open."""
    try:
        device = open('/dev/cpu_dma_latency', 'wb', buffering=0)
        device.write(latency_us.to_bytes(4, 'little'))
    except OSError as error:
        raise Unavailable(f'/dev/cpu_dma_latency: {error.strerror}') from error
    return device


def floor(harness: Harness) -> Measurement:
    """Loop on ``clock_nanosleep``."""
    a = harness.arguments
    harness.prepare(freeze=True)
    cpu_ns = time.process_time_ns()
    total_ns = a['warmup_ns'] + a['measure_ns']
    starts, phase_ns = sleep_loop(a['period_ns'], total_ns)
    return _late(starts, phase_ns, a, 100.0 * (time.process_time_ns() - cpu_ns) / total_ns)


def _late(starts: Samples, phase_ns: int, a: Mapping[str, Any], cpu_percent: float) -> Measurement:
    period_ns = a['period_ns']
    late = (starts - phase_ns) % period_ns
    return Measurement({'late_ns': late[starts >= phase_ns + a['warmup_ns']]},
                       {'cpu_percent': cpu_percent})


def cyclictest(harness: Harness) -> Measurement:
    """
    Run cyclictest with the same period, CPU and priority, in C.

    :raises Unavailable: it is not installed, or not permitted.
    """
    a = harness.arguments
    program = shutil.which('cyclictest', path=_PATH)
    if program is None:
        raise Unavailable(_REMEDY)
    period_us = a['period_ns'] // NS_PER_US
    loops = (a['warmup_ns'] + a['measure_ns']) // a['period_ns']
    # --default-system: leave the idle states alone, as the others do.
    words = [program, '-m', '-N', '-v', '-p', str(harness.priority), '-i', str(period_us),
             '-a', str(harness.own_cpu), '-t', '1', '-l', str(loops)]
    for more in (['--default-system'], []):
        ended = subprocess.run([*words, *more], capture_output=True, check=False)
        late = np.array([int(value) for value in _LINE.findall(ended.stdout)], np.int64)
        if len(late):
            return Measurement({'late_ns': late[a['warmup_ns'] // a['period_ns']:]})
    said = (ended.stderr or ended.stdout).decode(errors='replace').strip().splitlines()
    raise Unavailable(f'cyclictest gave no samples: {said[0] if said else "no output"}')


def spin(harness: Harness) -> Measurement:
    """Sleep until ``spin_ns`` before each moment of a grid, and wait awake for it."""
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    stamps = Stamps(2 * total_ns // a['period_ns'] + 1000)
    sleep_until_ns, now_ns, stamp = Sleeper().sleep_until_ns, time.monotonic_ns, stamps.stamp
    harness.prepare(freeze=True)
    phase_ns, used_ns = now_ns() + a['period_ns'], time.process_time_ns()
    due_ns, end_ns = phase_ns, phase_ns + total_ns
    while due_ns <= end_ns:
        sleep_until_ns(due_ns - a['spin_ns'])
        while now_ns() < due_ns:
            pass
        stamp()
        due_ns += a['period_ns'] * (1 + max(0, now_ns() - due_ns) // a['period_ns'])
    late = (stamps.taken() - phase_ns) % a['period_ns']
    return Measurement({'late_ns': late[a['warmup_ns'] // a['period_ns']:]}, {
        'cpu_percent': 100.0 * (time.process_time_ns() - used_ns) / total_ns})

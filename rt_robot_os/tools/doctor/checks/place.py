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

"""Where this Linux runs: on a machine, in a virtual one, in a container."""

from __future__ import annotations

from collections.abc import Iterator

from rt_robot_os.tools.doctor.facts import container
from rt_robot_os.tools.doctor.facts import core_cpu
from rt_robot_os.tools.doctor.facts import is_wsl
from rt_robot_os.tools.doctor.facts import own_status
from rt_robot_os.tools.doctor.facts import virtual_machine
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.system import System

# The share of the time that a hypervisor may take away before it shows in a 1 kHz loop.
_STEAL_LIMIT = 0.001


def virtual(system: System) -> Iterator[Finding]:
    """Look for a hypervisor."""
    machine = virtual_machine(system)
    if not machine:
        yield ok('not virtual, as far as can be seen')
        return
    note = ('use a real Linux for real time' if is_wsl(system) else
            'on the host: give each virtual CPU a real one (virsh vcpupin ...), or run on a real '
            'machine')
    yield warn(machine, Remedy((), note), weight=20)


def steal(system: System) -> Iterator[Finding]:
    """Look how much time the hypervisor took from the core's CPU since boot."""
    if not virtual_machine(system):
        yield absent('not a virtual machine')
        return
    cpu = core_cpu(system)
    wanted = 'cpu' if cpu is None else f'cpu{cpu}'
    for line in system.text('/proc/stat').splitlines():
        words = line.split()
        if words and words[0] == wanted and len(words) > 8:
            ticks = [int(word) for word in words[1:9]]
            share = ticks[7] / max(1, sum(ticks))
            text = f'{100 * share:.2g} % of the time of {wanted} since boot'
            if share > _STEAL_LIMIT:
                yield warn(text, Remedy((), 'fewer virtual CPUs than real ones on the host, and '
                                        'pinned'), weight=30)
            else:
                yield ok(text)
            return
    yield unknown(f'/proc/stat has no line {wanted!r}')


def in_container(system: System) -> Iterator[Finding]:
    """Look for a container."""
    kind = container(system)
    if not kind:
        left = system.exists('/.dockerenv')
        yield ok('no' + (' (/.dockerenv is there, but / is a disk: a machine made from an image)'
                         if left else ''))
        return
    status = own_status(system)
    seccomp = ', seccomp filter' if status.get('Seccomp', '0') == '2' else ''
    yield ok(f'{kind}{seccomp}; what concerns the kernel has to be mended on the host')


def _own_groups(system: System) -> Iterator[tuple[str, str]]:
    """Yield the folder of this cgroup and of those above it, and the version of its interface."""
    for line in system.read('/proc/self/cgroup').splitlines():
        words = line.split(':', 2)
        if len(words) != 3:
            continue
        if words[1] == '':
            mounts, version = ('/sys/fs/cgroup', '/sys/fs/cgroup/unified'), '2'
        elif 'cpu' in words[1].split(','):
            mounts, version = ('/sys/fs/cgroup/cpu', '/sys/fs/cgroup/cpu,cpuacct'), '1'
        else:
            continue
        group = words[2].rstrip('/')
        while True:
            for mount in mounts:
                yield f'{mount}{group}', version
            if not group:
                break
            group = group.rpartition('/')[0]


def _quota(system: System, folder: str, version: str) -> tuple[int, int] | None:
    """Return quota and period of a cgroup in microseconds; None for none."""
    if version == '2':
        words = system.read(f'{folder}/cpu.max').split()
    else:
        words = [system.read(f'{folder}/cpu.cfs_quota_us'),
                 system.read(f'{folder}/cpu.cfs_period_us')]
    if len(words) == 2 and words[0].isdigit() and words[1].isdigit():
        return int(words[0]), int(words[1])
    return None


def quota(system: System) -> Iterator[Finding]:
    """Look for a limit to the CPU time of this group of processes."""
    tightest: tuple[float, str] | None = None
    for folder, version in _own_groups(system):
        found = _quota(system, folder, version)
        if found and (tightest is None or found[0] / found[1] < tightest[0]):
            tightest = found[0] / found[1], f'{found[0]} of {found[1]} us in {folder}'
    if tightest is None:
        yield ok('no limit')
        return
    kind = container(system)
    if kind in ('docker', 'podman'):
        remedy = Remedy((f'{kind} update --cpus "$(nproc)" CONTAINER',),
                        'on the host; or start it without --cpus')
    elif kind == 'kubernetes':
        remedy = Remedy((), 'in the pod: requests of whole CPUs equal to its limits')
    else:
        remedy = Remedy(('systemctl show --property=CPUQuotaPerSecUSec UNIT',),
                        'and take CPUQuota= out of that unit')
    yield warn(f'{tightest[0]:g} CPUs: {tightest[1]}', remedy,
               weight=45 if tightest[0] >= 1 else 65)


CHECKS = (
    Check('place.virtual', 'virtual machine',
          'the host runs other things on the same CPU, and Linux in here cannot prevent it',
          virtual),
    Check('place.steal', 'stolen time', 'while the time is stolen nothing in here runs', steal),
    Check('place.container', 'container',
          'a container shares the kernel of its host and has fewer rights', in_container),
    Check('place.quota', 'CPU quota',
          'a process that has used up its quota waits for the next period; only SCHED_FIFO tasks '
          'are exempt', quota),
)

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

"""Facts that several checks need, read from the files of a system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
import gzip
import re
from typing import Any

from rt_robot_os.tools.doctor.system import System

CAP_IPC_LOCK = 14
CAP_SYS_NICE = 23
UNLIMITED = 1 << 63
CPU = '/sys/devices/system/cpu'


def key_values(text: str) -> dict[str, str]:
    """Read lines of ``key: value``; the first of several counts."""
    found: dict[str, str] = {}
    for line in text.splitlines():
        key, colon, value = line.partition(':')
        if colon:
            found.setdefault(key.strip(), value.strip())
    return found


def cpu_list(text: str) -> list[int]:
    """
    Read a list of CPUs, such as ``0-2,5``; empty for what is none.

    Linux writes ``(null)`` or nothing for no CPU at all.
    """
    found: set[int] = set()
    for part in text.strip().split(','):
        match = re.fullmatch(r'\s*(\d{1,5})(?:-(\d{1,5}))?\s*', part)
        if match:
            first = int(match[1])
            found.update(range(first, int(match[2] or first) + 1))
    return sorted(found)


def cpu_text(cpus: list[int]) -> str:
    """Write a list of CPUs as Linux does: ``0-2,5``."""
    parts: list[str] = []
    first = 0
    for index, cpu in enumerate(cpus):
        if index + 1 == len(cpus) or cpus[index + 1] != cpu + 1:
            parts.append(str(cpu) if first == index else f'{cpus[first]}-{cpu}')
            first = index + 1
    return ','.join(parts)


def online_cpus(system: System) -> list[int]:
    """Return the CPUs that run."""
    listed = cpu_list(system.read(f'{CPU}/online'))
    if listed:
        return listed
    numbers = re.findall(r'^processor\s*:\s*(\d+)', system.read('/proc/cpuinfo'), re.MULTILINE)
    return [int(number) for number in numbers]


def allowed_cpus(system: System) -> list[int]:
    """Return the CPUs that this process may use."""
    return cpu_list(own_status(system).get('Cpus_allowed_list', '')) or online_cpus(system)


def core_cpu(system: System) -> int | None:
    """Return the CPU that the core would be on; None when it asks for none or a missing one."""
    asked, online = asked_cpu(system), online_cpus(system)
    return asked if asked in online or not online else None


def asked_cpu(system: System) -> int | None:
    """Return the CPU that the core would ask for; None when it asks for none."""
    wanted = system.wanted.cpu
    if wanted == -2:
        return None
    if wanted >= 0:
        return wanted
    allowed = allowed_cpus(system)
    return allowed[-1] if allowed else None


def try_scheduler(system: System) -> Mapping[str, Any]:
    """
    Let a child ask Linux for what the core would ask.

    :raises ProbeError: it did not answer.
    """
    cpu = asked_cpu(system)
    return system.probe('scheduler', system.wanted.priority, -2 if cpu is None else cpu)


def own_status(system: System) -> dict[str, str]:
    """Read the facts of this process from Linux."""
    return key_values(system.read('/proc/self/status'))


def has_capability(system: System, number: int) -> bool:
    """Return whether this process has a capability."""
    try:
        return bool(int(own_status(system)['CapEff'], 16) >> number & 1)
    except (KeyError, ValueError):
        return False


def limit(system: System, title: str) -> int | None:
    """
    Return a soft resource limit.

    :param title: as in ``/proc/self/limits``, such as ``Max locked memory``.
    :return: UNLIMITED for none; None when it cannot be read.
    """
    for line in system.read('/proc/self/limits').splitlines():
        if line.startswith(title):
            soft = line[len(title):].split()[0]
            return UNLIMITED if soft == 'unlimited' else int(soft)
    return None


def command_line(system: System) -> dict[str, str]:
    """Read the parameters that Linux was started with; the last of several counts."""
    found: dict[str, str] = {}
    for word in system.read('/proc/cmdline').split():
        key, _, value = word.partition('=')
        found[key] = value
    return found


def kernel_release(system: System) -> tuple[int, int]:
    """Return the two first numbers of the kernel's version; zeros when it has none."""
    match = re.match(r'(\d+)\.(\d+)', system.release)
    return (int(match[1]), int(match[2])) if match else (0, 0)


def distribution(system: System) -> str:
    """Return the short name of the Linux distribution, such as ``ubuntu``; empty when unknown."""
    for line in system.read('/etc/os-release').splitlines():
        if line.startswith('ID='):
            return line[3:].strip('"\'').lower()
    return ''


def kernel_config(system: System) -> dict[str, str]:
    """Read the configuration that Linux was built with; empty when it is not to be had."""
    try:
        text = gzip.decompress(system.raw('/proc/config.gz')).decode(errors='replace')
    except (OSError, EOFError):
        text = system.read(f'/boot/config-{system.release}')
    return dict(line.split('=', 1) for line in text.splitlines()
                if line.startswith('CONFIG_') and '=' in line)


@dataclass(frozen=True)
class Process:
    """
    A process that runs.

    :ivar arguments: its command line; empty for threads of the kernel.
    """

    pid: int
    name: str
    arguments: tuple[str, ...]


def processes(system: System) -> list[Process]:
    """List all processes that can be seen, but the doctor's own."""
    found = []
    for name in system.names('/proc'):
        if not name.isdigit() or int(name) in system.own_pids:
            continue
        comm = system.read(f'/proc/{name}/comm')
        if comm:
            words = system.read(f'/proc/{name}/cmdline').split('\0')
            found.append(Process(int(name), comm, tuple(filter(None, words))))
    return found


def running(system: System, *names: str) -> str:
    """
    Find a process by one of its names.

    :param names: in full; Linux stores fifteen characters of them.
    :return: the first that runs; empty when none does.
    """
    present = {one.name for one in processes(system)}
    return next((name for name in names if name[:15] in present), '')


@cache
def _patterns() -> tuple[tuple[str, re.Pattern[str]], ...]:
    return (('kubernetes', re.compile(r'kubepods')), ('docker', re.compile(r'docker')),
            ('podman', re.compile(r'libpod')), ('lxc', re.compile(r'/lxc|lxc\.payload')))


def container(system: System) -> str:
    """
    Return which kind of container this is; empty when it is none.

    A mark alone may be left over in a machine that was made from an image: a machine with a disk
    as its root is no container.
    """
    groups = system.read('/proc/self/cgroup')
    for kind, pattern in _patterns():
        if pattern.search(groups):
            return kind
    for line in system.read('/proc/self/mountinfo').splitlines():
        words = line.split()
        if len(words) > 6 and words[4] == '/' and '-' in words:
            source = words[words.index('-') + 2]
            if words[3] == '/' and source.startswith('/dev/'):
                return ''
    if system.exists('/run/.containerenv'):
        return 'podman'
    if system.exists('/.dockerenv'):
        return 'docker'
    return system.read('/run/systemd/container')


def is_wsl(system: System) -> bool:
    """Return whether Windows runs this Linux."""
    return 'microsoft' in system.release.lower()


def virtual_machine(system: System) -> str:
    """Return which virtual machine this is; empty when it seems to be a real one."""
    if is_wsl(system):
        return 'WSL2'
    flags = key_values(system.read('/proc/cpuinfo')).get('flags', '').split()
    model = ' '.join(filter(None, (system.read('/sys/class/dmi/id/sys_vendor'),
                                   system.read('/sys/class/dmi/id/product_name'))))
    xen = system.read('/sys/hypervisor/type')
    compatible = system.read('/proc/device-tree/hypervisor/compatible').replace('\0', ' ')
    if 'hypervisor' in flags or xen or compatible or re.search(
            r'QEMU|KVM|VMware|VirtualBox|Virtual Machine', model):
        return model or xen or compatible or 'hypervisor flag of the CPU'
    return ''

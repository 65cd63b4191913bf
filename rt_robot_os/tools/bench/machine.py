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

"""What was measured on: the figures mean nothing without it."""

from __future__ import annotations

from importlib import metadata
import os
from pathlib import Path
import platform
from typing import Any

from rt_robot_os.base.compiled import state

_PACKAGES = ('rt-robot-os', 'numpy', 'ros-rclpy', 'ros-rmw-fastrtps-cpp', 'ros-fastrtps',
             'horus-robotics', 'matplotlib')
_DISTRO = 'jazzy'
# What became of a step of the real-time set-up that Linux granted.
IN_FORCE = 'in force'
_ROS = ('rclpy', 'rmw_fastrtps_cpp', 'fastrtps', 'rt_robot_os')


def _read(path: str) -> str:
    try:
        return Path(path).read_text().strip()
    except (OSError, UnicodeDecodeError):
        return ''


def _cpu_lines() -> dict[str, str]:
    """Return the first processor's entries of /proc/cpuinfo, and those of the board."""
    found: dict[str, str] = {}
    for line in _read('/proc/cpuinfo').splitlines():
        key, colon, value = line.partition(':')
        if colon:
            found.setdefault(key.strip(), value.strip())
    return found


def cpu_model() -> str:
    """Name the processor."""
    lines = _cpu_lines()
    return (lines.get('model name') or lines.get('Model') or _read('/proc/device-tree/model')
            .strip('\0') or platform.processor() or platform.machine())


def preemption_model(version: str) -> str:
    """
    Find how Linux itself can be preempted.

    :param version: what ``uname -v`` says.
    """
    words = version.split()
    model = next((word for word in words if word.startswith('PREEMPT')), 'no PREEMPT in its name')
    if model == 'PREEMPT_DYNAMIC':
        modes = _read('/sys/kernel/debug/sched/preempt')
        chosen = next((m.strip('()') for m in modes.split() if m.startswith('(')), '')
        return f'{model} ({chosen})' if chosen else model
    return model


def virtual() -> str:
    """Return what the machine runs in; empty when it seems to be a real one."""
    if 'hypervisor' in _cpu_lines().get('flags', '').split():
        vendor = _read('/sys/class/dmi/id/sys_vendor')
        return f'virtual machine ({vendor})' if vendor else 'virtual machine'
    if Path('/sys/hypervisor/type').exists():
        return f'virtual machine ({_read("/sys/hypervisor/type")})'
    return ''


def _container() -> bool:
    return any(Path(mark).exists() for mark in ('/.dockerenv', '/run/.containerenv'))


def packages() -> dict[str, str]:
    """Return the versions of what is measured, as far as it is installed."""
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    for name in _ROS:
        for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
            text = _read(f'{prefix}/share/{name}/package.xml') if prefix else ''
            if '<version>' in text:
                found.setdefault(name, text.partition('<version>')[2].partition('<')[0].strip())
    return found


def describe() -> dict[str, Any]:
    """Describe the machine in plain values."""
    names = os.uname()
    allowed = sorted(os.sched_getaffinity(0))
    build = state()
    return {
        'build': build.text, 'compiled': build.compiled,
        'cpu': cpu_model(), 'architecture': names.machine, 'cores': os.cpu_count(),
        'cores_allowed': allowed, 'isolated': _read('/sys/devices/system/cpu/isolated'),
        'work_queue_cpus': _read('/sys/devices/virtual/workqueue/cpumask'),
        'governor': _read('/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor'),
        'clock_source': _read('/sys/devices/system/clocksource/clocksource0/current_clocksource'),
        'kernel': names.release, 'kernel_version': names.version,
        'preemption': preemption_model(names.version), 'virtual': virtual(),
        'container': _container(), 'load_average': list(os.getloadavg()),
        'python': platform.python_version(), 'packages': packages(),
        'rmw': os.environ.get('RMW_IMPLEMENTATION', ''),
        'ros_distro': os.environ.get('ROS_DISTRO', ''),
    }


def summary(machine: dict[str, Any]) -> list[str]:
    """Return the same as lines to read."""
    place = machine['virtual'] or 'not virtual'
    if machine['container']:
        place += ', container'
    # What an earlier version has measured does not say it.
    build = [f'rt_robot_os: {machine["build"]}'] if 'build' in machine else []
    return [
        f'{machine["cpu"]}, {machine["cores"]} cores ({len(machine["cores_allowed"])} allowed), '
        f'{place}',
        f'Linux {machine["kernel"]} {machine["preemption"]}, Python {machine["python"]}'
        + ''.join(f', {name} {version}' for name, version in machine['packages'].items()
                  if name in ('numpy', 'ros-rclpy', 'rclpy')),
        *build,
        'load average ' + ' '.join(f'{load:.2f}' for load in machine['load_average'])]


def warnings(machine: dict[str, Any]) -> list[str]:
    """Return what makes the figures doubtful."""
    lines = []
    cores = len(machine['cores_allowed'])
    if cores == 1:
        lines.append('One core only: what runs beside the measured process disturbs it.')
    if machine['load_average'][0] > cores / 2:
        lines.append('The machine is busy with other work, which is in the figures as well.')
    if machine['ros_distro'] not in ('', _DISTRO):
        lines.append(f'ROS_DISTRO is {machine["ros_distro"]!r}, this package is made for '
                     f'{_DISTRO}: what rclpy of that distribution has not got is left out. '
                     f'Remedy: a shell in which ROS 2 {_DISTRO} or none is sourced.')
    return lines

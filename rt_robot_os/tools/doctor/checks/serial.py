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

"""Serial ports and I2C buses: permissions, other processes that use them, delays of bytes."""

from __future__ import annotations

from collections.abc import Iterator
import os
import re

from rt_robot_os.tools.doctor.facts import container
from rt_robot_os.tools.doctor.facts import running
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.remedies import in_group
from rt_robot_os.tools.doctor.remedies import not_yet_in_group
from rt_robot_os.tools.doctor.remedies import of_machine
from rt_robot_os.tools.doctor.remedies import user_word
from rt_robot_os.tools.doctor.system import System

_PATTERNS = ('/dev/ttyUSB*', '/dev/ttyACM*')
_LATENCY_LIMIT_MS = 1
_CH340 = '1a86'


def _ports(system: System) -> list[str]:
    """Return the ports of adapters, and those that the configuration names."""
    wanted = list(system.wanted.ports)
    same = {os.path.basename(_target(system, port)) for port in wanted}
    return wanted + [path for pattern in _PATTERNS for path in system.glob(pattern)
                     if os.path.basename(path) not in same]


def _target(system: System, port: str) -> str:
    """Follow a link such as those of by-id; anything else is returned unchanged."""
    try:
        return os.readlink(system.path(port))
    except OSError:
        return port


def _by_id(system: System, port: str) -> str:
    """Return the name of a port that stays the same when it is plugged in elsewhere."""
    for path in system.glob('/dev/serial/by-id/*'):
        if path != port and os.path.basename(_target(system, path)) == os.path.basename(port):
            return path
    return ''


def permission(system: System) -> Iterator[Finding]:
    """Look at each port whether this user may open it; none is opened."""
    if not _ports(system):
        yield absent('no serial adapter is plugged in')
        return
    for port in _ports(system):
        if not system.exists(port):
            yield warn(f'{port} is not there, but in {system.wanted.source}',
                       _missing(system, port), subject=port, weight=60)
        elif system.may(port, os.R_OK | os.W_OK):
            stable = _by_id(system, port)
            yield ok(f'{port} may be opened' + (f'; write it as {stable}' if stable else ''),
                     subject=port)
        else:
            yield _forbidden(system, port)


def _missing(system: System, port: str) -> Remedy:
    if container(system):
        return Remedy((), 'give it to the container: --device ' + port)
    if not _is_i2c(port):
        return Remedy((), 'plug it in; ls /dev/serial/by-id shows the names')
    if system.exists('/boot/firmware/config.txt'):
        return Remedy(("echo 'dtparam=i2c_arm=on' | sudo tee -a /boot/firmware/config.txt",
                       'sudo modprobe i2c-dev && sudo reboot'))
    return Remedy(('sudo modprobe i2c-dev && ls /dev/i2c-*',))


def _is_i2c(port: str) -> bool:
    return os.path.basename(port).startswith('i2c-')


def _forbidden(system: System, port: str) -> Finding:
    group = system.group_of(port) or 'dialout'
    text = f'{port} may not be opened by {system.user}: it belongs to the group {group}'
    if container(system):
        remedy = Remedy((), f'start the container with --device {port} --group-add {group}')
    elif in_group(system, group) and not_yet_in_group(system, group):
        remedy = Remedy((), f'you have joined {group} already: log out and in again')
    else:
        remedy = Remedy((f'sudo usermod -aG {group} {user_word(system)}',),
                        f'then log out and in again, or for this shell: newgrp {group}')
    return warn(text, remedy, subject=port, weight=70)


def grabbers(system: System) -> Iterator[Finding]:
    """Look for daemons that open serial ports by themselves."""
    if all(map(_is_i2c, _ports(system))):
        yield absent('no serial adapter is plugged in')
        return
    clean = True
    if running(system, 'ModemManager'):
        clean = False
        yield warn('ModemManager runs and speaks to new ports for some seconds', of_machine(
            system, 'sudo systemctl disable --now ModemManager',
            note='unless a mobile network modem is used'), subject='ModemManager', weight=40)
    if running(system, 'brltty'):
        clean = False
        adapters = ' (CH340 among them)' if _has_ch340(system) else ''
        yield warn(f'brltty runs and takes adapters for Braille displays{adapters}', of_machine(
            system, 'sudo apt remove brltty', note='unless a Braille display is used'),
            subject='brltty', weight=45)
    if clean:
        yield ok('neither ModemManager nor brltty runs')


def _has_ch340(system: System) -> bool:
    return any(system.read(path) == _CH340
               for path in system.glob('/sys/bus/usb/devices/*/idVendor'))


def latency(system: System) -> Iterator[Finding]:
    """Look how long FTDI adapters collect bytes."""
    found = False
    for path in system.glob('/sys/bus/usb-serial/devices/*/latency_timer'):
        text = system.read(path)
        name = re.sub(r'.*/(\w+)/latency_timer', r'\1', path)
        if not text.isdigit():
            continue
        found = True
        if int(text) <= _LATENCY_LIMIT_MS:
            yield ok(f'{name}: {text} ms', subject=f'/dev/{name}')
            continue
        rule = 'SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
        yield warn(f'{name} holds bytes for up to {text} ms', of_machine(
            system, f"echo '{rule}' |", '  sudo tee /etc/udev/rules.d/99-ftdi-latency.rules',
            'sudo udevadm control --reload', f'echo 1 | sudo tee {path}'),
            subject=f'/dev/{name}', weight=45)
    if not found:
        yield absent('no FTDI adapter is plugged in')


CHECKS = (
    Check('serial.permission', 'port permission',
          'a device whose port may not be opened stays in FAULT', permission),
    Check('serial.grabbers', 'other port users',
          'two programs on one port each get half of the bytes', grabbers),
    Check('serial.latency', 'FTDI latency timer',
          'short frames wait this long in the adapter, and the core sees them in bunches',
          latency),
)

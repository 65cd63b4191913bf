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

"""Remedies that several checks share, and what is reported where they do not apply."""

from __future__ import annotations

from rt_robot_os.tools.doctor.facts import container
from rt_robot_os.tools.doctor.facts import is_wsl
from rt_robot_os.tools.doctor.facts import virtual_machine
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.system import System

PI_COMMAND_LINE = '/boot/firmware/cmdline.txt'
_CAPABILITIES = '--cap-add SYS_NICE --cap-add IPC_LOCK'
_LIMITS = '--ulimit rtprio=98 --ulimit memlock=-1'


def place(system: System) -> str:
    """Return where commands for the machine itself have to be given; empty: right here."""
    if container(system):
        return 'on the host, not in this container'
    return ''


def of_machine(system: System, *commands: str, note: str = '') -> Remedy:
    """Make a remedy that changes the machine: in a container it belongs to the host."""
    return Remedy(commands, '; '.join(filter(None, (place(system), note))))


def at_each_boot(system: System, path: str, value: str, name: str, note: str = '') -> Remedy:
    """
    Make the remedy that writes a value into files of /sys, now and whenever Linux starts.

    :param path: may be a pattern.
    :param name: for the file that does it.
    """
    if is_wsl(system) or not system.exists('/usr/bin/systemd-tmpfiles'):
        return of_machine(system, f'echo {value} | sudo tee {path}',
                          note='; '.join(filter(None, ('until the next boot', note))))
    file = f'/etc/tmpfiles.d/rt-{name}.conf'
    return of_machine(
        system, f"echo 'w {path} - - - - {value}' |", f'  sudo tee {file}',
        f'sudo systemd-tmpfiles --create {file}',
        note='; '.join(filter(None, ('now and at each boot', note))))


def boot_parameters(system: System, parameters: str) -> Remedy:
    """
    Make the remedy that adds parameters to the kernel's command line.

    :param parameters: separated by blanks.
    """
    if container(system):
        return Remedy((), f'on the host, boot with: {parameters}')
    if is_wsl(system):
        return Remedy((), 'on Windows, in %UserProfile%\\.wslconfig under [wsl2]: '
                      f'kernelCommandLine = {parameters}; then: wsl --shutdown')
    if system.exists(PI_COMMAND_LINE):
        return Remedy((f"sudo sed -i '1s/$/ {parameters}/' {PI_COMMAND_LINE}", 'sudo reboot'))
    if not system.exists('/etc/default/grub'):
        return Remedy((), f'there is no GRUB here: add to the kernel command line in your '
                      f'boot loader: {parameters}')
    first = parameters.partition('=')[0].replace('_', '-')
    # Every file of grub.d is read after /etc/default/grub, by a shell.
    return Remedy((
        f"add='{parameters}'",
        'echo "GRUB_CMDLINE_LINUX_DEFAULT=\\"\\$GRUB_CMDLINE_LINUX_DEFAULT $add\\"" |',
        f'  sudo tee /etc/default/grub.d/60-{first}.cfg && sudo update-grub && sudo reboot'))


def realtime_limits(system: System) -> Remedy:
    """Make the remedy for what a user may not do under the present limits."""
    kind = container(system)
    if kind == 'kubernetes':
        return Remedy((), 'in the pod: securityContext.capabilities.add: [SYS_NICE, IPC_LOCK]')
    if kind in ('docker', 'podman'):
        return Remedy((f'{kind} run {_CAPABILITIES} \\', f'  {_LIMITS} ...'),
                      'start the container again like this')
    if kind:
        return Remedy((), f'give the {kind} container CAP_SYS_NICE and CAP_IPC_LOCK on the host')
    if in_group(system, 'realtime') and not_yet_in_group(system, 'realtime'):
        return Remedy((), 'you have joined the group realtime already: log out of all sessions '
                      'and in again, or reboot')
    note = 'then log out of all sessions and in again, or reboot'
    if system.uid == 0:
        note = ('for a user; a root without CAP_SYS_NICE and CAP_IPC_LOCK needs them from '
                'whatever started it')
    return Remedy((
        "printf '@realtime - rtprio 98\\n@realtime - memlock unlimited\\n' |",
        '  sudo tee /etc/security/limits.d/90-realtime.conf',
        f'sudo groupadd -f realtime && sudo usermod -aG realtime {user_word(system)}'), note)


def user_word(system: System) -> str:
    """Return the word of a command line that names this user."""
    return '$SUDO_USER' if system.uid == 0 else '$USER'


def in_group(system: System, name: str) -> bool:
    """Return whether the group file lists this user."""
    for line in system.read('/etc/group').splitlines():
        words = line.split(':')
        if len(words) > 3 and words[0] == name:
            return system.user in words[3].split(',')
    return False


def not_yet_in_group(system: System, name: str) -> bool:
    """Return whether this process began before its user joined the group."""
    for line in system.read('/etc/group').splitlines():
        words = line.split(':')
        if len(words) > 3 and words[0] == name:
            own = system.read('/proc/self/status').partition('Groups:')[2].partition('\n')[0]
            return words[2] not in own.split()
    return False


def no_frequency_scaling(system: System) -> str:
    """Return why the clock of the CPUs cannot be seen; empty when it ought to be."""
    machine = virtual_machine(system)
    return f'none here: the host of this virtual machine ({machine}) sets it' if machine else ''

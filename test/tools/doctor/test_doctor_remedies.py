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

"""What remedies write when they are pasted: run in bash, with a `sudo` that only notes it."""

from __future__ import annotations

from pathlib import Path
import subprocess

import pytest
from recorded import found

from rt_robot_os.tools.doctor import text_report
from rt_robot_os.tools.doctor.style import Style

# sudo tee FILE writes to FILE below $OUT; everything else is noted and not done.
SUDO = """
sudo() {
  if [ "$1" = tee ]; then
    shift
    [ "$1" = -a ] && shift
    cat >"$OUT/written"
    for file in "$@"; do
      mkdir -p "$OUT/$(dirname "$file")"
      cp "$OUT/written" "$OUT/$file"
    done
  else
    echo "$*" >>"$OUT/commands"
  fi
}
"""


def _paste(finding, folder: Path) -> Path:
    """Paste a remedy as it stands on the terminal, indented and with its comments."""
    folder.mkdir()
    script = SUDO + '\n'.join(text_report.remedy_lines(finding.remedy, Style()))
    done = subprocess.run(['bash', '-c', script], capture_output=True, text=True,
                          env={'PATH': '/usr/bin:/bin', 'OUT': str(folder), 'USER': 'ada'})
    assert (done.returncode, done.stderr) == (0, '')
    return folder


@pytest.mark.parametrize('key, parameters', [
    ('kernel.preemption', 'preempt=full'),
    ('isolation.isolated', 'isolcpus=managed_irq,domain,3 nohz_full=3 rcu_nocbs=3')])
def test_boot_parameters_are_added_to_those_of_the_machine(
        key, parameters, machine, tmp_path) -> None:
    folder = _paste(found(machine('laptop'), key)[0], tmp_path / 'out')
    file, = (folder / 'etc/default/grub.d').iterdir()
    assert file.suffix == '.cfg'
    shell = f'GRUB_CMDLINE_LINUX_DEFAULT="quiet splash"; . {file}; ' \
        'echo "$GRUB_CMDLINE_LINUX_DEFAULT"'
    told = subprocess.run(['sh', '-c', shell], capture_output=True, text=True).stdout
    assert told.strip() == f'quiet splash {parameters}'
    assert (folder / 'commands').read_text().split('\n') == ['update-grub', 'reboot', '']


@pytest.mark.parametrize('key, file, content', [
    ('limits.scheduler', 'etc/security/limits.d/90-realtime.conf',
     '@realtime - rtprio 98\n@realtime - memlock unlimited\n'),
    ('limits.signals', 'etc/security/limits.d/91-sigpending.conf', '* - sigpending 126000\n'),
    ('cpu.governor', 'etc/tmpfiles.d/rt-governor.conf',
     'w /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor - - - - performance\n'),
    ('memory.huge_pages', 'etc/tmpfiles.d/rt-hugepages.conf',
     'w /sys/kernel/mm/transparent_hugepage/enabled - - - - madvise\n'),
    ('memory.overcommit', 'etc/sysctl.d/60-overcommit.conf', 'vm.overcommit_memory = 0\n'),
    ('cpu.dma_latency', 'etc/udev/rules.d/99-cpu-dma-latency.rules',
     'KERNEL=="cpu_dma_latency", GROUP="realtime", MODE="0660"\n'),
    ('cpu.idle', 'sys/devices/system/cpu/cpu3/cpuidle/state3/disable', '1\n'),
    ('cpu.siblings', 'sys/devices/system/cpu/cpu2/online', '0\n'),
    ('isolation.interrupts', 'proc/irq/125/smp_affinity_list', '0-2\n'),
    ('isolation.irqbalance', 'etc/default/irqbalance', 'IRQBALANCE_BANNED_CPULIST=3\n')])
def test_files_that_remedies_write(key, file, content, machine, tmp_path) -> None:
    folder = _paste(found(machine('laptop'), key)[0], tmp_path / 'out')
    assert (folder / file).read_text() == content


def test_the_latency_of_an_adapter_is_set_for_good(machine, tmp_path) -> None:
    finding, = found(machine('raspberry_pi'), 'serial.latency')
    folder = _paste(finding, tmp_path / 'out')
    assert (folder / 'etc/udev/rules.d/99-ftdi-latency.rules').read_text() == (
        'SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"\n')
    assert (folder / 'sys/bus/usb-serial/devices/ttyUSB0/latency_timer').read_text() == '1\n'
    assert (folder / 'commands').read_text() == 'udevadm control --reload\n'


def test_the_group_for_real_time_gets_its_user(machine, tmp_path) -> None:
    folder = _paste(found(machine('laptop'), 'limits.scheduler')[0], tmp_path / 'out')
    assert (folder / 'commands').read_text().split('\n') == [
        'groupadd -f realtime', 'usermod -aG realtime ada', '']

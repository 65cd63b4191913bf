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

"""What the doctor says of whole machines, recorded in machines/*.txt."""

from __future__ import annotations

import subprocess

import pytest
from recorded import CHECKS
from recorded import found
from recorded import NAMES

from rt_robot_os.tools.doctor import text_report
from rt_robot_os.tools.doctor.examination import describe
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import Line
from rt_robot_os.tools.doctor.finding import State
from rt_robot_os.tools.doctor.registry import examine
from rt_robot_os.tools.doctor.registry import GROUPS
from rt_robot_os.tools.doctor.report import Report
from rt_robot_os.tools.doctor.report import Verdict
from rt_robot_os.tools.doctor.style import Style

OK, WARN, BAD, UNKNOWN, ABSENT = State.OK, State.WARN, State.BAD, State.UNKNOWN, State.ABSENT

# machine, check, state, words of the line, words of its remedy
EXPECTED = [
    ('raspberry_pi', 'kernel.preemption', OK, 'PREEMPT_RT', ''),
    ('raspberry_pi', 'kernel.throttling', OK, '95 %', ''),
    ('raspberry_pi', 'kernel.fair_server', OK, 'CPU 3: 50 of 1000 ms', ''),
    ('raspberry_pi', 'limits.scheduler', OK, 'SCHED_FIFO 80 on CPU 3: granted', ''),
    ('raspberry_pi', 'limits.memory_lock', OK, 'RLIMIT_MEMLOCK unlimited', ''),
    ('raspberry_pi', 'cpu.governor', OK, 'performance on CPU 0-3', ''),
    ('raspberry_pi', 'isolation.isolated', OK, 'CPU 3 is isolated, no ticks', ''),
    ('raspberry_pi', 'isolation.interrupts', OK, 'no busy one on CPU 3', ''),
    ('raspberry_pi', 'clock.source', OK, 'arch_sys_counter', ''),
    ('raspberry_pi', 'clock.discipline', OK, 'by systemd-timesyncd, to 51 ms', ''),
    ('raspberry_pi', 'place.virtual', OK, 'not virtual', ''),
    ('raspberry_pi', 'place.quota', OK, 'no limit', ''),
    ('raspberry_pi', 'load.rivals', OK, 'none at or above', ''),
    ('raspberry_pi', 'ros.rclpy', OK, '/opt/ros/jazzy', ''),
    ('raspberry_pi', 'ros.package', OK, '/users/pi/ws/install/rt_robot_os', ''),
    ('raspberry_pi', 'serial.permission', OK, 'A50285BI-if00-port0 may be opened', ''),
    ('raspberry_pi', 'serial.latency', WARN, 'ttyUSB0 holds bytes for up to 16 ms', 'ftdi_sio'),
    ('raspberry_pi', 'leftovers.sockets', OK, '1 in use', ''),
    ('laptop', 'kernel.preemption', WARN, 'mode voluntary', 'preempt=full'),
    ('laptop', 'limits.scheduler', WARN, 'RLIMIT_RTPRIO is 0, no CAP_SYS_NICE', 'rtprio 98'),
    ('laptop', 'limits.memory_lock', WARN, 'refused: RLIMIT_MEMLOCK is 1984 MB', 'usermod'),
    ('laptop', 'limits.signals', WARN, '62990 of 63000', 'sigpending 126000'),
    ('laptop', 'place.virtual', OK, 'not virtual', ''),
    ('laptop', 'cpu.governor', WARN, 'powersave on CPU 0-3', 'tmpfiles.d/rt-governor.conf'),
    ('laptop', 'cpu.turbo', OK, 'on', 'no_turbo'),
    ('laptop', 'cpu.idle', WARN, 'CPU 3: C10 (890 us), and 1 more', 'state{2,3}/disable'),
    ('laptop', 'cpu.dma_latency', WARN, 'cannot be written', 'GROUP="realtime"'),
    ('laptop', 'cpu.siblings', WARN, 'CPU 3 shares its execution units with CPU 2', 'cpu2/online'),
    ('laptop', 'cpu.temperature', WARN, 'x86_pkg_temp: 93 C', 'cooling'),
    ('laptop', 'isolation.isolated', WARN, 'CPU 3 is open', 'isolcpus=managed_irq,domain,3'),
    ('laptop', 'isolation.interrupts', WARN, '1 on CPU 3, counted since boot: xhci_hcd 771203',
     'echo 0-2'),
    ('laptop', 'isolation.irqbalance', WARN, 'may move interrupts to CPU 3', 'BANNED_CPULIST=3'),
    ('laptop', 'clock.source', WARN, 'hpet', 'tsc=reliable'),
    ('laptop', 'clock.discipline', WARN, 'not synchronised', 'sudo apt install chrony'),
    ('laptop', 'memory.free', WARN, '117 of 15875 MB', 'ps -eo'),
    ('laptop', 'memory.swap', WARN, '2930 of 4096 MB in use', 'swapoff'),
    ('laptop', 'memory.huge_pages', WARN, 'always', 'madvise'),
    ('laptop', 'memory.overcommit', WARN, 'never (2)', 'vm.overcommit_memory = 0'),
    ('laptop', 'memory.disk', WARN, '312 MB free for /users/ada/.ros/log', 'ROS_LOG_DIR'),
    ('laptop', 'load.average', WARN, '6.40 in the last minute, 4 CPUs', ''),
    ('laptop', 'load.rivals', WARN, 'at or above 80: jackd (FIFO 90, pid 960)', 'chrt'),
    ('laptop', 'python.compiled', WARN, 'pure Python: it was not compiled',
     'sudo apt install python3-dev\ncolcon build'),
    ('laptop', 'python.observers', WARN, 'tracemalloc, PYTHONTRACEMALLOC=1', 'unset'),
    ('laptop', 'python.threads', WARN, '7 besides that of the core (OMP_NUM_THREADS=8)', '=1'),
    ('laptop', 'ros.distribution', BAD, 'humble is sourced as well as jazzy', 'env -i'),
    ('laptop', 'ros.middleware', WARN, 'but rmw_fastrtps_cpp is used', 'ros-jazzy-rmw-cyclonedds'),
    ('laptop', 'ros.package', WARN, 'no prefix', 'source install/setup.bash'),
    ('laptop', 'ros.domain', WARN, '150', 'ROS_DOMAIN_ID=42'),
    ('laptop', 'ros.discovery', WARN, 'ROS_LOCALHOST_ONLY=1 is deprecated', 'RANGE=LOCALHOST'),
    ('laptop', 'serial.permission', WARN, '/dev/ttyUSB0 may not be opened by ada',
     'joined dialout'),
    ('laptop', 'serial.permission', WARN, '/dev/ttyUSB7 is not there', 'plug it in'),
    ('laptop', 'serial.grabbers', WARN, 'ModemManager runs', 'disable --now ModemManager'),
    ('laptop', 'serial.grabbers', WARN, 'CH340', 'sudo apt remove brltty'),
    ('laptop', 'leftovers.programs', WARN, 'core (pid 970)', 'kill 970'),
    ('laptop', 'leftovers.sockets', WARN, 'robot.sock, robot', 'rm -r /run/user/1000'),
    ('docker', 'kernel.preemption', OK, 'mode full (from its command line)', ''),
    ('docker', 'limits.scheduler', WARN, 'no CAP_SYS_NICE', 'docker run --cap-add SYS_NICE'),
    ('docker', 'limits.memory_lock', WARN, 'RLIMIT_MEMLOCK is 64 MB', '--ulimit memlock=-1'),
    ('docker', 'place.container', OK, 'docker, seccomp filter', ''),
    ('docker', 'place.quota', WARN, '1.5 CPUs: 150000 of 100000 us', 'docker update'),
    ('docker', 'cpu.governor', WARN, 'schedutil', 'on the host, not in this container'),
    ('docker', 'memory.huge_pages', WARN, 'always', 'on the host, not in this container'),
    ('docker', 'clock.discipline', UNKNOWN, 'adjtimex is refused', ''),
    ('docker', 'python.numpy', BAD, "No module named 'numpy'", './scripts/run doctor'),
    ('docker', 'python.compiled', WARN, 'pure Python: it was not compiled',
     'apt install gcc python3-dev\ncolcon build --packages-select rt_robot_os\nin the image'),
    ('docker', 'python.threads', ABSENT, 'cannot be imported', ''),
    ('docker', 'ros.rclpy', BAD, "No module named 'rclpy'", './scripts/run doctor'),
    ('docker', 'serial.permission', ABSENT, 'no serial adapter', ''),
    ('wsl2', 'kernel.preemption', WARN, 'not preemptible', 'use a real Linux'),
    ('wsl2', 'kernel.fair_server', ABSENT, 'has none', ''),
    ('wsl2', 'limits.memory_lock', WARN, 'granted to a small process', ''),
    ('wsl2', 'place.virtual', WARN, 'WSL2', 'real Linux'),
    ('wsl2', 'cpu.governor', ABSENT, 'WSL2', ''),
    ('wsl2', 'isolation.isolated', WARN, 'open', '.wslconfig'),
    ('wsl2', 'clock.source', OK, 'hyperv_clocksource_tsc_page', ''),
    ('wsl2', 'memory.huge_pages', WARN, 'always', 'until the next boot'),
    ('wsl2', 'python.version', BAD, '3.14.0; supported are 3.10 to 3.13', 'apt install python3'),
    ('wsl2', 'python.build', BAD, 'free-threaded', 'apt install python3'),
    ('wsl2', 'python.compiled', OK, 'RT_ROBOT_OS_COMPILE=0', 'unset RT_ROBOT_OS_COMPILE'),
    ('wsl2', 'python.numpy', WARN, '1.24.0', 'numpy>=1.26'),
    ('wsl2', 'ros.distribution', BAD, 'humble is sourced, the package needs jazzy', 'env -i'),
    ('wsl2', 'ros.domain', BAD, "'mine'", 'ROS_DOMAIN_ID=0'),
    ('virtual', 'kernel.preemption', OK, 'mode full (from /sys/kernel/debug', ''),
    ('virtual', 'kernel.throttling', OK, 'off (-1)', ''),
    ('virtual', 'limits.scheduler', WARN, 'cpu.rt_runtime_us of this cgroup', 'echo 950000'),
    ('virtual', 'place.virtual', WARN, 'QEMU Standard PC', 'on the host'),
    ('virtual', 'place.steal', WARN, '3.9 % of the time of cpu0', 'on the host'),
    ('virtual', 'place.container', OK, 'made from an image', ''),
    ('virtual', 'place.quota', WARN, '0.5 CPUs: 50000 of 100000 us', 'CPUQuota='),
    ('virtual', 'isolation.cpu', WARN, 'one CPU only', ''),
    ('virtual', 'isolation.isolated', ABSENT, '', ''),
    ('virtual', 'isolation.boot', WARN, 'highres=off', 'update-grub'),
    ('virtual', 'clock.source', WARN, 'acpi_pm, though kvm-clock is there', 'echo kvm-clock'),
    ('virtual', 'clock.resolution', WARN, '4 ms', 'highres=off'),
    ('virtual', 'clock.read_cost', WARN, '812 ns', ''),
    ('virtual', 'clock.discipline', OK, 'by chronyd', ''),
    ('virtual', 'memory.disk', BAD, '/var/log/ros cannot be written', 'ROS_LOG_DIR'),
    ('virtual', 'python.build', WARN, 'debug build', ''),
    ('virtual', 'python.compiled', WARN, 'its C sources changed', 'colcon build'),
    ('virtual', 'python.observers', WARN, 'sys.monitoring (coverage)', 'sitecustomize'),
    ('nothing', 'kernel.throttling', UNKNOWN, 'sched_rt_runtime_us is not there', ''),
    ('nothing', 'limits.scheduler', UNKNOWN, "the probe 'scheduler' ended with code 1", ''),
    ('nothing', 'clock.source', UNKNOWN, 'is not there', ''),
    ('nothing', 'memory.disk', UNKNOWN, 'ROS_LOG_DIR', ''),
]


def _words(finding: Finding) -> str:
    remedy = finding.remedy
    return '\n'.join([*remedy.commands, remedy.note]) if remedy else ''


@pytest.mark.parametrize('name, key, state, words, mends', EXPECTED)
def test_a_recorded_machine(name, key, state, words, mends, machine) -> None:
    findings = found(machine(name), key)
    assert any(one.state is state and words in one.found and mends in _words(one)
               for one in findings), [(one.state, one.found, _words(one)) for one in findings]


def _lines(system) -> list[Line]:
    return [line for group in GROUPS for line in examine(group, system)]


@pytest.mark.parametrize('name', NAMES)
def test_every_check_says_something_about_every_machine(name, machine) -> None:
    lines = _lines(machine(name))
    assert {line.check.key for line in lines} == set(CHECKS)
    assert [line.finding.found for line in lines if 'please report it' in line.finding.found] == []
    assert all(line.finding.found for line in lines)


@pytest.mark.parametrize('name, verdict', [
    ('raspberry_pi', Verdict.USABLE), ('laptop', Verdict.NOT_USABLE),
    ('docker', Verdict.NOT_USABLE), ('nothing', Verdict.USABLE)])
def test_the_verdict(name, verdict, machine) -> None:
    system = machine(name)
    assert Report(describe(system), system.wanted, _lines(system)).verdict is verdict


def test_the_raspberry_pi_is_ready_once_its_adapter_is_quick(machine) -> None:
    system = machine('raspberry_pi',
                     {'/sys/bus/usb-serial/devices/ttyUSB0/latency_timer': '1\n'})
    assert Report(describe(system), system.wanted, _lines(system)).verdict is Verdict.READY


@pytest.mark.parametrize('name', NAMES)
def test_what_is_to_be_mended_says_how_and_how_much_it_is_worth(name, machine) -> None:
    for line in _lines(machine(name)):
        if line.finding.state in (WARN, BAD):
            assert _words(line.finding), line
            assert 0 < line.finding.weight <= 100, line


@pytest.mark.parametrize('name', NAMES)
def test_every_remedy_is_a_shell_command(name, machine) -> None:
    script = '\n'.join('\n'.join(line.finding.remedy.commands)
                       for line in _lines(machine(name)) if line.finding.remedy)
    checked = subprocess.run(['bash', '-n'], input=script, capture_output=True, text=True)
    assert (checked.returncode, checked.stderr) == (0, '')


@pytest.mark.parametrize('everything', [False, True])
@pytest.mark.parametrize('name', NAMES)
def test_the_text_fits_a_terminal_and_can_be_pasted(name, everything, machine) -> None:
    system = machine(name)
    style = Style()
    report = Report(describe(system), system.wanted, _lines(system))
    writer = text_report.Writer(style, everything=everything)
    written = [*text_report.head_lines(report, style),
               *(line for group in GROUPS for line in writer.group(
                   group.title, [one for one in report.lines if one.group == group.key])),
               *text_report.summary_lines(report, style)]
    assert [line for line in written if len(line) > text_report.WIDTH] == []
    # Remedies are what is indented furthest on the left edge: comments and commands alone.
    indent = ' ' * 13
    script = '\n'.join(line for line in written
                       if line.startswith(indent) and not line.startswith(' ' * 30))
    assert subprocess.run(['bash', '-n'], input=script, text=True).returncode == 0


def test_remedies_for_a_container_never_forget_where_they_belong(machine) -> None:
    for line in _lines(machine('docker')):
        words = _words(line.finding)
        if 'sudo' in words:
            assert 'on the host' in words, line

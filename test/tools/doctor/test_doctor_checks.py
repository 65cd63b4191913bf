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

"""Single checks on machines that differ in one thing."""

from __future__ import annotations

import gzip
import re

import pytest
from recorded import found
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.settings.run_on import MovingBoard

from rt_robot_os.tools.doctor.facts import cpu_list
from rt_robot_os.tools.doctor.facts import cpu_text
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import State
from rt_robot_os.tools.doctor.registry import ask

OK, WARN, BAD, UNKNOWN, ABSENT = State.OK, State.WARN, State.BAD, State.UNKNOWN, State.ABSENT
CPU = '/sys/devices/system/cpu'


def _only(system, key):
    findings = found(system, key)
    assert len(findings) == 1, findings
    return findings[0]


def _commands(finding) -> str:
    return '\n'.join(finding.remedy.commands)


@pytest.mark.parametrize('text, cpus', [
    ('0-2,5\n', [0, 1, 2, 5]), ('', []), ('(null)\n', []), ('3', [3]), ('1,0', [0, 1]),
    ('junk,2', [2])])
def test_cpu_lists(text, cpus) -> None:
    assert cpu_list(text) == cpus
    assert cpu_list(cpu_text(cpus)) == cpus


def test_a_check_that_raises_is_a_line(machine) -> None:
    def broken(system):
        raise RuntimeError('surprise')

    line, = ask(Check('x.y', 'x', 'y', broken), machine('nothing'))
    assert line.state is UNKNOWN
    assert 'RuntimeError: surprise' in line.found


@pytest.mark.parametrize('error, words', [
    (PermissionError(13, 'Permission denied', '/secret'), '/secret may not be read by this user'),
    (FileNotFoundError(2, 'No such file or directory', '/gone'), '/gone is not there'),
    (OSError(5, 'Input/output error', '/broken'), '/broken: Input/output error'),
    (OSError(38, 'Function not implemented'), 'Function not implemented')])
def test_what_cannot_be_read_is_unknown_with_the_reason(error, words, machine) -> None:
    def broken(system):
        raise error

    line, = ask(Check('x.y', 'x', 'y', broken), machine('nothing'))
    assert (line.state, line.found) == (UNKNOWN, words)


@pytest.mark.parametrize('content', ['', '\0\xff', 'a b c\n' * 3, '-7', '99999999999999999999'])
def test_files_with_nonsense_in_them_end_nothing(content, machine) -> None:
    system = machine('laptop')
    for path in system.root.rglob('*'):
        if path.is_file() and 'dev' not in path.parts:
            path.write_text(content)
    from recorded import CHECKS
    for key in CHECKS:
        assert found(system, key), key


# ---- kernel ----------------------------------------------------------------------------------

def test_the_mode_of_preemption_without_any_source_is_unknown(machine) -> None:
    system = machine('laptop', {'/boot/config-6.8.0-85-generic': None})
    finding = _only(system, 'kernel.preemption')
    assert finding.state is UNKNOWN
    assert 'sudo cat' in _commands(finding)


def test_the_mode_of_preemption_from_a_compressed_configuration(machine) -> None:
    system = machine('laptop', {'/boot/config-6.8.0-85-generic': None})
    system.path('/proc/config.gz').write_bytes(gzip.compress(b'CONFIG_PREEMPT_LAZY=y\n'))
    finding = _only(system, 'kernel.preemption')
    assert (finding.state, 'mode lazy' in finding.found) == (OK, True)


@pytest.mark.parametrize('name, files, words', [
    ('ubuntu', {}, 'sudo pro enable realtime-kernel'),
    ('ubuntu', {'/boot/firmware/config.txt': ''}, '--variant=raspi'),
    ('debian', {}, 'linux-image-rt-$(dpkg --print-architecture)'),
    ('debian', {'/boot/firmware/config.txt': ''}, 'linux-image-rpi-v8-rt')])
def test_the_real_time_kernel_of_each_distribution(name, files, words, machine) -> None:
    system = machine('laptop', {'/etc/os-release': f'NAME="x"\nID={name}\n', **files},
                     version='#1 SMP PREEMPT')
    finding = _only(system, 'kernel.preemption')
    assert finding.state is OK
    assert words in _commands(finding)


def test_no_share_for_real_time_tasks_is_bad(machine) -> None:
    system = machine('laptop', {'/proc/sys/kernel/sched_rt_runtime_us': '0'})
    assert _only(system, 'kernel.throttling').state is BAD
    system = machine('laptop', {'/proc/sys/kernel/sched_rt_runtime_us': '500000'})
    assert _only(system, 'kernel.throttling').state is WARN


def test_a_generous_fair_server_takes_from_the_core(machine) -> None:
    system = machine('raspberry_pi', {'/sys/kernel/debug/sched/fair_server/cpu3/runtime':
                                      '300000000'})
    finding = _only(system, 'kernel.fair_server')
    assert finding.state is WARN
    assert 'cpu3/runtime' in _commands(finding)


# ---- rights ----------------------------------------------------------------------------------

def _refused(machine, files=None, **facts):
    system = machine('laptop', files, **facts)
    return _only(system, 'limits.scheduler')


def test_a_seccomp_filter_is_named_when_the_capability_is_there(machine) -> None:
    finding = _refused(machine, {'/proc/self/status': 'CapEff:\t0000000000800000\nSeccomp:\t2\n'})
    assert 'seccomp' in finding.found


def test_real_time_groups_of_the_kernel_are_named(machine) -> None:
    finding = _refused(machine, {
        '/proc/self/limits': 'Max realtime priority     98   98\n',
        '/boot/config-6.8.0-85-generic': 'CONFIG_RT_GROUP_SCHED=y\n'})
    assert 'in spite of RLIMIT_RTPRIO 98' in finding.found
    assert 'CONFIG_RT_GROUP_SCHED' in finding.found


def test_a_limit_below_the_priority_is_told(machine) -> None:
    finding = _refused(machine, {'/proc/self/limits': 'Max realtime priority     50   50\n'})
    assert 'RLIMIT_RTPRIO is 50' in finding.found


def test_a_refusal_without_a_reason_is_probably_a_user_namespace(machine) -> None:
    finding = _refused(machine, {'/proc/self/status': 'CapEff:\t0000000000800000\nSeccomp:\t0\n'})
    assert 'user namespace' in finding.remedy.note


def test_who_has_joined_the_group_only_has_to_log_in_again(machine) -> None:
    finding = _refused(machine, {'/etc/group': 'realtime:x:980:ada,bob\n'})
    assert finding.remedy.commands == ()
    assert 'log out' in finding.remedy.note


def test_in_kubernetes_the_pod_is_changed(machine) -> None:
    finding = _refused(machine, {'/proc/self/cgroup': '0::/kubepods/burstable/pod1/c1\n'})
    assert 'securityContext' in finding.remedy.note


def test_a_core_without_real_time_asks_for_nothing(machine) -> None:
    system = machine('laptop', wanted={'priority': 0, 'lock_memory': False})
    assert _only(system, 'limits.scheduler').state is ABSENT
    assert _only(system, 'limits.memory_lock').state is ABSENT
    assert _only(system, 'load.rivals').state is ABSENT


def test_no_room_for_signals_is_bad(machine) -> None:
    system = machine('laptop', {'/proc/self/status': 'SigQ:\t63000/63000\n'})
    assert _only(system, 'limits.signals').state is BAD


# ---- CPU and isolation -----------------------------------------------------------------------

def test_only_the_governor_of_the_cores_cpu_matters(machine) -> None:
    system = machine('laptop', {f'{CPU}/cpu3/cpufreq/scaling_governor': 'performance'})
    finding = _only(system, 'cpu.governor')
    assert finding.state is OK
    assert finding.found == 'powersave on CPU 0-2, performance on CPU 3'


def test_idle_states_that_are_disabled_do_not_count(machine) -> None:
    system = machine('laptop', {f'{CPU}/cpu3/cpuidle/state{n}/disable': '1' for n in (2, 3)})
    finding = _only(system, 'cpu.idle')
    assert (finding.state, finding.found) == (OK, 'CPU 3: the deepest is C1E (2 us)')
    assert _only(system, 'cpu.dma_latency').state is OK


def test_who_may_hold_the_latency_device_is_told_how(machine) -> None:
    finding = _only(machine('laptop', denied=[]), 'cpu.idle')
    assert 'core.cpu_latency_us:=0' in _commands(finding)
    finding = _only(machine('laptop', denied=[], wanted={'cpu_latency_us': 0}), 'cpu.idle')
    assert (finding.state, 'prevents' in finding.found) == (OK, True)
    finding = _only(machine('laptop', wanted={'cpu_latency_us': 0}), 'cpu.idle')
    assert finding.state is WARN


@pytest.mark.parametrize('bits, words', [('50005', 'voltage'), ('8', 'too hot')])
def test_a_throttled_raspberry_pi(bits, words, machine) -> None:
    path = '/sys/devices/platform/soc/soc:firmware/get_throttled'
    finding = _only(machine('raspberry_pi', {path: bits}), 'cpu.temperature')
    assert finding.state is WARN
    assert words in finding.found


def test_an_isolated_cpu_is_not_found_by_minus_one(machine) -> None:
    finding = _only(machine('raspberry_pi', wanted={'cpu': -1}), 'isolation.isolated')
    assert finding.state is WARN
    assert 'CPU 3 is isolated, but the core would run on 2' in finding.found
    assert 'core.cpu:=3' in _commands(finding)


def test_a_cpu_that_does_not_exist(machine) -> None:
    finding = _only(machine('laptop', wanted={'cpu': 12}), 'isolation.cpu')
    assert (finding.state, 'there are 0-3' in finding.found) == (WARN, True)


def test_a_core_that_is_not_pinned(machine) -> None:
    system = machine('laptop', wanted={'cpu': -2})
    assert _only(system, 'isolation.cpu').state is WARN
    for key in ('isolation.interrupts', 'isolation.isolated', 'cpu.siblings'):
        assert _only(system, key).state is ABSENT, key


def test_irqbalance_that_was_told(machine) -> None:
    system = machine('laptop', {'/etc/default/irqbalance': 'IRQBALANCE_BANNED_CPULIST="2-3"\n'})
    assert _only(system, 'isolation.irqbalance').state is OK


@pytest.mark.parametrize('mask, state, command', [
    ('f\n', WARN, 'echo 7 |'), ('7\n', OK, ''), ('00000000,0000000f\n', WARN, 'echo 7 |'),
    ('junk\n', UNKNOWN, '')])
def test_work_queues(machine, mask, state, command) -> None:
    system = machine('laptop', {'/sys/devices/virtual/workqueue/cpumask': mask})
    finding = _only(system, 'isolation.work_queues')
    assert finding.state is state
    assert not command or command in _commands(finding)


# ---- the rest --------------------------------------------------------------------------------

def test_the_quota_of_a_cgroup_above_counts(machine) -> None:
    system = machine('raspberry_pi', {'/sys/fs/cgroup/user.slice/cpu.max': '20000 100000'})
    finding = _only(system, 'place.quota')
    assert finding.state is WARN
    assert finding.found.startswith('0.2 CPUs')


def test_a_task_at_the_same_priority_on_another_cpu_is_no_rival(machine) -> None:
    system = machine('laptop', {'/proc/960/status': 'Cpus_allowed_list:\t0-2\n'})
    finding = _only(system, 'load.rivals')
    assert (finding.state, '(2 below it' in finding.found) == (OK, True)


def _core(pid: int, name: str) -> dict[str, str]:
    """Give the files of a robot's core that runs at FIFO 80 on CPU 3."""
    words = ['python3', '-m', 'rt_robot_os.core.program', '--socket', f'/run/rt/{name}.sock', '']
    stat = ['S', '1', '1', '1', '0', '-1', *['0'] * 31, '81', '80', '3', '1', *['0'] * 11]
    stat[37], stat[38] = '80', '1'
    return {f'/proc/{pid}/cmdline': '\0'.join(words),
            f'/proc/{pid}/task/{pid}/stat': f'{pid} (python3) {" ".join(stat)}',
            f'/proc/{pid}/status': 'Cpus_allowed_list:\t3\n'}


ALONE = {'/proc/960/status': 'Cpus_allowed_list:\t0-2\n'}


def test_the_core_of_the_robot_is_no_rival_of_itself(machine) -> None:
    finding = _only(machine('laptop', {**ALONE, **_core(4242, 'robot')}), 'load.rivals')
    assert finding.state is OK
    assert 'the core of robot runs, pid 4242' in finding.found


def test_somebody_else_at_its_priority_still_is_one_when_the_core_runs(machine) -> None:
    finding = _only(machine('laptop', _core(4242, 'robot')), 'load.rivals')
    assert finding.state is WARN
    assert 'jackd' in finding.found
    assert '4242' not in finding.found + _commands(finding)


def test_cores_of_two_robots_on_one_cpu_hold_up_each_other(machine) -> None:
    system = machine('laptop', {**ALONE, **_core(4242, 'robot'), **_core(4343, 'other')})
    finding = _only(system, 'load.rivals')
    assert finding.state is WARN
    assert finding.found == (
        '2 robots have their cores on CPU 3: robot (pid 4242), other (pid 4343)')
    assert 'core.cpu:=2' in _commands(finding) and 'chrt' not in _commands(finding)


@pytest.mark.parametrize('name', ['laptop', 'raspberry_pi', 'virtual', 'docker', 'wsl2'])
def test_a_cpu_that_is_not_there_is_told_and_in_no_remedy(machine, name) -> None:
    from recorded import CHECKS
    system = machine(name, wanted={'cpu': 99})
    finding = _only(system, 'isolation.cpu')
    assert finding.state is WARN
    assert finding.found.startswith('CPU 99 does not run; there are 0')
    for check in CHECKS:
        for line in found(system, check):
            remedy = line.remedy
            told = '' if remedy is None else '\n'.join((*remedy.commands, remedy.note))
            assert not re.search(r'\b99\b', told.replace('/99-', '')), (check, told)


def test_a_distribution_that_is_installed_but_not_sourced(machine) -> None:
    system = machine('raspberry_pi', environ={'HOME': '/users/pi'})
    finding = _only(system, 'ros.distribution')
    assert finding.state is WARN
    assert _commands(finding) == 'source /opt/ros/jazzy/setup.bash'


@pytest.mark.parametrize('value, state', [
    ('', OK), ('0', OK), ('101', OK), ('102', WARN), ('232', WARN), ('233', BAD), ('-1', BAD)])
def test_domains(value, state, machine) -> None:
    system = machine('raspberry_pi', environ={'ROS_DOMAIN_ID': value})
    assert _only(system, 'ros.domain').state is state


def test_a_discovery_range_that_does_not_exist(machine) -> None:
    system = machine('raspberry_pi', environ={'ROS_AUTOMATIC_DISCOVERY_RANGE': 'local'})
    finding = _only(system, 'ros.discovery')
    assert (finding.state, "'local'" in finding.found) == (WARN, True)


def test_a_port_is_named_once_by_the_name_that_stays(machine) -> None:
    finding = _only(machine('raspberry_pi'), 'serial.permission')
    assert finding.subject.startswith('/dev/serial/by-id/')
    finding = _only(machine('raspberry_pi', wanted={}), 'serial.permission')
    assert finding.subject == '/dev/ttyUSB0'
    assert 'write it as /dev/serial/by-id/' in finding.found


def test_a_port_in_a_container_is_passed_in(machine) -> None:
    system = machine('docker', wanted={'ports': ['/dev/ttyUSB0']})
    assert '--device /dev/ttyUSB0' in _only(system, 'serial.permission').remedy.note


def test_an_i2c_bus_that_is_not_there_or_not_allowed(machine) -> None:
    wanted = {'ports': ['/dev/i2c-1']}
    finding = _only(machine('laptop', {'/dev/ttyUSB0': None}, wanted=wanted), 'serial.permission')
    assert 'modprobe i2c-dev' in _commands(finding)
    system = machine('laptop', {'/dev/ttyUSB0': None, '/dev/i2c-1': ''}, wanted=wanted,
                     denied=['/dev/i2c-1'], groups={'/dev/i2c-1': 'i2c'})
    assert 'usermod -aG i2c' in _commands(_only(system, 'serial.permission'))
    assert _only(system, 'serial.grabbers').state is ABSENT


def test_the_configured_watchdog(machine) -> None:
    wanted = {'watchdog': '/dev/watchdog'}
    assert _only(machine('laptop'), 'limits.watchdog').state is ABSENT
    finding = _only(machine('laptop', wanted=wanted), 'limits.watchdog')
    assert 'modprobe softdog' in _commands(finding)
    files = {'/dev/watchdog': ''}
    assert _only(machine('laptop', files, wanted=wanted), 'limits.watchdog').state is OK
    finding = _only(machine('laptop', files, wanted=wanted, denied=['/dev/watchdog']),
                    'limits.watchdog')
    assert 'KERNEL=="watchdog"' in _commands(finding)


def test_the_folder_of_the_black_box_needs_room_as_well(machine) -> None:
    system = machine('raspberry_pi', {'/data/x': ''}, wanted={'black_box_folder': '/data/box'},
                     denied=['/data'])
    states = [(one.subject, one.state) for one in found(system, 'memory.disk')]
    assert states == [('/users/pi/.ros/log', OK), ('/data/box', BAD)]


@pytest.mark.parametrize(('tried', 'state', 'told'), [
    ({'tried': True, 'reason': '', 'full': False}, OK, '4608 KiB can be kept free for /data/al'),
    ({'tried': True, 'reason': 'No space left on device', 'full': True}, BAD, 'no 4608 KiB'),
    ({'tried': True, 'reason': 'Operation not supported', 'full': False}, WARN, 'cannot keep'),
    ({'tried': False, 'reason': 'Is a directory', 'full': False}, UNKNOWN, 'Is a directory')])
def test_a_journal_of_alarms_needs_a_folder_that_keeps_room(machine, tried, state, told) -> None:
    wanted = {'journals': [['/data/al', 4608 << 10]]}
    probes = {**machine('raspberry_pi').facts['probes'], 'room': tried}
    finding = _only(machine('raspberry_pi', {'/data/x': ''}, wanted=wanted, probes=probes),
                    'memory.journal')
    assert (finding.state, told in finding.found) == (state, True)
    finding = _only(machine('raspberry_pi', {'/data/x': ''}, wanted=wanted, denied=['/data']),
                    'memory.journal')
    assert finding.state is BAD and 'cannot be written' in finding.found
    assert _only(machine('raspberry_pi'), 'memory.journal').state is ABSENT


def test_a_robot_that_goes_on_for_long_when_this_computer_falls_silent(machine) -> None:
    short, long = (MovingBoard('base', RunOn(silence_s, 0.4), 0.5, '', 'build the firmware anew')
                   for silence_s in (0.3, 2.0))
    assert _only(machine('laptop'), 'robot.run_on').state is ABSENT
    finding = _only(machine('laptop', wanted={'boards': (short,)}), 'robot.run_on')
    assert finding.state is OK and '0.35 m at 0.50 m/s' in finding.found
    finding = _only(machine('laptop', wanted={'boards': (long,)}), 'robot.run_on')
    assert finding.state is WARN and '1.20 m at 0.50 m/s' in finding.found
    assert finding.remedy.note == 'build the firmware anew'


def test_many_files_of_dds(machine) -> None:
    system = machine('docker', {f'/dev/shm/fastrtps_{n:04x}': '' for n in range(201)})
    assert _only(system, 'leftovers.shared_memory').state is WARN

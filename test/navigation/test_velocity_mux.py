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

"""The multiplexer of velocities: who steers, who is held off, what stops everybody."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.features.navigation.velocity_mux import VelocityMux
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

TWIST, BOOL = 'geometry_msgs/msg/Twist', 'std_msgs/msg/Bool'
SOURCES = {'teleop': 'cmd_vel_teleop', 'agent': 'cmd_vel_agent',
           'trajectory': 'cmd_vel_trajectory', 'ros': 'cmd_vel'}
LOCK = {'locks': ['pause'], 'lock_topics': ['pause'], 'lock_priorities': [50],
        'lock_timeouts_s': [0.0]}
NO_HOLD = {'source_holds_s': [0.0] * len(SOURCES)}


class Steered:
    """A multiplexer with all its sources, and what comes out of it."""

    def __init__(self, run_on: RunOn = RunOn(), **changes: Any) -> None:
        self.bench = ModuleBench()
        self.bench.run_on = run_on
        self.sources = {name: self.bench.topic(topic, TWIST) for name, topic in SOURCES.items()}
        names = {'estop', 'estop_release', changes.get('dead_man_topic', ''),
                 *changes.get('lock_topics', ())} - {''}
        self.switches = {name: self.bench.topic(name, BOOL) for name in sorted(names)}
        self.faults = self.bench.topic('motor_faults', 'std_msgs/msg/UInt32')
        self.mux = self.bench.add(VelocityMux, 'mux', **changes)
        self.out = self.bench.watch('cmd_vel_mux')
        self.steering = self.bench.watch('steering')

    def steer(self, name: str, speed: float, *times_s: float, turn: float = 0.0,
              age_s: float = 0.0) -> None:
        for time_s in times_s:
            self.bench.at(time_s, lambda: self._command(name, speed, turn, age_s))

    def _command(self, name: str, speed: float, turn: float, age_s: float) -> None:
        source = self.sources[name]
        source.msg.linear.x, source.msg.angular.z = speed, turn
        now_ns = self.bench.kernel.now_ns()
        source.publish(now_ns - round(age_s * 1e9))

    def switch(self, name: str, value: bool, *times_s: float) -> None:
        def do() -> None:
            self.switches[name].msg.data = value
            self.switches[name].publish()
        for time_s in times_s:
            self.bench.at(time_s, do)

    def fault(self, bits: int, time_s: float) -> None:
        def do() -> None:
            self.faults.msg.data = bits
            self.faults.publish()
        self.bench.at(time_s, do)

    def run(self, seconds: float) -> list[tuple[float, float]]:
        """Return when which speed came out."""
        self.bench.run(seconds)
        found = []
        while self.out.take():
            found.append((round(self.out.stamp_ns / 1e9, 3), self.out.msg.linear.x))
        return found

    def told(self) -> list[str]:
        found = []
        while self.steering.take():
            found.append(str(self.steering.msg.data))
        return found


def test_a_command_goes_out_at_once_and_one_standstill_when_the_last_source_is_silent() -> None:
    robot = Steered()
    robot.steer('ros', 0.5, 0.1, 0.2)
    assert robot.run(3.0) == [(0.1, 0.5), (0.2, 0.5), (0.7, 0.0)]
    assert robot.told() == ['ros', 'nobody']


def test_without_a_hold_the_lower_steers_as_soon_as_the_higher_is_silent() -> None:
    robot = Steered(**NO_HOLD)
    robot.steer('trajectory', 0.3, *[n / 10 for n in range(1, 20)])
    robot.steer('teleop', -0.1, 0.55, 0.75)
    moved = robot.run(1.5)
    assert [speed for time_s, speed in moved if time_s < 0.55] == [0.3] * 5
    assert [(t, v) for t, v in moved if 0.55 <= t <= 1.3] == [
        (0.55, -0.1), (0.75, -0.1), (1.2, 0.3), (1.3, 0.3)]
    assert robot.told() == ['trajectory', 'teleop', 'trajectory']


@pytest.mark.parametrize('timeout_s', [0.12, 0.5])
def test_a_slow_operator_is_not_reversed_by_a_fast_source(timeout_s: float) -> None:
    robot = Steered(source_timeouts_s=[timeout_s, 0.5, 0.5, 0.5])
    robot.steer('teleop', 0.8, *[n / 5 for n in range(1, 6)])
    robot.steer('ros', -0.8, *[n / 20 + 0.003 for n in range(24)])
    moved = robot.run(1.19)
    came = moved.index((0.2, 0.8))
    assert {speed for _, speed in moved[:came]} == {-0.8}
    # Where it sends more slowly than its time-out the robot stands in between.
    assert {speed for _, speed in moved[came:]} == ({0.8, 0.0} if timeout_s < 0.2 else {0.8})
    assert robot.told()[-1] == ('nobody: held for teleop' if timeout_s < 0.2 else 'teleop')


def test_a_hold_counts_from_the_last_command_and_then_the_next_steers_at_once() -> None:
    robot = Steered(source_holds_s=[0.8, 0.0, 0.0, 0.0])
    robot.steer('teleop', 0.3, 0.1, 0.2)
    robot.steer('agent', -0.1, *[n / 20 + 0.01 for n in range(24)])
    moved = robot.run(1.2)
    assert [(t, v) for t, v in moved if t >= 0.1 and v >= 0.0] == [
        (0.1, 0.3), (0.2, 0.3), (0.7, 0.0)]
    after = [t for t, v in moved if t >= 0.1 and v < 0.0]
    assert after[0] == 0.96 and robot.out.topic.head == len(moved)  # taken at 1.0 s
    assert robot.told() == ['agent', 'teleop', 'nobody: held for teleop', 'agent']


def test_a_hold_keeps_nobody_of_higher_priority_off() -> None:
    robot = Steered()
    robot.steer('ros', 0.3, 0.1)
    robot.steer('teleop', -0.1, 0.15)
    assert robot.run(0.2) == [(0.1, 0.3), (0.15, -0.1)]


def test_commands_that_were_too_old_when_they_came_hold_nothing() -> None:
    robot = Steered()
    robot.steer('teleop', 0.3, *[n / 10 for n in range(1, 9)], age_s=0.6)
    robot.steer('ros', 0.1, 0.55)
    assert robot.run(0.6) == [(0.55, 0.1)]


def test_holds_that_do_not_fit_the_sources_are_refused() -> None:
    with pytest.raises(ConfigError, match='source_holds_s has 1 items, sources has 4'):
        VelocityMux('mux', settings_of(VelocityMux, source_holds_s=[1.0]))


def test_a_dead_man_switch_that_waited_somewhere_is_not_held() -> None:
    robot = Steered(dead_man_topic='enable')

    def waited() -> None:
        robot.switches['enable'].msg.data = True
        robot.switches['enable'].publish(robot.bench.kernel.now_ns() - 400_000_000)
    robot.bench.at(1.0, waited)
    robot.steer('teleop', 0.3, 1.1)
    assert robot.run(1.2) == []


@pytest.mark.parametrize('age_s', [0.6, 2.1])
def test_a_release_of_before_the_stop_or_too_old_frees_nothing(age_s: float) -> None:
    robot = Steered()

    def release() -> None:
        robot.switches['estop_release'].msg.data = True
        robot.switches['estop_release'].publish(
            robot.bench.kernel.now_ns() - round(age_s * 1e9))
    robot.switch('estop', True, 3.0 if age_s < 2.0 else 0.1)
    robot.switch('estop', False, 3.1)
    robot.bench.at(3.5, release)
    robot.steer('teleop', 0.3, 3.6)
    assert robot.run(3.7) == [(3.0 if age_s < 2.0 else 0.1, 0.0)]
    assert robot.mux.statistics()['releases_refused'] == 1


def test_the_time_out_needs_no_rate_and_counts_from_the_stamp() -> None:
    robot = Steered()
    assert robot.mux.task is not None and robot.mux.task.rate_hz == 0
    robot.steer('ros', 0.5, 1.0, age_s=0.4)
    robot.steer('agent', 0.5, 2.0, age_s=0.6)
    robot.run(3.0)
    statistics = robot.mux.statistics()
    assert robot.out.topic.head == 2  # the command, and a standstill at 1.1 s
    assert robot.out.topic.stamp_of(1) == 1_100_000_000
    assert (statistics['ros_late'], statistics['agent_late']) == (0, 1)
    assert 'too old when they came: commands of agent' in statistics['warning']


@pytest.mark.parametrize('speed', [math.nan, math.inf, -math.inf, 1e300, -10.1])
def test_what_is_no_speed_is_a_standstill_and_counted(speed: float) -> None:
    robot = Steered()
    robot.steer('agent', 0.5, 0.1)
    robot.steer('agent', speed, 0.2)
    assert robot.run(0.3) == [(0.1, 0.5), (0.2, 0.0)]
    statistics = robot.mux.statistics()
    assert statistics['agent_refused'] == 1
    assert 'commands of agent' in statistics['warning']


def test_a_turning_rate_that_is_no_number_stops_the_whole_command() -> None:
    robot = Steered()
    robot.steer('agent', 0.5, 0.1, turn=math.nan)
    assert robot.run(0.3) == [(0.1, 0.0)]


def test_motors_that_go_on_in_silence_are_driven_slowly_and_on_the_same_arc() -> None:
    robot = Steered(RunOn(2.0, 0.5))
    robot.steer('ros', 0.8, 0.1, turn=0.4)
    robot.steer('ros', -0.8, 0.2)
    robot.steer('ros', 0.1, 0.3, turn=2.0)
    out = noted(robot)
    robot.bench.run(0.4)
    assert [(linear[0], angular[2]) for _, linear, angular in out] == [
        pytest.approx(each) for each in ((0.2, 0.1), (-0.2, 0.0), (0.1, 2.0))]
    told = robot.mux.statistics()
    assert told['slowed'] == 2 and told['speed_limit_m_s'] == pytest.approx(0.5 / 2.5)


def test_how_far_they_may_go_on_can_be_set_and_0_slows_nothing() -> None:
    for way_m, speed in ((1.0, 0.4), (0.0, 0.8)):
        robot = Steered(RunOn(2.0, 0.5), run_on_max_m=way_m)
        robot.steer('ros', 0.8, 0.1)
        assert robot.run(0.2) == [(0.1, pytest.approx(speed))]


def test_a_lock_holds_off_what_is_below_it_and_stops_at_once() -> None:
    robot = Steered(**LOCK, **NO_HOLD)
    robot.steer('trajectory', 0.3, 0.1, 0.2, 0.3, 0.5)
    robot.switch('pause', True, 0.25)
    robot.steer('teleop', 0.1, 0.35)
    robot.switch('pause', False, 0.95)
    robot.steer('trajectory', 0.4, 1.0)
    assert robot.run(1.2) == [(0.1, 0.3), (0.2, 0.3), (0.25, 0.0), (0.35, 0.1), (0.85, 0.0),
                              (0.5, 0.3), (1.0, 0.4)]
    assert robot.told() == ['trajectory', 'nobody: locked by pause', 'teleop',
                            'nobody: locked by pause', 'trajectory']


def test_a_source_of_the_locks_own_priority_is_not_locked() -> None:
    robot = Steered(**{**LOCK, 'lock_priorities': [60]})
    robot.switch('pause', True, 0.0)
    robot.steer('trajectory', 0.3, 0.1)
    robot.steer('agent', 0.2, 0.2)
    assert robot.run(0.3) == [(0.2, 0.2)]


def test_a_lock_with_a_time_out_locks_while_it_is_silent() -> None:
    robot = Steered(**{**LOCK, 'lock_timeouts_s': [0.2]})
    robot.steer('ros', 0.3, *[n / 10 for n in range(1, 9)])
    robot.switch('pause', False, 0.35)
    assert robot.run(0.9) == [(0.3, 0.3), (0.4, 0.3), (0.5, 0.3), (0.55, 0.0)]
    assert robot.told()[-1] == 'nobody: locked by pause, which is silent'


def test_tele_operation_needs_its_dead_man_switch() -> None:
    robot = Steered(dead_man_topic='enable')
    robot.steer('teleop', 0.3, *[n / 10 for n in range(1, 20)])
    robot.switch('enable', True, 0.25, 0.45)
    robot.switch('enable', False, 0.55)
    robot.switch('enable', True, 0.95)  # and then it is silent
    robot.steer('ros', 0.1, 1.21)
    moved = robot.run(1.3)
    assert moved == [(0.2, 0.3), (0.3, 0.3), (0.4, 0.3), (0.5, 0.3), (0.55, 0.0),
                     (0.9, 0.3), (1.0, 0.3), (1.1, 0.3), (1.2, 0.3), (1.25, 0.0)]
    assert 'nobody: the dead-man switch is not held' in robot.told()


def test_the_e_stop_stays_until_it_is_released_and_what_asks_for_it_is_over() -> None:
    robot = Steered()
    robot.steer('teleop', 0.3, *[n / 10 for n in range(1, 20)])
    robot.switch('estop', True, 0.25)
    robot.switch('estop_release', True, 0.45)  # somebody still holds it
    robot.switch('estop', False, 0.65)  # that alone frees nothing
    robot.switch('estop_release', False, 0.75)
    robot.switch('estop_release', True, 0.95)
    assert robot.run(1.15) == [(0.1, 0.3), (0.2, 0.3), (0.25, 0.0), (1.0, 0.3), (1.1, 0.3)]
    assert robot.told() == ['teleop', 'nobody: e-stop, asked for on estop', 'nobody', 'teleop']
    statistics = robot.mux.statistics()
    assert (statistics['estops'], statistics['releases_refused']) == (1, 1)


def test_an_e_stop_that_is_over_before_the_mux_runs_stops_all_the_same() -> None:
    robot = Steered()
    robot.bench.kernel.add_task('busy', lambda: robot.bench.kernel.clock.spend(10_000_000),
                                priority=90, rate_hz=0.1, phase_ns=200_000_000)
    robot.steer('ros', 0.3, 0.1, 0.3)
    robot.switch('estop', True, 0.2)
    robot.switch('estop', False, 0.2)
    assert robot.run(0.4) == [(0.1, 0.3), (0.21, 0.0)]


def test_samples_of_the_e_stop_that_were_lost_stop() -> None:
    robot = Steered()
    robot.bench.at(0.2, lambda: [robot.switches['estop'].publish() for _ in range(40)])
    robot.bench.run(0.3)
    assert robot.mux.statistics()['estop'] == 'samples of the e-stop were lost'


def test_motor_faults_stop_where_that_is_set_and_the_robot_can_begin_stopped() -> None:
    robot = Steered(motor_faults_topic='motor_faults', estop_at_start=True)
    robot.steer('ros', 0.3, *[n / 10 for n in range(1, 10)])
    robot.switch('estop_release', True, 0.15, 0.55, 0.75)
    robot.fault(0, 0.05)
    robot.fault(4, 0.35)
    robot.fault(0, 0.65)
    assert robot.run(0.85) == [(0.2, 0.3), (0.3, 0.3), (0.35, 0.0), (0.8, 0.3)]
    assert robot.told() == ['nobody: e-stop, held since the start', 'nobody', 'ros',
                            'nobody: e-stop, motor faults 0x4', 'nobody', 'ros']


def test_lost_bytes_and_a_low_battery_are_no_e_stop() -> None:
    robot = Steered(motor_faults_topic='motor_faults')
    robot.steer('ros', 0.3, *[n / 10 for n in range(1, 5)])
    robot.fault(MotorFault.LINE | MotorFault.BATTERY_LOW | MotorFault.COMMAND_REFUSED, 0.15)
    assert [speed for _, speed in robot.run(0.45)] == [0.3] * 4
    assert robot.told() == ['ros']


def test_a_time_out_that_an_earlier_run_of_the_kernel_left_is_not_waited_for() -> None:
    robot = Steered()
    robot.steer('ros', 0.3, 0.1)
    robot.run(0.3)
    robot.bench.kernel.clock.spend(2_000_000_000)
    robot.steer('ros', 0.4, 0.1)
    assert [speed for _, speed in robot.run(1.0)] == [0.4, 0.0]


def test_the_safe_state_is_a_standstill_that_an_old_command_does_not_end() -> None:
    robot = Steered()
    robot.steer('ros', 0.3, 0.1)
    robot.bench.at(0.2, robot.mux.safe_state)
    robot.switch('estop', False, 0.3)
    assert robot.run(0.4) == [(0.1, 0.3), (0.2, 0.0)]


@pytest.mark.parametrize(('changes', 'text'), [
    ({'source_topics': ['a', 'b']}, 'mux.source_topics has 2 items, sources has 4'),
    ({'source_topics': ['a', 'a', 'b', 'c']}, "mux.source_topics: 'a' is listed twice"),
    ({'locks': ['pause']}, 'mux.lock_topics has 0 items, locks has 1'),
    ({'dead_man_topic': 'held', 'dead_man_sources': ['telop']},
     "'telop' is not one of the sources"),
    ({'command_topic': 'cmd_vel'}, "mux.source_topics: 'cmd_vel' is its own output"),
    ({'estop_release_topic': ''}, 'nothing could release the e-stop')])
def test_lists_that_do_not_fit_are_told(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        VelocityMux('mux', settings_of(VelocityMux, **changes))


_SPEED = st.one_of(st.floats(-1.0, 1.0), st.sampled_from([math.nan, math.inf, 1e300]))
_EVENT = st.tuples(st.integers(1, 60), st.sampled_from([
    *SOURCES, 'estop', 'unstop', 'estop_release', 'pause', 'resume']), _SPEED)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(_EVENT, max_size=40, unique_by=lambda event: event[0]))
def test_what_comes_out_is_what_one_source_said_or_a_standstill(
        events: list[tuple[int, str, float]]) -> None:
    robot = Steered(**LOCK)
    switches: dict[str, Callable[[float], object]] = {
        'estop': lambda t: robot.switch('estop', True, t),
        'unstop': lambda t: robot.switch('estop', False, t),
        'estop_release': lambda t: robot.switch('estop_release', True, t),
        'pause': lambda t: robot.switch('pause', True, t),
        'resume': lambda t: robot.switch('pause', False, t)}
    for number, (tick, name, speed) in enumerate(events):
        if name in switches:
            switches[name](tick / 20)
        else:
            # Which command it was shows in the turning rate.
            robot.steer(name, speed, tick / 20, turn=0.001 * (number + 1))
    out = noted(robot)
    robot.bench.run(3.7)
    for now_s, linear, angular in out:
        assert all(map(math.isfinite, (*linear, *angular)))
        number = round(angular[2] * 1000)
        if not number:
            assert linear[0] == 0.0
            continue
        tick, name, speed = events[number - 1]
        assert linear[0] == speed
        assert now_s - 0.5 < tick / 20 <= now_s
        recent = [n for t, n, _ in events if now_s - 0.499 < t / 20 <= now_s]
        above = list(SOURCES)[:list(SOURCES).index(name)]
        # Both forget what was commanded before them.
        assert {'estop', 'estop_release'} & set(recent) or not set(above) & set(recent)
    assert not out or out[-1][1][0] == 0.0


def noted(robot: Steered) -> list[tuple[float, tuple[float, ...], tuple[float, ...]]]:
    """Note what comes out and when."""
    found: list[tuple[float, tuple[float, ...], tuple[float, ...]]] = []
    kernel, bus = robot.bench.kernel, robot.bench.bus

    def note() -> None:
        while read.take():
            found.append((kernel.now_ns() / 1e9, tuple(read.msg.linear), tuple(read.msg.angular)))

    task = kernel.add_task('note', note, priority=60)
    read = bus.subscribe('cmd_vel_mux', 'note', task=task)
    return found

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

"""The module fall_detector: a fall is told once, again while it lasts, and its end."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import json
import math
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.fall_detector import FallDetection
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import CAUSES_TOPIC
from rt_robot_os.messages.cause import Level
from rt_robot_os.sim.world.body_motion import body_motion
from rt_robot_os.sim.world.body_motion import IMPACT_S
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

UPRIGHT = [('stand', 2.0), ('walk', 3.0)]
FALL = [*UPRIGHT, ('fall', 20.0)]


class Worn:
    """A person with a sensor, and the module that watches them."""

    def __init__(self, **settings: Any) -> None:
        self.bench = ModuleBench()
        self.imu = self.bench.topic('health/anna/imu', 'sensor_msgs/msg/Imu', depth=64)
        self.peaks = self.bench.topic('wsn/wrist/acceleration_g', 'std_msgs/msg/Float64')
        self.module = self.bench.add(FallDetection, 'falls', person='anna', node='wrist',
                                     **settings)
        self._causes = self.bench.watch(CAUSES_TOPIC)
        self._state = self.bench.watch('health/anna/falls')
        self.end_s = 0.0

    def moves(self, activities: Sequence[tuple[str, float]], rate_hz: float = 50.0,
              together_s: float = 0.0) -> None:
        """Play activities from the beginning of the run on; samples of a time may come at once."""
        number, before, begun = 0, 'stand', 0.0
        for activity, lasts_s in activities:
            while number / rate_hz < begun + lasts_s:
                felt = body_motion(activity, number / rate_hz - begun, before=before)
                at_s = number / rate_hz
                comes_s = at_s if not together_s else together_s * (at_s // together_s + 1)
                self.bench.at(comes_s, partial(
                    self.felt, felt.force_m_s2, felt.rate_rad_s, round(at_s * NS_PER_S)))
                number += 1
            before, begun = activity, begun + lasts_s
        self.end_s = begun

    def felt(self, force: Sequence[float], rate: Sequence[float] = (0.0, 0.0, 0.0),
             stamp_ns: int = 0) -> None:
        self.imu.msg.linear_acceleration, self.imu.msg.angular_velocity = force, rate
        self.imu.msg.linear_acceleration_covariance = 9 * [0.0]
        self.imu.publish(stamp_ns)

    def struck(self, time_s: float, peak_g: float) -> None:
        def do() -> None:
            self.peaks.msg.data = peak_g
            self.peaks.publish()
        self.bench.at(time_s, do)

    def causes(self, seconds: float = 0.0) -> list[tuple[float, Cause]]:
        """Let time pass; return what was told, with the stamps in s."""
        self.bench.run(seconds or self.end_s)
        found = []
        while self._causes.take():
            found.append((self._causes.stamp_ns / NS_PER_S,
                          Cause.from_json(self._causes.msg.data)))
        return found

    def state_stamps(self) -> list[float]:
        found = []
        while self._state.take():
            found.append(round(self._state.stamp_ns / NS_PER_S, 6))
        return found

    def states(self) -> list[dict[str, Any]]:
        found = []
        while self._state.take():
            found += json.loads(self._state.msg.data)['status']
        return found


def test_a_fall_is_told_with_what_was_seen_and_again_while_it_lasts() -> None:
    worn = Worn()
    worn.moves(FALL)
    (at_s, cause), (again_s, _) = worn.causes(5.0 + 18.0)
    assert 5.0 + IMPACT_S < at_s < 5.0 + IMPACT_S + 5.0
    assert again_s == pytest.approx(at_s + 10.0)
    assert (cause.kind, cause.subject, cause.level, cause.active, cause.node, cause.source) == (
        'fall', 'anna', Level.CRITICAL, True, 'wrist', 'falls')
    assert cause.value == pytest.approx(4.0, abs=0.6) and 'impact' in cause.text
    assert 'confidence' in cause.text and 'degrees' in cause.text
    states = worn.states()
    assert [one['values']['state'] for one in states][:1] == ['watching']
    assert states[-1]['level'] == 2 and states[-1]['values']['state'] == 'fallen'
    assert float(states[-1]['values']['still_s']) > 5


def test_who_gets_up_ends_it() -> None:
    worn = Worn()
    worn.moves([*UPRIGHT, ('fall', 5.0), ('rise', 4.0), ('walk', 6.0)])
    told = [cause for _, cause in worn.causes()]
    assert [cause.active for cause in told] == [True, False]
    assert 'got up' in told[-1].text
    assert worn.module.statistics()['recoveries'] == 1


def test_a_day_without_a_fall_tells_nothing() -> None:
    worn = Worn()
    worn.moves([*UPRIGHT, ('sit', 4.0), ('rise', 3.0), ('walk', 3.0), ('lie', 8.0), ('rise', 4.0)])
    assert worn.causes() == []
    assert not worn.module.statistics()['warning']


def test_a_sensor_that_breaks_in_the_fall_has_said_enough() -> None:
    worn = Worn()
    worn.moves([*UPRIGHT, ('fall', IMPACT_S + 0.5)])
    (at_s, cause), = worn.causes(10.0)
    # Known at the deadline, which follows from the last sample's stamp alone.
    assert at_s == pytest.approx(5.0 + IMPACT_S + 0.5 - 0.02 + 1.0, abs=0.021)
    assert cause.active
    assert 'no samples' in worn.module.statistics()['warning']
    assert worn.states()[-1]['message'] == 'fallen, the sensor is silent'


def test_a_stall_of_the_radio_right_after_the_impact_loses_no_fall() -> None:
    worn = Worn()
    worn.moves([*UPRIGHT, ('fall', IMPACT_S + 0.15)])
    for number in range(250):  # a second and a half later it goes on, and lies
        worn.bench.at(5.0 + IMPACT_S + 1.65 + 0.02 * number,
                      lambda: worn.felt(body_motion('fall', 9.0).force_m_s2))
    (at_s, cause), = worn.causes(12.0)
    assert cause.active and at_s < 5.0 + IMPACT_S + 5.0


def test_samples_that_come_in_bursts_give_the_same_stamps() -> None:
    stamps = []
    for late_s in (0.0, 0.3):
        worn = Worn()
        worn.moves([*UPRIGHT, ('fall', 5.0), ('rise', 4.0), ('walk', 6.0)], together_s=late_s)
        causes = [at_s for at_s, _ in worn.causes(worn.end_s + 11.0)]
        stamps.append((causes, worn.state_stamps()))
    assert len(stamps[0][0]) == 2 and stamps[0][0] == stamps[1][0]
    # Their number depends on the bursts; each has the stamp of a sample or a deadline.
    assert set(stamps[1][1]) <= {round(0.02 * number, 2) for number in range(1100)}


def test_a_node_that_reports_peaks_only_gives_a_weak_suspicion() -> None:
    worn = Worn(imu_topic='', peaks_topic='wsn/wrist/acceleration_g')
    worn.struck(2.0, -5.2)
    (at_s, cause), = worn.causes(15.0)
    assert at_s == pytest.approx(12.0)
    assert (cause.level, cause.value) == (Level.URGENT, 5.2) and 'peaks only' in cause.text
    for time_s in (1.0, 2.0, 3.0):
        worn.struck(time_s, 1.6)
    assert [cause.active for _, cause in worn.causes(6.0)] == [False]


def test_who_is_struck_and_walks_on_has_not_fallen() -> None:
    worn = Worn(imu_topic='', peaks_topic='wsn/wrist/acceleration_g')
    worn.struck(2.0, 5.2)
    worn.struck(6.0, 1.5)
    worn.struck(7.0, math.nan)
    assert worn.causes(30.0) == []


def test_a_sensor_that_is_not_worn_is_shown_as_blind() -> None:
    worn = Worn()
    worn.moves([('stand', 1.0)], rate_hz=25.0)
    for number in range(5 * 330):
        worn.bench.at(1.0 + 0.2 * number, partial(worn.felt, (0.0, 9.8, 0.0)))
    assert worn.causes(330.0) == []
    assert 'not worn' in worn.module.statistics()['warning']
    state = worn.states()[-1]
    assert (state['level'], state['message']) == (3, 'taken off')


def test_samples_without_an_acceleration_and_slow_ones_are_told() -> None:
    worn = Worn()

    def without() -> None:
        worn.imu.msg.linear_acceleration_covariance = [-1.0, *8 * [0.0]]
        worn.imu.publish()

    worn.bench.at(0.5, without)
    worn.bench.run(1.0)
    statistics = worn.module.statistics()
    assert statistics['without_acceleration'] == 1 and 'acceleration' in statistics['warning']
    slow = Worn()
    slow.moves([('stand', 60.0)], rate_hz=5.0)
    slow.bench.run(60.0)
    assert '5 samples a second' in slow.module.statistics()['warning']


@pytest.mark.parametrize(('settings', 'named'), [
    ({'stop_from_m_s': 5.0}, 'stop_full_m_s'), ({'person': 'anna/2'}, 'person'),
    ({'person': ' '}, 'person'), ({'imu_topic': ''}, 'peaks_topic')])
def test_settings_that_cannot_be_are_named(settings: dict[str, Any], named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        FallDetection('falls', settings_of(FallDetection, **{'person': 'anna', **settings}))

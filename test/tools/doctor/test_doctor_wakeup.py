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

"""The measurement: counting, judging, and the real thing without asserting a time."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies
import pytest

from rt_robot_os.tools.doctor import wakeup
from rt_robot_os.tools.doctor.finding import State
from rt_robot_os.tools.doctor.lateness import Lateness
from rt_robot_os.tools.doctor.lateness import measured
from rt_robot_os.tools.doctor.style import Style
from rt_robot_os.tools.doctor.system import ProbeError
from rt_robot_os.tools.doctor.system import System
from rt_robot_os.tools.doctor.system import Wanted
from rt_robot_os.tools.doctor.text_report import histogram_lines
from rt_robot_os.tools.doctor.text_report import octaves

PERIOD = 1_000_000
US = 1_000


def _measured(*late_ns: int, skipped: int = 0):
    lateness = Lateness(PERIOD, skipped)
    for late in late_ns:
        lateness.call(lateness.next_ns + late)
    return measured(lateness.result())


def test_a_call_serves_the_earliest_release_and_misses_those_between() -> None:
    lateness = Lateness(PERIOD, 0)
    lateness.call(5)
    assert (lateness.next_ns, lateness.missed) == (PERIOD, 0)
    lateness.call(3 * PERIOD + 7)
    assert (lateness.next_ns, lateness.missed) == (4 * PERIOD, 2)
    assert lateness.histogram.maximum_ns == 2 * PERIOD + 7
    lateness.call(4 * PERIOD - 1)
    assert (lateness.next_ns, sum(lateness.histogram.counts)) == (4 * PERIOD, 2)


def test_cold_caches_do_not_count() -> None:
    result = _measured(5000 * US, 30 * US, 20 * US, skipped=1)
    assert (result.summary.count, result.summary.maximum_ns, result.missed) == (2, 30 * US, 0)


@given(strategies.lists(strategies.integers(0, 10**10), min_size=1, max_size=50))
def test_every_release_is_served_or_missed(late_ns) -> None:
    lateness = Lateness(PERIOD, 0)
    for late in late_ns:
        lateness.call(lateness.next_ns + late)
    result = measured(lateness.result())
    assert (result.summary.count + result.missed) * PERIOD == lateness.next_ns
    assert result.summary.maximum_ns == max(late_ns)
    assert sum(octaves(result).values()) == len(late_ns)


@pytest.mark.parametrize('late_ns, state, words', [
    ([20 * US] * 2000, State.OK, 'ready for 1 kHz'),
    ([20 * US] * 2000 + [99 * US], State.OK, 'max 99 us'),
    ([20 * US] * 2000 + [150 * US], State.WARN, 'at its worst ready for 500 Hz'),
    ([20 * US] * 2000 + [40_000 * US], State.WARN, 'at its worst ready for 2 Hz'),
    ([20 * US] * 2000 + [3_000_000 * US], State.WARN, 'too late for any loop'),
    ([20 * US] * 2000 + [2500 * US] * 20, State.BAD, '40 of 2060 missed'),
    ([], State.BAD, 'no wake-up')])
def test_the_verdict_on_a_measurement(late_ns, state, words) -> None:
    finding = wakeup.judge(_measured(*late_ns))
    assert finding.state is state
    assert words in finding.found


def test_what_was_refused_is_to_be_mended_first() -> None:
    finding = wakeup.judge(_measured(150 * US), ('SCHED_FIFO priority 80',))
    assert finding.remedy is not None and 'SCHED_FIFO' in finding.remedy.note


def test_both_histograms_stand_side_by_side() -> None:
    result = wakeup.Wakeup(_measured(*[20 * US] * 99, 700 * US), _measured(*[40 * US] * 50), 1.0,
                           ())
    lines = list(histogram_lines(result, Style()))
    assert [line[2:16].strip() for line in lines[2:]] == [
        '16.4 us ..', '32.8 us ..', '65.5 us ..', '131 us ..', '262 us ..', '524 us ..']
    assert ' 99 ####' in lines[2] and ' 50 ####' in lines[3]
    assert lines[-1].endswith('1 .')
    assert max(map(len, lines)) <= 100


def test_a_step_of_the_clock_is_seen_and_slewing_is_not() -> None:
    for step_ns, state in ((0, State.OK), (9_000_000, State.OK), (500_000_000, State.WARN),
                           (-3_600_000_000_000, State.WARN)):
        moments = iter([(1_000, 0), (1_000 + 10**10 + step_ns, 10**10)])
        assert wakeup.StepWatch(lambda: next(moments)).finding().state is state
    assert wakeup.StepWatch().finding().found.startswith('none in')


def test_the_measurement_for_real() -> None:
    shown: list[float] = []
    system = System(Wanted(priority=0, lock_memory=False))
    result = wakeup.measure(system, 0.6, shown.append)
    while not (result.machine.summary.count and result.kernel.summary.count):
        # Something else had the CPU all the time.
        shown.clear()
        result = wakeup.measure(system, 2 * result.seconds, shown.append)
    for side in (result.machine, result.kernel):
        assert sum(side.counts.values()) == side.summary.count
        assert side.summary.p50_ns <= side.summary.p99_ns <= side.summary.maximum_ns
    assert shown == sorted(shown) and all(0 <= part <= 1 for part in shown)
    assert result.refused == ()


def test_what_linux_refuses_is_named() -> None:
    result = wakeup.measure(System(Wanted(cpu=4000, priority=0, lock_memory=False)), 0.2)
    assert result.refused == ('CPU 4000',)


def test_a_measurement_that_breaks_is_told(monkeypatch) -> None:
    monkeypatch.setattr(wakeup, 'CHILD', 'rt_robot_os.tools.doctor.no_such_module')
    with pytest.raises(ProbeError, match='ended with code 1: .*no_such_module'):
        wakeup.measure(System(), 0.2)

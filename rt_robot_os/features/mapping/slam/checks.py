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

"""
Detect faults of scans and odometry before they corrupt a map.

Two scans between which the robot turned are compared unmodified, turned as odometry says, and
turned the other way: the best match reveals a laser that hangs upside down or does not turn.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats

#: Scans are compared by beams this far apart,
_STEP_RAD: Final = 0.026
#: between which the robot turned so much,
_TURN_LEAST_RAD: Final = 0.12
_TURN_MOST_RAD: Final = 0.5
#: went no further, and no more time passed.
_WAY_MOST_M: Final = 0.2
_AGE_MOST_NS: Final = 3 * NS_PER_S
#: A hypothesis covers turns this near to it; the right one has a cost lower by this factor.
_NEAR_RAD: Final = 0.05
_CLEARLY: Final = 0.6
#: Largest cost of a beam, in m.
_COST_MOST_M: Final = 0.5
#: Votes in a row that make a finding.
_VOTES: Final = 3
#: Motion of odometry below which the robot stands.
_STANDS_M: Final = 0.005
_STANDS_RAD: Final = 0.005
_STANDS_NS: Final = NS_PER_S // 2
#: Time in which a slow robot shows motion.
_CREEPS_NS: Final = 2 * NS_PER_S
#: Change of the scan of a standing robot at most, in m of the mean beam.
_CHANGED_M: Final = 0.25
#: Smallest share of valid beams; scans in a row below it.
_SEEN_LEAST: Final = 0.02
_BLIND_SCANS: Final = 5
#: Identical scans in a row, and the distance that the robot moved meanwhile.
_FROZEN_SCANS: Final = 10
_FROZEN_M: Final = 0.1
#: Scans over which the rate is measured; a drop below this share is reported.
_RATE_SCANS: Final = 20
_RATE_SHARE: Final = 0.5
#: After such a pause it is measured again.
_RATE_GAP_NS: Final = 2 * NS_PER_S
#: How long a single event is reported.
_REPORT_NS: Final = 10 * NS_PER_S


@dataclass
class _ReferenceScan:
    """A scan with which later ones are compared."""

    stamp_ns: int
    base: Floats
    ranges: Floats
    step: float


class ScanChecks:
    """
    Check scans and odometry, in the order of time.

    :ivar counts: how often each was found: ``upside_down``, ``laser_stands``, ``wheels_stand``,
        ``blind``, ``frozen``, ``two_lasers``, ``lengths`` (scans of another length than the one
        before).
    :ivar rejection_reason: why scans must be left out, as they would corrupt the map; empty: they
        need not.
    """

    def __init__(self, range_max_m: float) -> None:
        self.counts = dict.fromkeys(('upside_down', 'laser_stands', 'wheels_stand', 'blind',
                                     'frozen', 'two_lasers', 'lengths'), 0)
        self.rejection_reason = ''
        self._range_max_m = range_max_m
        self._reference: _ReferenceScan | None = None
        self._last: Scan | None = None
        self._votes = {'against': 0, 'still': 0, 'carried': 0}
        self._blind = self._same = 0
        self._repeats = False
        self._are_two = False
        self._same_base = np.zeros(3)
        self._stamps: list[int] = []
        self._scans: list[int] = []
        self._period_ns = self._best_period_ns = 0.0
        self._reports: dict[str, int] = {}

    def check(self, scan: Scan, base: Floats, left_out: int = 0, are_two: bool = False) -> None:
        """
        Check the next scan.

        :param base: shape (3,): ``base_link`` in the frame of odometry, at its stamp.
        :param left_out: scans since the last that were skipped.
        :param are_two: two lasers publish them, see :mod:`.two_lasers`.
        """
        self.counts['two_lasers'] += are_two and not self._are_two
        self._are_two = are_two
        self._update_rate(scan.stamp_ns, 1 + left_out)
        self._check_length(scan)
        self._check_blind(scan)
        self._check_frozen(scan, base)
        if self._blind or are_two:
            self._reference = None  # it shows no movement
        else:
            self._compare(scan, base)
        self.rejection_reason = self._defect()
        self._last = scan

    @property
    def odometry_is_wrong(self) -> bool:
        """Return whether the motion of the robot contradicts odometry."""
        return max(self._votes['still'], self._votes['carried']) >= _VOTES

    def warnings(self, stamp_ns: int) -> tuple[str, ...]:
        """Return the present problems, a line each; the worst first."""
        late = tuple(text for text, since_ns in self._reports.items()
                     if stamp_ns - since_ns < _REPORT_NS)
        found = ((self.rejection_reason,) if self.rejection_reason else ()) + late
        if self._best_period_ns and self._period_ns * _RATE_SHARE > self._best_period_ns:
            found += (f'scans arrive {NS_PER_S / self._period_ns:.1f} times a second, before '
                      f'{NS_PER_S / self._best_period_ns:.1f} times',)
        return found

    def _defect(self) -> str:
        if self._blind >= _BLIND_SCANS:
            return ('the laser sees nothing: it is covered, nothing is within its range, or '
                    'its ranges are not numbers')
        if self._same >= _FROZEN_SCANS:
            return ('the laser repeats the same scan while the robot moves: it is stuck')
        if self._are_two:
            return ('scans of two places alternate: two lasers publish on one topic; give each '
                    'its own topic')
        if self._votes['against'] >= _VOTES:
            return ('scans turn against odometry: the laser hangs upside down (roll of its '
                    'mounting_rad: 3.1416), or the wheels are swapped')
        if self._votes['still'] >= _VOTES:
            return ('scans stand still while odometry turns: the laser does not turn with the '
                    'robot, the wheels turn in the air, or stamps are wrong')
        if self._votes['carried'] >= _VOTES:
            return ('scans change while odometry stands still: an encoder is not connected, or '
                    'the robot is carried')
        return ''

    # ---- single scans ------------------------------------------------------------------------

    def _update_rate(self, stamp_ns: int, scans: int) -> None:
        stamps, counts = self._stamps, self._scans
        if stamps and not 0 < stamp_ns - stamps[-1] < _RATE_GAP_NS:
            stamps.clear()
            counts.clear()
            self._period_ns = 0.0
        stamps.append(stamp_ns)
        counts.append(scans)
        if len(stamps) > _RATE_SCANS:
            del stamps[0], counts[0]
            self._period_ns = (stamps[-1] - stamps[0]) / sum(counts[1:])
            if not self._are_two and (
                    not self._best_period_ns or self._period_ns < self._best_period_ns):
                self._best_period_ns = self._period_ns

    def _check_length(self, scan: Scan) -> None:
        last = self._last
        if last is not None and len(last.ranges) != len(scan.ranges):
            self.counts['lengths'] += 1
            for text in [each for each in self._reports if each.startswith('scans of')]:
                del self._reports[text]
            self._reports[
                f'scans of {len(scan.ranges)} beams after scans of {len(last.ranges)}: '
                'two lasers on one topic, or a driver that leaves beams out'] = scan.stamp_ns

    def _check_blind(self, scan: Scan) -> None:
        ranges = scan.ranges
        seen = np.isfinite(ranges) & (ranges > 0.0) & (ranges < self._range_max_m)
        if seen.mean() >= _SEEN_LEAST:
            self._blind = 0
            return
        self._blind += 1
        self.counts['blind'] += self._blind == _BLIND_SCANS

    def _check_frozen(self, scan: Scan, base: Floats) -> None:
        last = self._last
        if (last is None or not np.isfinite(scan.ranges).any()
                or not np.array_equal(last.ranges, scan.ranges, equal_nan=True)):
            self._same, self._same_base, self._repeats = 0, base, False
            return
        self._repeats = True
        moved = between(self._same_base, base)
        if math.hypot(moved[0], moved[1]) > _FROZEN_M or abs(moved[2]) > _FROZEN_M:
            self._same += 1
            self.counts['frozen'] += self._same == _FROZEN_SCANS

    # ---- pairs of scans -------------------------------------------------------------------

    def _thinned(self, scan: Scan) -> tuple[Floats, float]:
        """Return a subset of the beams, and the signed angle between them."""
        step = max(1, round(_STEP_RAD / abs(scan.angle_increment)))
        ranges = np.asarray(scan.ranges[::step], dtype=np.float64)
        return np.minimum(ranges, self._range_max_m), step * scan.angle_increment

    def _compare(self, scan: Scan, base: Floats) -> None:
        """Compare with an earlier scan, if one is suitable."""
        ranges, step = self._thinned(scan)
        reference = self._reference
        if (reference is None or len(reference.ranges) != len(ranges)
                or self._is_used_up(reference, scan.stamp_ns, base, ranges)):
            self._reference = _ReferenceScan(scan.stamp_ns, base, ranges, step)

    def _is_used_up(self, reference: _ReferenceScan, stamp_ns: int, base: Floats, ranges: Floats
                    ) -> bool:
        """Compare with an earlier scan if the motion allows it; return whether to replace it."""
        moved = between(reference.base, base)
        way, turn = math.hypot(moved[0], moved[1]), float(moved[2])
        age_ns = stamp_ns - reference.stamp_ns
        if way > _WAY_MOST_M or abs(turn) > _TURN_MOST_RAD or not 0 < age_ns < _AGE_MOST_NS:
            return True
        if abs(turn) >= _TURN_LEAST_RAD:
            if not self._repeats:  # a turn shows nothing with a laser that is stuck
                self._check_turn(reference, ranges, turn)
            return True
        if way < _STANDS_M and abs(turn) < _STANDS_RAD and age_ns >= _STANDS_NS:
            return self._check_standstill(reference, ranges, age_ns)
        return False

    def _check_turn(self, reference: _ReferenceScan, ranges: Floats, turn: float) -> None:
        costs = {what: self._cost_near(reference, ranges, by)
                 for what, by in (('with', turn), ('still', 0.0), ('against', -turn))}
        best, second, _ = sorted(costs, key=lambda what: costs[what])
        if costs[best] > _CLEARLY * costs[second]:
            return  # turning makes no difference in this room
        self._votes['carried'] = 0
        for what in ('still', 'against'):
            self._count_vote(what, what == best)

    def _check_standstill(self, reference: _ReferenceScan, ranges: Floats, age_ns: int) -> bool:
        # A person who walks by changes some beams, one who carries the robot all of them.
        has_changed = self._cost(reference.ranges, ranges, 0) > _CHANGED_M
        if not has_changed and age_ns < _CREEPS_NS:
            return False
        self._count_vote('carried', has_changed)
        return True

    def _count_vote(self, what: str, is_so: bool) -> None:
        self._votes[what] = min(self._votes[what] + 1, _VOTES) if is_so else 0
        name = {'against': 'upside_down', 'still': 'laser_stands', 'carried': 'wheels_stand'}[what]
        self.counts[name] += is_so and self._votes[what] == _VOTES and not self.rejection_reason

    def _cost_near(self, reference: _ReferenceScan, ranges: Floats, turn: float) -> float:
        """Return the lowest cost of turns near a given one."""
        step = reference.step
        low, high = sorted((round(-(turn - _NEAR_RAD) / step), round(-(turn + _NEAR_RAD) / step)))
        return min(self._cost(reference.ranges, ranges, shift) for shift in range(low, high + 1))

    @staticmethod
    def _cost(before: Floats, after: Floats, shift: int) -> float:
        """Return the mean deviation of beams that are shifted by a number of beams."""
        count = len(before) - abs(shift)
        first, second = max(0, -shift), max(0, shift)
        off = np.abs(before[first:first + count] - after[second:second + count])
        off = off[np.isfinite(off)]
        return float(np.minimum(off, _COST_MOST_M).mean()) if len(off) else math.inf

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
Fuse the marks in sight to one pose, and find marks with a wrong position on the map.

Several marks are averaged with weights: one seen from the side has less. Marks that contradict the
others are left out. Of two contradicting marks the wrong one is found over time: one that keeps
disagreeing with most of its neighbours is reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.stargazer.wire import CeilingMark
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.landmarks import CeilingLandmark

# How long the previous pose decides between two marks, and the largest speed since.
_MEMORY_NS: Final = NS_PER_S
_FASTEST_M_S: Final = 1.5
_FASTEST_RAD_S: Final = 2.5
# Comparisons of two marks that are enough for a decision, and the number at which old ones are
# dropped.
_ENOUGH: Final = 10
_MOST: Final = 200
# Limit of the pairs of marks that are seen together; a room has some dozens.
_MOST_PAIRS: Final = 4096


class LandmarkSighting(NamedTuple):
    """
    The pose of the sensor by one mark.

    :ivar x: in the map, in m.
    :ivar yaw: in rad.
    :ivar weight: 1 directly below the mark.
    """

    number: int
    x: float
    y: float
    yaw: float
    weight: float


class FusedPose(NamedTuple):
    """
    The fused pose of the sensor.

    :ivar weight: the sum of those of the marks.
    :ivar marks: the marks that were used.
    """

    x: float
    y: float
    yaw: float
    weight: float
    marks: tuple[int, ...]


def sighting(mark: CeilingMark, landmark: CeilingLandmark, angle_sign: int,
             angle_offset_rad: float, height_m: float) -> LandmarkSighting:
    """
    Transform the measurement of a mark to the map; safe in the loop.

    :param angle_sign: of the device's angle, -1 if it counts clockwise.
    :param angle_offset_rad: added to the angle.
    :param height_m: of the ceiling above the sensor, if the device does not send it.
    """
    x, y = mark.x_cm * 0.01, mark.y_cm * 0.01
    cosine, sine = math.cos(landmark.yaw), math.sin(landmark.yaw)
    height = mark.z_cm * 0.01 if mark.z_cm else height_m
    slope_squared = (x * x + y * y) / (height * height)
    return LandmarkSighting(
        mark.number,
        landmark.x + cosine * x - sine * y,
        landmark.y + sine * x + cosine * y,
        wrapped(landmark.yaw + angle_sign * math.radians(mark.angle_deg) + angle_offset_rad),
        1.0 / (1.0 + slope_squared))


@dataclass
class Consistency:
    """
    How often marks agreed with their neighbours; bounded.

    :ivar pairs: comparisons and disagreements of two marks, the smaller number first.
    """

    pairs: dict[tuple[int, int], list[int]] = field(default_factory=dict)

    def note(self, one: int, other: int, agree: bool) -> None:
        """Record a comparison of two marks."""
        if one == other:
            return
        key = (one, other) if one < other else (other, one)
        counts = self.pairs.get(key)
        if counts is None:
            if len(self.pairs) >= _MOST_PAIRS:
                return
            counts = self.pairs[key] = [0, 0]
        counts[0] += 1
        counts[1] += not agree
        if counts[0] > _MOST:
            counts[0] //= 2
            counts[1] //= 2

    def suspects(self) -> list[int]:
        """Return the marks that keep disagreeing with more than half of their neighbours."""
        neighbours: dict[int, int] = {}
        wrong: dict[int, int] = {}
        for pair, (count, disagreed) in self.pairs.items():
            if count >= _ENOUGH:
                for mark in pair:
                    neighbours[mark] = neighbours.get(mark, 0) + 1
                    wrong[mark] = wrong.get(mark, 0) + (disagreed > count // 2)
        return sorted(mark for mark, count in neighbours.items() if 2 * wrong[mark] > count)


class Fuser:
    """
    Fuses the marks in sight to one pose.

    :ivar consistency: of the marks with each other.
    :ivar contradicted: sentences whose marks contradicted each other so that none was used.
    :ivar left_out: marks that were left out because others contradicted them.
    """

    def __init__(self, tolerance_m: float, tolerance_rad: float) -> None:
        """Store the largest differences of agreeing marks."""
        self.consistency = Consistency()
        self.contradicted = 0
        self.left_out = 0
        self._tolerance_m = tolerance_m
        self._tolerance_rad = tolerance_rad
        self._last: FusedPose | None = None
        self._last_ns = 0
        self._suspects: frozenset[int] = frozenset()

    def forget(self) -> None:
        """Reset the previous pose; the consistency of the marks is kept."""
        self._last = None

    def learn(self) -> list[int]:
        """Update the suspected marks; not with each sentence, because it evaluates all pairs."""
        found = self.consistency.suspects()
        self._suspects = frozenset(found)
        return found

    def fuse(self, sightings: Sequence[LandmarkSighting], now_ns: int) -> FusedPose | None:
        """
        Fuse to one pose; safe in the loop.

        :param sightings: at least one.
        :return: None if the marks contradict each other without a majority or a previous pose.
        """
        last = self._last
        if last is not None and not 0 <= now_ns - self._last_ns <= _MEMORY_NS:
            last = None
        if last is not None and not any(each.number in last.marks for each in sightings):
            for each in sightings:
                self.consistency.note(each.number, last.marks[0], self._near(each, last, now_ns))
        used = sightings if len(sightings) == 1 else self._agreeing(sightings, last, now_ns)
        if not used:
            self.contradicted += 1
            return None
        self.left_out += len(sightings) - len(used)
        self._last, self._last_ns = _mean(used), now_ns
        return self._last

    def _agreeing(self, sightings: Sequence[LandmarkSighting], last: FusedPose | None, now_ns: int
                  ) -> Sequence[LandmarkSighting]:
        """Return the largest agreeing group, or the one that agrees with the previous pose."""
        size = len(sightings)
        groups: list[list[LandmarkSighting]] = [[each] for each in sightings]
        for i in range(size):
            for j in range(i + 1, size):
                one, other = sightings[i], sightings[j]
                agree = self._agree(one, other, 0.0)
                self.consistency.note(one.number, other.number, agree)
                if agree:
                    groups[i].append(other)
                    groups[j].append(one)
        most = max(map(len, groups))
        if most == size:
            return sightings
        largest = [group for group in groups if len(group) == most]
        if most > size - most:
            return largest[0]
        trusted = [group for group in largest if group[0].number not in self._suspects]
        if len(trusted) == 1:
            return trusted[0]
        if last is not None:
            for group in trusted or largest:
                if self._near(group[0], last, now_ns):
                    return group
        return ()

    def _near(self, each: LandmarkSighting, last: FusedPose, now_ns: int) -> bool:
        return self._agree(each, last, (now_ns - self._last_ns) / NS_PER_S)

    def _agree(self, one: LandmarkSighting, other: LandmarkSighting | FusedPose,
               seconds: float) -> bool:
        return (math.hypot(one.x - other.x, one.y - other.y)
                <= self._tolerance_m + _FASTEST_M_S * seconds
                and abs(wrapped(one.yaw - other.yaw))
                <= self._tolerance_rad + _FASTEST_RAD_S * seconds)


def _mean(sightings: Sequence[LandmarkSighting]) -> FusedPose:
    """Average positions, and angles on the circle."""
    total = x = y = sine = cosine = 0.0
    for each in sightings:
        weight = each.weight
        total += weight
        x += weight * each.x
        y += weight * each.y
        sine += weight * math.sin(each.yaw)
        cosine += weight * math.cos(each.yaw)
    return FusedPose(x / total, y / total, math.atan2(sine, cosine), total,
                     tuple(each.number for each in sightings))

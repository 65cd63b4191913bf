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

"""Two lasers on one topic are told, and one is not, wherever it is driven."""

from __future__ import annotations

from collections.abc import Iterable
import math

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

pytest.importorskip('scipy', reason='SciPy is not installed')

from rt_robot_os.features.mapping.slam.transforms import Floats  # noqa: E402
from rt_robot_os.features.mapping.slam.two_lasers import TwoLasers  # noqa: E402


def room(x: float, yaw: float, beams: int = 360, seed: int = 0) -> Floats:
    """Return what a laser sees of a room of 6 m by 4 m, all around."""
    bearings = yaw + np.linspace(-math.pi, math.pi, beams, endpoint=False)
    along, across = np.cos(bearings), np.sin(bearings)
    with np.errstate(divide='ignore', over='ignore'):
        ranges = np.minimum(np.where(along > 0, 4.0 - x, 2.0 + x) / np.abs(along),
                            np.where(across > 0, 1.5, 2.5) / np.abs(across))
    return ranges + np.random.default_rng(seed).normal(0.0, 0.01, beams)


def told(scans: Iterable[Floats]) -> list[bool]:
    lasers = TwoLasers()
    return [lasers.update(ranges) for ranges in scans]


def test_two_that_send_by_turns_are_told_within_a_second_until_one_is_gone() -> None:
    before = [room(0.0, 0.0, seed=number) for number in range(20)]
    both = [room(0.02 * number, math.pi * (number % 2), seed=number) for number in range(20)]
    after = [room(0.4, 0.0, seed=number) for number in range(20)]
    said = told([*before, *both, *after])
    assert not any(said[:20]) and all(said[30:40]) and not any(said[54:])


@given(st.floats(-0.2, 0.2), st.floats(-0.1, 0.1))
def test_one_is_one_however_it_moves(turn_rad: float, step_m: float) -> None:
    assert not any(told(room(step_m * number, turn_rad * number, seed=number)
                        for number in range(20)))


@pytest.mark.parametrize('value', [math.nan, math.inf, 0.3])
def test_one_that_is_covered_for_moments_is_one(value: float) -> None:
    scans = [room(0.0, 0.0, seed=number) for number in range(60)]
    for number in range(10, 50, 7):
        scans[number] = np.full(360, value)
    assert not any(told(scans))


def test_lasers_of_other_lengths_and_empty_scans_are_no_evidence() -> None:
    scans = [room(0.0, 0.0, 360 if number % 2 else 180) for number in range(40)]
    assert not any(told([*scans, np.empty(0), np.full(360, math.nan)]))

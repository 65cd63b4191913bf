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
Evidence for each cell: how many scans ended in it, passed it, or passed without an echo.

These are counts, not clamped log-odds: what was added can be subtracted again at any time. The
log-odds, as in S. Thrun, W. Burgard and D. Fox, Probabilistic Robotics, 2005, chapter 9, are those
of the counts when they are read.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.rays import ECHOLESS
from rt_robot_os.features.mapping.slam.rays import HIT
from rt_robot_os.features.mapping.slam.rays import PASSED
from rt_robot_os.motion.grid_map import FREE
from rt_robot_os.motion.grid_map import OCCUPIED
from rt_robot_os.motion.grid_map import UNKNOWN

#: Three counts in one number: of scans that passed, that hit, and that passed without an echo.
Counts = npt.NDArray[np.int64]

_BITS: Final = 20
_COUNT: Final = (1 << _BITS) - 1
#: What each code of a footprint adds to a cell.
WEIGHTS: Final[Counts] = np.zeros(4, np.int64)
WEIGHTS[PASSED], WEIGHTS[HIT], WEIGHTS[ECHOLESS] = 1, 1 << _BITS, 1 << 2 * _BITS

_LOG_ODDS_HIT: Final = 0.85
_LOG_ODDS_PASSED: Final = -0.4
#: Log-odds above which a cell is occupied, and below which it is free.
_WALL: Final = 0.5
_CLEAR: Final = -0.3
#: A cell with this many hits stays occupied up to this many passes for each hit: glass reflects
#: from ahead, and is passed from the side.
_HITS_SURE: Final = 4
_PASSED_A_HIT: Final = 5
#: Scans without an echo that make a cell free without other evidence.
_ECHOLESS_FREE: Final = 2


def cells_of(counts: Counts) -> npt.NDArray[np.int8]:
    """
    Return the state of cells for their counts.

    :param counts: of any shape.
    :return: of that shape: ``UNKNOWN``, ``FREE`` or ``OCCUPIED`` of a grid map.
    """
    passed = (counts & _COUNT).astype(np.float32)
    hits = (counts >> _BITS & _COUNT).astype(np.float32)
    log_odds = np.float32(_LOG_ODDS_HIT) * hits + np.float32(_LOG_ODDS_PASSED) * passed
    wall = (log_odds > _WALL) | ((hits >= _HITS_SURE) & (passed <= _PASSED_A_HIT * hits))
    cells = np.full(counts.shape, UNKNOWN, np.int8)
    cells[(log_odds < _CLEAR) | ((counts & (_COUNT << _BITS | _COUNT) == 0)
                                 & (counts >> 2 * _BITS >= _ECHOLESS_FREE))] = FREE
    cells[wall] = OCCUPIED
    return cells

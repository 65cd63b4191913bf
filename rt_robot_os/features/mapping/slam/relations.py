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
The accuracy of a map, by known relations between poses.

R. Kummerle and others, On measuring the accuracy of SLAM algorithms, Autonomous Robots 2009: the
error of each relation is the difference between the known relative pose and the estimated one, so
a single wrong turn affects one relation, not all that follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats

_COLUMNS = 'i,j,dx,dy,dyaw'


@dataclass(frozen=True)
class Relations:
    """
    Known relative poses.

    :ivar first: indices of poses; ``second`` is at ``relative`` in their frames.
    :ivar relative: shape (n, 3).
    """

    first: npt.NDArray[np.int64]
    second: npt.NDArray[np.int64]
    relative: Floats


def read_relations(path: Path) -> Relations:
    """
    Read a CSV with the columns i, j, dx, dy, dyaw.

    :raises ConfigError: it is malformed.
    """
    try:
        head, *lines = path.read_text().splitlines() or ['']
        if head.strip() != _COLUMNS:
            raise ConfigError([f'{path}:1: the first line must be {_COLUMNS}'])
        found = np.array([[float(each) for each in line.split(',')] for line in lines
                          if line.strip()])
    except (OSError, UnicodeDecodeError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError([f'{path}: {getattr(error, "strerror", None) or error}']) from error
    if found.ndim != 2 or found.shape[1:] != (5,) or not np.isfinite(found).all():
        raise ConfigError([f'{path}: rows of five finite numbers are relations'])
    indices = found[:, :2].astype(np.int64)
    if (indices < 0).any() or (indices != found[:, :2]).any():
        raise ConfigError([f'{path}: i and j are indices of scans, from 0'])
    return Relations(indices[:, 0], indices[:, 1], found[:, 2:])


def compare(poses: Floats, relations: Relations) -> dict[str, float | int | list[int]]:
    """
    Return the errors of poses on relations, in m and rad.

    :param poses: shape (n, 3).
    :return: ``mean_m``, ``mean_rad``, ``largest_m`` and which relation that is (``largest``),
        ``loops_mean_m`` of those that are no neighbours, ``relations``, ``loops``.
    :raises ConfigError: a relation refers to a missing pose.
    """
    highest = int(max(relations.first.max(), relations.second.max()))
    if highest >= len(poses):
        raise ConfigError([f'there is a relation of scan {highest}, but there are {len(poses)} '
                           'poses: are they of the same log?'])
    found = between(poses[relations.first], poses[relations.second])
    errors = between(relations.relative, found)
    far, turned = np.hypot(errors[:, 0], errors[:, 1]), np.abs(errors[:, 2])
    loops = np.abs(relations.second - relations.first) > 1
    worst = int(far.argmax())
    return {'relations': len(far), 'loops': int(loops.sum()), 'mean_m': float(far.mean()),
            'mean_rad': float(turned.mean()), 'largest_m': float(far.max()),
            'largest': [int(relations.first[worst]), int(relations.second[worst])],
            'loops_mean_m': float(far[loops].mean()) if loops.any() else 0.0}

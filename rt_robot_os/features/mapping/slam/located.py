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

"""The pose of a scan: the result of a mapper or a localiser."""

from __future__ import annotations

from dataclasses import dataclass

from rt_robot_os.features.mapping.slam.transforms import Floats


@dataclass(frozen=True)
class Located:
    """
    The pose of a scan.

    :ivar pose: shape (3,): of the laser at the scan's stamp, on the map as it is now.
    :ivar covariance: shape (3, 3), in m and rad, along the axes of the map.
    :ivar share: of the scan's points that lie on lines of the map; 0 when none was compared.
    :ivar is_lost: the scan matched nowhere, and odometry was used.
    :ivar is_kept: it has become a keyframe.
    :ivar correction: shape (3,): by how much the map moved under the robot; what was at a pose
        ``p`` is now at ``composed(correction, p)``. None when it did not.
    """

    pose: Floats
    covariance: Floats
    share: float = 0.0
    is_lost: bool = False
    is_kept: bool = False
    correction: Floats | None = None

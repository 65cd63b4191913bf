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

"""The state that is saved with the map, so that mapping resumes after any end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rt_robot_os.features.mapping.process.commands import read_map
from rt_robot_os.features.mapping.robot_pose import LoadedMap
from rt_robot_os.features.mapping.settings import LOCALIZATION
from rt_robot_os.features.mapping.settings import MappingSettings
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats


@dataclass(frozen=True)
class Resumption:
    """
    A map to continue with.

    :ivar base: shape (3,): pose of ``base_link`` on it; None when it was unknown.
    :ivar odometry: shape (3,): pose of odometry then.
    :ivar run_id: of the core at that time.
    :ivar loaded: path of the map that was loaded; empty when it was made here.
    """

    known: LoadedMap
    mode: str
    base: Floats | None
    odometry: Floats
    run_id: str
    loaded: str
    text: str

    @classmethod
    def of(cls, graph: MapGraph, extra: Mapping[str, Any], settings: MappingSettings
           ) -> Resumption | None:
        """
        Parse a saved state.

        :return: None when the settings ask for another map now.
        :raises ConfigError: the map that was loaded cannot be read any more.
        :raises ValueError: it is malformed.
        """
        wanted = _wanted(settings)
        if extra.get('settings') != wanted:
            return None
        mode, loaded = str(extra.get('mode')), str(extra.get('loaded', ''))
        base = None if extra.get('base') is None else _pose(extra['base'])
        if graph.keyframes:
            known, text = LoadedMap(graph), f'{len(graph.keyframes)} scans of the last run'
        elif loaded:
            text, known = read_map(Path(loaded))
        else:
            return None
        return cls(known, mode, base, _pose(extra.get('odometry')), str(extra.get('run_id', '')),
                   loaded, text)

    @staticmethod
    def extra(settings: MappingSettings, mode: str, loaded: str, run_id: str,
              base: Floats | None, odometry: Floats | None) -> dict[str, Any]:
        """Return the values to save."""
        return {'settings': _wanted(settings), 'mode': mode, 'loaded': loaded, 'run_id': run_id,
                'base': None if base is None else base.tolist(),
                'odometry': None if odometry is None else odometry.tolist()}

    def base_at(self, odometry: Floats) -> Floats:
        """Return the pose of the robot now, for the pose of the same odometry now."""
        if self.base is None:
            raise ValueError('the saved state has no pose of the robot')
        return composed(self.base, between(self.odometry, odometry))


def _wanted(settings: MappingSettings) -> list[str]:
    """Return the settings that choose the map: the state is valid for the same ones only."""
    return [settings.mode, settings.map_file if settings.mode == LOCALIZATION else '']


def _pose(given: Any) -> Floats:
    pose = np.zeros(3) if given is None else np.array(given, dtype=np.float64)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError(f'{given} is not a pose')
    return pose

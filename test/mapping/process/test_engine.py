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

"""A map that grows, one that is there, and who does not know where it is."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.slam.drives import Drive
from mapping_robot import sightings_of
import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.engine import Engine
from rt_robot_os.features.mapping.robot_pose import copy_of
from rt_robot_os.features.mapping.robot_pose import LoadedMap
from rt_robot_os.features.mapping.robot_pose import RobotPose
from rt_robot_os.features.mapping.scan_intake import PosedScan
from rt_robot_os.features.mapping.settings import LOCALIZATION
from rt_robot_os.features.mapping.settings import MAPPING
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats


def off_m(place: RobotPose, truth: Floats) -> float:
    return float(np.hypot(*(place.pose - truth)[:2]))


def fed(engine: Engine, sightings: list[PosedScan]) -> list[RobotPose | None]:
    """Give an engine scans, and the time that it has between them."""
    places = []
    for each in sightings:
        places.append(engine.add_scan(each))
        for _ in range(20):
            if not engine.process_pending():
                break
    return places


def known_of(engine: Engine) -> LoadedMap:
    return LoadedMap(copy_of(engine.graph), engine.grid)


def test_the_map_has_the_frame_in_which_it_was_begun(mapped: Engine, flat: Drive) -> None:
    known = mapped.last_pose
    assert known is not None and mapped.state == MAPPING
    assert np.abs(between(known[0], flat.truth[-1])).max() < 0.06
    truth, made = flat.grid, mapped.grid
    rows, columns = np.nonzero(made.occupied_mask())
    near = [any(truth.occupied(x + dx, y + dy) for dx in (-0.1, 0.0, 0.1)
                for dy in (-0.1, 0.0, 0.1))
            for x, y in (made.centre(int(r), int(c)) for r, c in zip(rows, columns))]
    assert len(near) > 300 and np.mean(near) > 0.95


def test_it_finds_itself_on_a_map_and_says_nothing_before(
        engine: Engine, mapped: Engine, flat: Drive, sightings: list[PosedScan]) -> None:
    engine.mode = LOCALIZATION
    engine.use_map(known_of(mapped), None)
    places = fed(engine, sightings[40:])
    said = [(place, truth) for place, truth in zip(places, flat.truth[40:]) if place is not None]
    assert engine.found == 1 and said[0][0].is_found
    assert max(off_m(place, truth) for place, truth in said if place.is_sure) < 0.2
    assert engine.state == 'localisation'
    known, grown = mapped.graph, engine.graph
    assert known is not None and grown is not None
    assert len(grown.keyframes) == len(known.keyframes)


def test_a_robot_that_does_not_stand_where_it_stood_looks_for_itself(
        engine: Engine, mapped: Engine, flat: Drive, sightings: list[PosedScan]) -> None:
    engine.use_map(known_of(mapped), lambda sighting: flat.truth[-1])
    places = fed(engine, sightings[:60])
    sure = [(place, truth) for place, truth in zip(places, flat.truth)
            if place is not None and place.is_sure]
    assert engine.found == 1 and engine.mode == MAPPING
    assert max(off_m(place, truth) for place, truth in sure) < 0.2


def test_it_goes_on_with_the_map_of_before_where_odometry_says(
        engine: Engine, mapped: Engine, flat: Drive, sightings: list[PosedScan]) -> None:
    engine.use_map(known_of(mapped), lambda sighting: flat.truth[-20])
    engine.trust_next_hint()
    places = fed(engine, sightings[-20:])
    assert places[0] is not None and places[0].is_sure and engine.found == 0
    assert engine.state == MAPPING


def test_somebody_says_where_it_is(engine: Engine, mapped: Engine, flat: Drive,
                                   sightings: list[PosedScan]) -> None:
    engine.mode = LOCALIZATION
    engine.use_map(known_of(mapped), lambda sighting: flat.truth[-1])
    engine.add_scan(sightings[0])
    engine.relocate(sightings[0], flat.truth[0] + np.array((0.1, -0.1, 0.05)))
    place = engine.add_scan(sightings[1])
    assert place is not None and place.is_sure and off_m(place, flat.truth[1]) < 0.1


def test_a_laser_upside_down_is_told_and_nothing_more_is_mapped(engine: Engine, flat: Drive
                                                                ) -> None:
    places = fed(engine, sightings_of(flat, mirrored=True))
    assert 'upside down' in engine.state and places[-1] is None
    graph = engine.graph
    assert graph is not None and len(graph.keyframes) < 15


def test_one_that_is_covered_is_told_and_it_goes_on_when_it_sees_again(
        engine: Engine, flat: Drive, sightings: list[PosedScan]) -> None:
    fed(engine, sightings[:30])
    keyframes = len(engine.graph.keyframes) if engine.graph else 0
    blind = [PosedScan(each.scan.__class__(
        each.scan.stamp_ns, each.scan.odometry, np.full(180, np.inf), each.scan.angle_min,
        each.scan.angle_increment), each.base, each.mount) for each in sightings[30:40]]
    places = fed(engine, blind)
    assert engine.state.startswith('lost: the laser sees nothing') and places[-1] is None
    places = fed(engine, sightings[40:])
    assert engine.graph is not None and len(engine.graph.keyframes) > keyframes
    last = places[-1]
    assert last is not None and last.is_sure and off_m(last, flat.truth[-1]) < 0.1


@pytest.mark.parametrize('mode', [MAPPING, LOCALIZATION])
def test_odometry_that_was_cut_is_not_believed_before_scans_say_so(
        engine: Engine, flat: Drive, sightings: list[PosedScan], mode: str) -> None:
    """Its driver was started again in a silence: where it was is 0 now, 2.5 m away."""
    fed(engine, sightings[:60])
    engine.set_mode(mode)
    graph = engine.graph
    assert graph is not None
    keyframes = len(graph.keyframes)
    off = np.array((2.0, -1.5, 0.4))
    moved = [replace(each, base=composed(off, each.base), is_cut=number == 0,
                     scan=replace(each.scan, odometry=composed(off, each.scan.odometry)))
             for number, each in enumerate(sightings[60:110])]
    places = fed(engine, moved[:5])
    assert not any(each is not None and each.is_sure for each in places)
    assert len(graph.keyframes) == keyframes
    places = fed(engine, moved[5:])
    sure = [(place, truth) for place, truth in zip(places, flat.truth[65:])
            if place is not None and place.is_sure]
    assert len(sure) > 20 and max(off_m(place, truth) for place, truth in sure) < 0.2
    assert engine.mode == mode


def test_odometry_that_was_cut_and_is_right_is_believed_soon(
        engine: Engine, flat: Drive, sightings: list[PosedScan]) -> None:
    fed(engine, sightings[:60])
    places = fed(engine, [replace(sightings[60], is_cut=True), *sightings[61:66]])
    assert engine.found == 0 and engine.state == MAPPING
    assert places[-1] is not None and places[-1].is_sure
    assert off_m(places[-1], flat.truth[65]) < 0.05


def test_a_grid_alone_cannot_grow(engine: Engine, mapped: Engine) -> None:
    engine.use_map(LoadedMap(None, mapped.grid), None)
    assert engine.mode == LOCALIZATION
    with pytest.raises(ConfigError, match='has no graph'):
        engine.set_mode(MAPPING)


def test_paused_it_says_nothing(engine: Engine, sightings: list[PosedScan]) -> None:
    engine.is_paused = True
    assert fed(engine, sightings[:3]) == [None] * 3
    assert engine.state == 'paused' and not engine.drawing.version

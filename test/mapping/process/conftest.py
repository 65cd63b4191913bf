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

"""A short drive through the flat, its map, and a core that hears of it."""

from __future__ import annotations

from collections.abc import Iterator

from processes import in_a_folder
import pytest

pytest.importorskip('scipy', reason='SciPy is not installed')
pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

from mapping_robot import Beside  # noqa: E402, I100
from mapping_robot import sightings_of  # noqa: E402

from benchmarks.slam.drives import Drive  # noqa: E402, I100
from benchmarks.slam.drives import flat_drive  # noqa: E402
from benchmarks.slam.drives import FLAT_WAY  # noqa: E402
from rt_robot_os.features.mapping.engine import Engine  # noqa: E402
from rt_robot_os.features.mapping.scan_intake import PosedScan  # noqa: E402
from rt_robot_os.features.mapping.settings import MappingSettings  # noqa: E402


@pytest.fixture(scope='session')
def flat() -> Drive:
    """Give some 6 m through the flat, seen by a laser in the middle of the robot."""
    return flat_drive(way=FLAT_WAY[:5], speed_m_s=0.5, beams=180, laser=(0.0, 0.0, 0.0))


@pytest.fixture(scope='session')
def sightings(flat: Drive) -> list[PosedScan]:
    return sightings_of(flat)


@pytest.fixture
def engine(flat: Drive) -> Engine:
    """Give one that begins where the robot truly is."""
    return Engine(MappingSettings(), lambda sighting: flat.truth[0])


@pytest.fixture(scope='session')
def mapped(flat: Drive, sightings: list[PosedScan]) -> Engine:
    """Give one that has mapped the drive; it is not to be changed."""
    made = Engine(MappingSettings(), lambda sighting: flat.truth[0])
    for each in sightings:
        made.add_scan(each)
    made.finish_drawing()
    return made


@pytest.fixture(scope='module')
def beside() -> Iterator[Beside]:
    with in_a_folder(Beside) as core:
        core.start()
        yield core

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
The attitude filters on recordings of real sensors, beside what is known without them.

Bounds are about half as much again as what was measured (docs/attitude.md).
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.attitude_comparison import known
from benchmarks.attitude_comparison import recordings
from benchmarks.attitude_comparison.errors import errors_of
from benchmarks.attitude_comparison.errors import headings
from benchmarks.attitude_comparison.errors import tilts
from benchmarks.attitude_comparison.peers import Peer
from benchmarks.attitude_comparison.peers import PEERS
from benchmarks.attitude_comparison.recordings import Recording
import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError

OURS = [peer for peer in PEERS if peer.name in ('mahony', 'vqf')]


@pytest.fixture(params=OURS, ids=[f'{peer.name}-{peer.axes}' for peer in OURS])
def peer(request: pytest.FixtureRequest) -> Peer:
    one: Peer = request.param
    if one.package:
        pytest.importorskip(one.package, reason=f'{one.package} is not installed '
                                                f'(pip install {one.package})')
    return one


@pytest.fixture(scope='module')
def hand_moved(data_dir: Path) -> Recording:
    path = data_dir / 'imu' / 'xio_sensor_data.csv'
    if not path.is_file():
        pytest.skip(f'no recording {path}')
    return recordings.xio(path)


def test_a_sensor_moved_by_hand_spun_and_near_a_magnet(hand_moved: Recording, peer: Peer) -> None:
    turned = peer.run(hand_moved)
    assert np.linalg.norm(turned, axis=1) == pytest.approx(np.ones(len(turned)), abs=1e-9)
    found = known.find(hand_moved, turned, peer.axes)
    assert found.heading < 2.5
    assert found.inclination < 0.4
    assert found.spun < 4.5
    assert found.magnet < 0.5


# Total and inclination in degrees, of the trials that a copy of a part of BROAD may have.
BROAD = {
    '02_undisturbed_slow_rotation_B': (2.3, 0.8),
    '08_undisturbed_fast_rotation_with_breaks_A': (6.0, 3.1),
    '16_undisturbed_fast_translation_B': (1.4, 1.1),
    '29_disturbed_stationary_magnet_B': (3.8, 1.6),
    '33_disturbed_attached_magnet_2cm': (5.6, 1.0),
}


@pytest.mark.parametrize('name', BROAD)
@pytest.mark.parametrize('peer', [one for one in OURS if one.axes == 9], indirect=True,
                         ids=lambda one: one.name)
def test_a_trial_of_broad(name: str, peer: Peer, data_dir: Path) -> None:
    folder = data_dir / 'imu' / 'broad'
    files = {path.stem: path for path in recordings.broad_files(folder)}
    if name not in files:
        pytest.skip(f'no trials of BROAD (github.com/dlaidig/broad) at {folder}')
    try:
        recording = recordings.broad(files[name])
    except ConfigError as error:
        pytest.skip(str(error))
    reference = recording.reference
    assert reference is not None
    errors = errors_of(peer.run(recording), reference, recording.counted)
    total, inclination = BROAD[name]
    assert errors.total < total
    assert errors.inclination < inclination
    assert errors.heading <= errors.total


def test_errors_are_those_of_turns_that_are_known() -> None:
    # Turned by a quarter about up, by 60 degrees about a level axis, and by both.
    half = np.radians(30)
    upright = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    level = (np.sin(half), 0.0, 0.0, np.cos(half))
    none = (0.0, 0.0, 0.0, 1.0)
    reference = np.array([none])
    counted = np.ones(1, np.bool_)
    about_up = errors_of(np.array([upright]), reference, counted)
    assert (about_up.total, about_up.heading, about_up.inclination) == pytest.approx((90, 90, 0))
    tilted = errors_of(np.array([level]), reference, counted)
    assert (tilted.total, tilted.heading, tilted.inclination) == pytest.approx((60, 0, 60))
    assert headings(np.array([none, upright])) == pytest.approx([0, 90])
    assert tilts(np.array([none, level])) == pytest.approx([0, 60])


def test_what_the_cameras_lost_and_what_does_not_count_is_left_out() -> None:
    turned = np.array([[0.0, 0.0, 0.0, 1.0]] * 3)
    reference = np.array([[np.nan] * 4, [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
    errors = errors_of(turned, reference, np.array([True, True, False]))
    assert (errors.total, errors.heading, errors.inclination) == pytest.approx((0, 0, 0))


def test_a_file_that_is_no_trial_is_told(tmp_path: Path) -> None:
    assert recordings.broad_files(tmp_path) == []
    for name in ('01_a.mat', '01_a.hdf5', '02_b.mat', 'notes.mat'):
        (tmp_path / name).touch()
    assert [path.name for path in recordings.broad_files(tmp_path)] == ['01_a.hdf5', '02_b.mat']

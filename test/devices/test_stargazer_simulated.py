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

"""The StarGazer's driver with its simulated device, with the vendor's timing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import math
from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.devices.stargazer.driver import StarGazer
from rt_robot_os.devices.stargazer.setup import PAUSE_NS
from rt_robot_os.devices.stargazer.simulated import SimulatedStarGazer
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.world.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing import Rig
from rt_robot_os.testing import rig
from rt_robot_os.testing import settings_of

MS = 1_000_000
MARKS = ['1: 0 0 0', '2: 1.5 0 1.0', '3: 0 1.5 -0.5']


@contextmanager
def connected(folder: Path, sim: dict[str, Any] | None = None, **changes: Any) -> Iterator[Rig]:
    with rig(folder, SimulatedStarGazer, StarGazer, sim={'landmarks': MARKS, **(sim or {})},
             landmarks=MARKS, **changes) as made:
        yield made


def run(made: Rig, milliseconds: int) -> list[int]:
    """Let time pass, the driver at 100 Hz; give the moments of the bytes that it sent."""
    sent: list[int] = []
    port: Any = made.device
    write = port._port.write

    def noting(data: bytes) -> None:
        sent.extend([made.now_ns] * len(data))
        write(data)

    port._port.write = noting
    made.run(milliseconds, 10.0, lambda now_ns: made.device.write(now_ns))
    port._port.write = write
    return sent


def errors(made: Rig) -> list[tuple[float, float]]:
    """Return by how much each pose is wrong, in m and rad."""
    found = []
    simulated: Any = made.simulated
    for sample, stamp in zip(made.publishers[0].samples, made.publishers[0].stamps):
        # The sentence took its time on the line; the sample is of the grid before.
        period = round(1e9 / simulated.rate_hz)
        at = (stamp - simulated.start_ns) // period * period / 1e9
        x, y, heading = simulated.base_pose(at)
        pose = sample.pose.pose
        found.append((math.hypot(pose.position.x - x, pose.position.y - y),
                      abs(wrapped(yaw_of(0, 0, pose.orientation.z, pose.orientation.w)
                                  - heading))))
    return found


@pytest.mark.parametrize('form', ['multi', 'single', 'old'])
@pytest.mark.parametrize('sign', [-1, 1])
def test_without_noise_the_pose_is_that_of_the_world(
        tmp_path: Path, form: str, sign: int) -> None:
    with connected(tmp_path, {'form': form, 'noise': 0.0, 'angle_sign': sign},
                   angle_sign=sign) as made:
        run(made, 2000)
        found = errors(made)
    assert len(found) >= 38
    assert max(error for error, _ in found) < 0.002
    assert max(error for _, error in found) < 0.01


def test_noise_is_that_of_the_settings(tmp_path: Path) -> None:
    with connected(tmp_path, {'form': 'single', 'circle_s': 1e4}) as made:
        run(made, 10_000)
        found = errors(made)
    rms = math.sqrt(sum(error ** 2 for error, _ in found) / len(found))
    assert 0.011 < rms < 0.018  # 1 cm in each of x and y
    turn = math.sqrt(sum(error ** 2 for _, error in found) / len(found))
    assert math.radians(0.8) < turn < math.radians(1.3)


def test_the_set_up_keeps_the_pauses_and_writes_only_what_differs(tmp_path: Path) -> None:
    with connected(tmp_path, configure=True, mark_type='HLD2L', mark_mode='Alone',
                   mark_height_m=2.4, height_mode='fixed') as made:
        simulated: Any = made.simulated
        sent = run(made, 12_000)
        assert all(after - before >= PAUSE_NS for before, after in zip(sent, sent[1:]))
        assert PAUSE_NS >= 50 * MS
        assert simulated.lost_bytes == 0
        assert (simulated.parameters['MarkType'], simulated.flash_writes) == ('HLD2L', 1)
        assert made.device.is_set_up()
        assert made.publishers[0].samples
        made.reopen()
        run(made, 9_000)
        assert made.device.is_set_up()
        assert simulated.flash_writes == 1


def test_commands_that_are_missed_are_repeated(tmp_path: Path) -> None:
    with connected(tmp_path, {'miss_probability': 0.6, 'seed': 3}, configure=True) as made:
        run(made, 12_000)
        assert made.device.is_set_up()
        assert made.device.statistics().samples > 10


def test_the_map_is_built_once(tmp_path: Path) -> None:
    with connected(tmp_path, configure=True, procedure='map_building', mark_mode='Map',
                   reference_id=2) as made:
        simulated: Any = made.simulated
        run(made, 9_000)
        assert made.device.statistics().more['mode'] == 'building a map'
        run(made, 5_000)
        assert 'mode' not in made.device.statistics().more
        first = len(made.publishers[0].samples)
        assert first > 10
        made.reopen()
        run(made, 5_000)
        assert made.device.is_set_up() and simulated.mode == 'I'
        # It reports all positions below mark 2 now; a turned reference lets the noise of its
        # angle through, no more.
        assert max(error for error, _ in errors(made)[first // 2:]) < 0.2


def test_a_mark_that_hangs_elsewhere_is_named_and_does_no_harm(tmp_path: Path) -> None:
    with connected(tmp_path, {'moved_id': 3, 'moved_m': 0.8, 'range_m': 3.0}) as made:
        run(made, 8_000)
        assert made.device.statistics().more['disagreeing_mark_ids'] == '3'
        assert max(error for error, _ in errors(made)) < 0.1


def test_marks_that_are_taken_for_others_are_left_out(tmp_path: Path) -> None:
    with connected(tmp_path, {'outlier_probability': 0.1, 'range_m': 3.0}) as made:
        run(made, 8_000)
        found = sorted(error for error, _ in errors(made))
        more = made.device.statistics().more
        assert int(more['marks_left_out']) > 10
        assert 'disagreeing_mark_ids' not in more
    assert found[round(0.97 * len(found))] < 0.1


def test_faults_of_its_own_begin_and_end(tmp_path: Path) -> None:
    with connected(tmp_path, {'noise': 0.0, 'form': 'single'}) as made:
        run(made, 500)
        made.simulated.inject('blind', 1.0)
        run(made, 900)
        more = made.device.statistics().more
        assert (more['dead_zone'], int(more['dead_zone_sentences']) >= 17) == ('true', True)
        run(made, 600)
        assert made.device.statistics().more['dead_zone'] == 'false'
        before = len(made.publishers[0].samples)
        made.simulated.inject('misread', 1.0)
        run(made, 900)
        assert min(error for error, _ in errors(made)[before + 2:]) > 0.5
        run(made, 200)
        before = len(made.publishers[0].samples)
        run(made, 500)
        assert max(error for error, _ in errors(made)[before:]) < 0.01


def test_where_no_mark_is_near_is_a_dead_zone(tmp_path: Path) -> None:
    with connected(tmp_path, {'circle_m': 5.0, 'circle_s': 20.0, 'range_m': 1.0}) as made:
        run(made, 3_000)
        assert made.device.statistics().more['dead_zone'] == 'true'
        assert not made.publishers[0].samples


def test_it_sees_the_marks_of_the_world_from_where_it_sits(tmp_path: Path) -> None:
    world = World(WorldSettings(map='open', start=(1.0, 2.0, 0.5), landmarks=(
        '7 1.2 2.1 0.3', '8 0.0 2.0 -1.0', '9 20.0 20.0 0.0')))
    device = settings_of(StarGazer, port='x', mounting_m=[0.15, -0.05, 0.9],
                         mounting_rad=[0.0, 0.0, 1.5], landmarks=['7: 1.2 2.1 0.3', '8: 0 2 -1'])
    port = PtyPort(tmp_path / 'device')
    simulated = SimulatedStarGazer('sim', {'noise': 0.0}, port, None, Site(world, device))
    driver = StarGazer('dut', {**device, 'port': str(port.link), 'baud': 115200})
    made = Rig(simulated, driver)
    try:
        world.base.set_wheel_speeds(2.0, 4.0)
        made.run(1500, 10.0)
        pose = made.publishers[0].samples[-1].pose.pose
        x, y, heading = world.base.pose
        assert math.hypot(x - 1.0, y - 2.0) > 0.15
        assert (pose.position.x, pose.position.y) == pytest.approx((x, y), abs=0.012)
        assert yaw_of(0, 0, pose.orientation.z, pose.orientation.w) == pytest.approx(
            heading, abs=0.05)
        assert driver.statistics().more['marks_used'] == 2
        world.base.teleport(10.0, 10.0, 0.0)
        made.run(200, 10.0)
        assert driver.statistics().more['dead_zone'] == 'true'
    finally:
        driver.close()
        simulated.close()

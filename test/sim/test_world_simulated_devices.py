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

"""Simulated devices that look at one world, each read by its real driver."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path
import random
from typing import Any

import numpy as np
import pytest

from rt_robot_os.devices.hokuyo.driver import Hokuyo
from rt_robot_os.devices.hokuyo.simulated import SimulatedHokuyo
from rt_robot_os.devices.maxbotix.driver import MaxBotix
from rt_robot_os.devices.maxbotix.simulated import SimulatedMaxBotix
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.devices.nmea.simulated import SimulatedNmea
from rt_robot_os.devices.sharp.driver import Sharp
from rt_robot_os.devices.sharp.simulated import SimulatedSharp
from rt_robot_os.devices.ublox.driver import Ublox
from rt_robot_os.devices.ublox.simulated import SimulatedUblox
from rt_robot_os.devices.witmotion.driver import WitMotion
from rt_robot_os.devices.witmotion.simulated import SimulatedWitMotion
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.atmosphere import pressure_pa
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.world import Air
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.inertial import inertial
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing import rig

QUIET = {'noise': 0.0}


@pytest.fixture
def room(tmp_path: Path) -> WorldSettings:
    """Give a room of 6 x 4 m between its walls, the robot in its middle, looking along x."""
    cells = np.full((82, 122), 100, dtype=np.int8)
    cells[1:-1, 1:-1] = 0
    GridMap(cells, 0.05, (-3.05, -2.05, 0.0)).save(tmp_path / 'room.yaml')
    return WorldSettings(map=str(tmp_path / 'room.yaml'))


def last(made: Any, index: int = 0) -> Any:
    return made.publishers[index].samples[-1]


def test_a_lidar_sees_the_room_from_where_it_is_mounted(tmp_path: Path, room: WorldSettings
                                                        ) -> None:
    world = World(replace(room, start=(0.5, 0.0, math.pi / 2), people=('anna 0 0.0 1.5',)))
    with rig(tmp_path, SimulatedHokuyo, Hokuyo, sim={**QUIET, 'scanning': True}, world=world,
             configure=False, mounting_m=[0.2, 0.0, 0.3],
             mounting_rad=[0.0, 0.0, -math.pi / 2]) as made:
        made.run(1500, 10.0)
        scan = last(made)
        middle = round(-scan.angle_min / scan.angle_increment)
        quarter = round(math.pi / 2 / scan.angle_increment)
        assert scan.ranges[middle] == pytest.approx(2.5, abs=0.002)       # east
        assert scan.ranges[middle - quarter] == pytest.approx(2.2, abs=0.002)  # south
        angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        x = 0.5 + scan.ranges * np.cos(angles)
        y = 0.2 + scan.ranges * np.sin(angles)
        assert np.hypot(x, y - 1.5).min() == pytest.approx(0.22, abs=0.005)  # anna
        # It drives: the wall before the robot comes nearer.
        world.base.set_wheel_speeds(4.0, 4.0)
        made.run(2000, 10.0)
        assert last(made).ranges[middle - quarter] == pytest.approx(
            2.2 + world.base.pose[1], abs=0.05)


def test_a_lidar_turns_while_the_robot_does(tmp_path: Path, room: WorldSettings) -> None:
    world = World(room)
    with rig(tmp_path, SimulatedHokuyo, Hokuyo, sim={**QUIET, 'scanning': True}, world=world,
             configure=False) as made:
        world.base.set_wheel_speeds(-2.5, 2.5)
        made.run(2000, 10.0)
        turning = world.base.velocity[1]
        assert turning > 0.8
        scan = last(made)
    corners = np.flatnonzero(np.isclose(scan.ranges, math.hypot(3.0, 2.0), atol=0.02))
    groups = np.split(corners, np.flatnonzero(np.diff(corners) > 9) + 1)
    first, second = (float(group.mean()) * scan.angle_increment for group in groups[:2])
    # While the ray went on to the second corner, that came towards it.
    apart = (second - first) * (1 + turning * 0.1 / math.tau)
    known = 2 * math.atan2(2.0, 3.0)
    assert min(abs(apart - known), abs(apart - (math.pi - known))) < 0.01


def test_an_ultrasonic_cone_sees_what_is_beside_its_axis(tmp_path: Path, room: WorldSettings
                                                         ) -> None:
    world = World(replace(room, people=('anna 0 1.5 0.4',)))
    with rig(tmp_path, SimulatedMaxBotix, MaxBotix, world=world) as made:
        made.run(500, 10.0)
        assert last(made).range == pytest.approx(1.33, abs=0.05)
        world.inject('person anna 1.5 1.5'.split())
        made.run(300, 10.0)
        assert last(made).range == pytest.approx(3.0, abs=0.02)
        world.inject('kidnap 2.9 0 3.141592'.split())
        made.run(300, 10.0)
        assert last(made).range == math.inf  # 5.9 m


def test_each_channel_of_a_converter_looks_its_own_way(tmp_path: Path, room: WorldSettings
                                                       ) -> None:
    world = World(replace(room, start=(2.4, -1.5, 0.0)))
    with rig(tmp_path, SimulatedSharp, Sharp, world=world, channels=[0, 3], median=1,
             mounting_m=[0.1, 0.0, 0.1, 0.0, -0.1, 0.1],
             mounting_rad=[0.0, 0.0, 0.0, 0.0, 0.0, -math.pi / 2]) as made:
        made.run(300, 10.0)
        assert last(made, 0).range == pytest.approx(0.5, abs=0.03)
        assert last(made, 1).range == pytest.approx(0.4, abs=0.03)
        world.inject('kidnap 0 0 0'.split())
        made.run(300, 10.0)
        assert last(made, 0).range == math.inf


def test_an_imu_feels_the_robot_drive_a_circle(tmp_path: Path) -> None:
    world = World(WorldSettings(map='open', start=(0.0, 0.0, 1.0)))
    with rig(tmp_path, SimulatedWitMotion, WitMotion, sim=QUIET, world=world,
             mounting_m=[0.1, 0.0, 0.0], mounting_rad=[0.0, 0.0, math.pi / 2]) as made:
        made.run(100, 10.0)
        imu = last(made)
        assert yaw_of(imu.orientation.x, imu.orientation.y, imu.orientation.z,
                      imu.orientation.w) == pytest.approx(1.0 + math.pi / 2, abs=0.01)
        assert imu.angular_velocity.z == pytest.approx(0.0, abs=1e-3)
        world.base.set_wheel_speeds(4.0, 10.0)
        made.run(2000, 10.0)
        imu = last(made)
        linear, angular = world.base.velocity
        assert angular == pytest.approx(1.0) and linear == pytest.approx(0.35)
        assert imu.angular_velocity.z == pytest.approx(1.0, abs=2e-3)
        # To the left is ahead for it: v w, and the pull towards the middle of the turn.
        assert imu.linear_acceleration.x == pytest.approx(0.35, abs=0.01)
        assert imu.linear_acceleration.y == pytest.approx(0.1, abs=0.01)
        assert imu.linear_acceleration.z == pytest.approx(9.80665, abs=0.01)


def test_what_an_inertial_sensor_feels_agrees_with_its_way() -> None:
    """The second derivative of its place is its acceleration, the first of its yaw its rate."""
    world = World(WorldSettings(map='open', motor_lag_s=0.3, east_rad=0.4))
    mounting = {'mounting_m': [0.2, -0.1, 0.0], 'mounting_rad': [0.0, 0.0, 0.7]}
    site = Site(world, mounting)
    felt = inertial(site)
    world.advance(0)
    world.base.set_wheel_speeds(3.0, 8.0)
    places, forces, yaws, rates, fields = [], [], [], [], []
    for step in range(200):
        world.advance(step * 5_000_000)
        places.append(world.pose_of(site.mounting())[:2])
        forces.append(felt.force(0.0))
        yaws.append(felt.attitude(0.0)[2])
        rates.append(felt.angular_velocity(0.0)[2])
        fields.append(felt.field(0.0))
    assert np.gradient(np.unwrap(yaws), 0.005)[20:-20] == pytest.approx(
        np.array(rates)[20:-20], abs=0.02)
    acceleration = np.gradient(np.gradient(places, 0.005, axis=0), 0.005, axis=0)
    turn = np.array(yaws) + 0.4
    ahead = np.cos(turn) * acceleration[:, 0] + np.sin(turn) * acceleration[:, 1]
    left = np.cos(turn) * acceleration[:, 1] - np.sin(turn) * acceleration[:, 0]
    # An accelerometer lags by some 20 ms.
    assert ahead[30:-20] == pytest.approx(np.array(forces)[34:-16, 0], abs=0.03)
    assert left[30:-20] == pytest.approx(np.array(forces)[34:-16, 1], abs=0.03)
    north = np.arctan2(np.array(fields)[:, 1], np.array(fields)[:, 0]) + np.array(yaws)
    assert np.cos(north - math.pi / 2) == pytest.approx(np.ones(200))


@pytest.mark.parametrize('simulated, driver', [(SimulatedNmea, NmeaGps), (SimulatedUblox, Ublox)])
def test_a_receiver_is_where_the_robot_is(tmp_path: Path, simulated: Any, driver: Any) -> None:
    world = World(WorldSettings(map='open', start=(100.0, 50.0, 0.0), latitude_deg=45.0,
                                longitude_deg=9.0, altitude_m=120.0, east_rad=math.pi / 2))
    with rig(tmp_path, simulated, driver, sim={'rate_hz': 5.0, **QUIET}, baud=115200, world=world,
             mounting_m=[0.0, 0.0, 1.0]) as made:
        made.run(1500, 10.0)
        fix = last(made)
        # x is south, y is east.
        assert fix.latitude == pytest.approx(45.0 - 100.0 / 111_132, abs=2e-6)
        assert fix.longitude == pytest.approx(9.0 + 50.0 / 78_847, abs=2e-6)
        assert fix.altitude == pytest.approx(121.0 + 47.0, abs=0.2)


def test_a_receiver_errs_slowly_and_as_much_as_it_tells(tmp_path: Path) -> None:
    world = World(WorldSettings(map='open', latitude_deg=45.0, longitude_deg=9.0))
    receiver = SimulatedNmea('gps', {}, PtyPort(tmp_path / 'gps'), None, Site(world))
    errors = np.array([(receiver.position(float(s))[0] - 45.0) * 111_132 for s in range(20_000)])
    assert errors.std() == pytest.approx(0.8, rel=0.2) and abs(errors.mean()) < 0.2
    assert np.diff(errors).std() < 0.3 * errors.std()
    again = receiver.position(20_000.0), receiver.position(20_000.0)
    assert again[0] == again[1]


def test_a_barometer_is_as_high_and_as_warm_as_where_it_is() -> None:
    world = World(WorldSettings(map='open', altitude_m=250.0, temperature_c=20.0,
                                heat=('0 0 6 1',)))
    site = Site(world, {'mounting_m': [0.0, 0.0, 2.0]})
    settings = {'noise_pa': 0.0, 'temperature_c': 5.0, 'altitude_m': 0.0, 'swing_m': 9.0,
                'swing_s': 3.0}
    air = Air(settings, random.Random(1), site)
    assert air.measure(1.0) == pytest.approx((pressure_pa(252.0), 26.0))
    world.inject('kidnap 9 9 0'.split())
    assert air.measure(1.0)[1] == pytest.approx(20.0)


def test_a_device_on_another_frame_goes_with_it(tmp_path: Path) -> None:
    mast = Mounting((0.1, 0.0, 1.0), (0.0, 0.0, math.pi / 2))
    place = RobotSite(tmp_path, World(WorldSettings(map='open')), {'mast': mast})
    site = place.site({'mounting_m': [0.2, 0.0, 0.0], 'mounting_rad': [0.0, 0.0, 0.0],
                       'parent_frame_id': 'mast'})
    assert site.mounting().position_m == pytest.approx((0.1, 0.2, 1.0))
    assert site.mounting().yaw_rad == pytest.approx(math.pi / 2)


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path, room: WorldSettings) -> None:
    def seen(seed: int) -> list[bytes]:
        world = World(replace(room, people=('anna 0.8 -1 1 2 1',), slip_noise=0.1, seed=seed))
        with rig(tmp_path, SimulatedHokuyo, Hokuyo, sim={'scanning': True}, world=world,
                 configure=False) as made:
            world.base.set_wheel_speeds(4.0, 5.0)
            made.run(1000, 10.0)
            return list(made.publishers[0].values)

    first = seen(1)
    assert len(first) > 5
    assert seen(1) == first
    assert seen(2) != first

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

"""Bags of ROS 2 as rosbags writes them: read with what they say, and what is broken is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math
from pathlib import Path
import sqlite3
from typing import Any

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')
pytest.importorskip('mcap', reason='mcap is not installed')
rosbag2 = pytest.importorskip('rosbags.rosbag2', reason='rosbags is not installed')

from rosbags.typesys import get_typestore  # noqa: E402
from rosbags.typesys import Stores  # noqa: E402

from benchmarks.slam.drives import Drive  # noqa: E402, I100
from benchmarks.slam.drives import flat_drive  # noqa: E402
from rt_robot_os.base.errors import ConfigError  # noqa: E402
from rt_robot_os.features.mapping.bags.bag_log import BagLog  # noqa: E402
from rt_robot_os.features.mapping.bags.bag_log import BagOptions  # noqa: E402
from rt_robot_os.features.mapping.cli.command import run  # noqa: E402
from rt_robot_os.features.mapping.cli.scan_source import laser_mount  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402

STORE = get_typestore(Stores.ROS2_JAZZY)
WAY = ((3.44, 1.0), (4.1, 1.05), (4.2, 1.5))
MCAP, SQLITE = rosbag2.StoragePlugin.MCAP, rosbag2.StoragePlugin.SQLITE3
EPOCH_NS = 1_700_000_000_000_000_000


def made(kind: str, **fields: Any) -> Any:
    """Make a message."""
    return STORE.types[kind](**fields)


def head(stamp_ns: int, frame_id: str) -> Any:
    return made('std_msgs/msg/Header', stamp=made(
        'builtin_interfaces/msg/Time', sec=stamp_ns // 10 ** 9, nanosec=stamp_ns % 10 ** 9),
        frame_id=frame_id)


def turn(yaw: float, upside_down: bool = False) -> Any:
    x, y, z, w = ((math.cos(yaw / 2), math.sin(yaw / 2), 0.0, 0.0) if upside_down
                  else (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
    return made('geometry_msgs/msg/Quaternion', x=x, y=y, z=z, w=w)


def transform(stamp_ns: int, parent: str, child: str, x: float, y: float, yaw: float,
              upside_down: bool = False) -> Any:
    return made('geometry_msgs/msg/TransformStamped', header=head(stamp_ns, parent),
                child_frame_id=child, transform=made(
                    'geometry_msgs/msg/Transform', rotation=turn(yaw, upside_down),
                    translation=made('geometry_msgs/msg/Vector3', x=x, y=y, z=0.2)))


def scan_message(scan: Scan, stamp_ns: int, beam_s: float = 0.0) -> Any:
    return made('sensor_msgs/msg/LaserScan', header=head(stamp_ns, 'laser'),
                angle_min=scan.angle_min, angle_max=scan.angle_min + 359 * scan.angle_increment,
                angle_increment=scan.angle_increment, time_increment=beam_s, scan_time=0.1,
                range_min=0.05, range_max=12.0, ranges=scan.ranges.astype(np.float32),
                intensities=np.zeros(0, np.float32))


def odometry_message(stamp_ns: int, x: float, y: float, yaw: float) -> Any:
    zeros = np.zeros(36)
    vector = made('geometry_msgs/msg/Vector3', x=0.0, y=0.0, z=0.0)
    return made('nav_msgs/msg/Odometry', header=head(stamp_ns, 'odom'),
                child_frame_id='base_footprint',
                pose=made('geometry_msgs/msg/PoseWithCovariance', covariance=zeros, pose=made(
                    'geometry_msgs/msg/Pose', orientation=turn(yaw),
                    position=made('geometry_msgs/msg/Point', x=x, y=y, z=0.0))),
                twist=made('geometry_msgs/msg/TwistWithCovariance', covariance=zeros, twist=made(
                    'geometry_msgs/msg/Twist', linear=vector, angular=vector)))


def bag_of(made_drive: Drive, folder: Path, storage: Any = MCAP, odometry: str = 'topic',
           compression: str = '', skew_ns: int = 0, beam_s: float = 0.0, mounted: bool = True,
           upside_down: bool = False) -> Path:
    """Write a drive as a bag; odometry as a topic, as transforms, or not at all."""
    writer = rosbag2.Writer(folder, version=9, storage_plugin=storage)
    if compression:
        writer.set_compression(getattr(rosbag2.CompressionMode, compression),
                               rosbag2.CompressionFormat.ZSTD)
    with writer:
        topics = {topic: writer.add_connection(topic, kind, typestore=STORE) for topic, kind in (
            ('/scan', 'sensor_msgs/msg/LaserScan'), ('/tf_static', 'tf2_msgs/msg/TFMessage'),
            ('/odom', 'nav_msgs/msg/Odometry'), ('/tf', 'tf2_msgs/msg/TFMessage'))
            if topic not in ('/odom', '/tf') or {'/odom': 'topic', '/tf': 'tf'}[topic] == odometry}

        def write(topic: str, log_ns: int, message: Any) -> None:
            writer.write(topics[topic], log_ns,
                         STORE.serialize_cdr(message, topics[topic].msgtype))

        if mounted:
            x, y, yaw = made_drive.laser
            write('/tf_static', EPOCH_NS, made('tf2_msgs/msg/TFMessage', transforms=[
                transform(EPOCH_NS, 'base_link', 'laser', x, y, yaw, upside_down),
                transform(EPOCH_NS, 'base_footprint', 'base_link', 0.0, 0.0, 0.0)]))
        samples = [(int(stamp), 1, pose) for stamp, pose in zip(
            made_drive.odometry_ns, made_drive.odometry)]
        samples += [(scan.stamp_ns, 0, scan) for scan in made_drive.scans]
        for stamp_ns, which, what in sorted(samples, key=lambda each: each[:2]):
            stamp_ns += EPOCH_NS
            if not which:
                write('/scan', stamp_ns + 10 ** 7, scan_message(what, stamp_ns - skew_ns, beam_s))
            elif odometry == 'topic':
                write('/odom', stamp_ns + 10 ** 6, odometry_message(stamp_ns, *what))
            elif odometry == 'tf':
                write('/tf', stamp_ns + 10 ** 6, made('tf2_msgs/msg/TFMessage', transforms=[
                    transform(stamp_ns, 'map', 'odom', 5.0, 1.0, 0.3),
                    transform(stamp_ns, 'odom', 'base_footprint', *what)]))
    return folder


@pytest.fixture(scope='module')
def short() -> Drive:
    """Return a drive of some seconds."""
    return flat_drive(1, WAY)


@pytest.mark.parametrize('storage, odometry, compression', [
    (MCAP, 'topic', ''), (SQLITE, 'topic', ''), (SQLITE, 'tf', 'MESSAGE'), (MCAP, 'tf', 'FILE'),
    (SQLITE, 'topic', 'FILE')])
def test_all_storages_give_the_scans_with_odometry_of_the_laser(
        tmp_path: Path, short: Drive, storage: Any, odometry: str, compression: str) -> None:
    log = BagLog(bag_of(short, tmp_path / 'bag', storage, odometry, compression))
    scans = list(log.scans())
    assert len(scans) == len(short.scans) and log.problems == []
    for found, true in zip(scans, short.scans):
        assert found.odometry == pytest.approx(true.odometry, abs=1e-6)
        assert found.stamp_ns == true.stamp_ns + EPOCH_NS
        assert found.ranges == pytest.approx(true.ranges, abs=1e-5)
        assert found.angle_increment == pytest.approx(true.angle_increment)
    assert log.mount is not None and log.mount.pose == pytest.approx(short.laser)
    assert log.reference is None and log.share_read > 0.9


def test_a_range_at_the_reach_is_no_echo_and_one_too_near_is_no_measurement(
        tmp_path: Path, short: Drive) -> None:
    ranges = short.scans[0].ranges.copy()
    ranges[:4] = 12.0, 11.9, 0.0, 0.04
    scans = [replace(short.scans[0], ranges=ranges), *short.scans[1:]]
    found = next(BagLog(bag_of(replace(short, scans=scans), tmp_path / 'bag')).scans())
    assert np.isposinf(found.ranges[0]) and found.ranges[1] == pytest.approx(11.9)
    assert np.isnan(found.ranges[2:4]).all()


def test_one_file_of_a_folder_is_a_bag_as_well(tmp_path: Path, short: Drive) -> None:
    for storage, name in ((MCAP, 'a.mcap'), (SQLITE, 'b.db3')):
        folder = bag_of(short, tmp_path / name[0], storage)
        assert len(list(BagLog(folder / name).scans())) == len(short.scans)


def test_beams_taken_one_after_another_say_where_the_laser_was(tmp_path: Path) -> None:
    turning = flat_drive(1, WAY, is_skewed=True)
    scans = list(BagLog(bag_of(turning, tmp_path / 'bag', beam_s=0.1 / 360)).scans())
    moved = [(found.beam_poses, true.beam_poses) for found, true in zip(scans, turning.scans)
             if true.beam_poses is not None and abs(true.beam_poses[-1, 2]) > 0.02]
    assert len(moved) > 5
    for found, expected in moved:
        assert found is not None and found == pytest.approx(expected, abs=2e-3)


def test_a_laser_upside_down_and_one_that_only_the_command_line_knows(
        tmp_path: Path, short: Drive) -> None:
    hanging = list(BagLog(bag_of(short, tmp_path / 'a', upside_down=True)).scans())
    assert hanging[0].angle_increment == pytest.approx(-short.scans[0].angle_increment)
    assert hanging[0].angle_min == pytest.approx(-short.scans[0].angle_min)
    loose = bag_of(short, tmp_path / 'b', mounted=False)
    log = BagLog(loose)
    list(log.scans())
    assert 'has no transform from base_footprint to laser' in log.problems[0]
    log = BagLog(loose, BagOptions(laser=laser_mount('0.1,0,0')))
    assert list(log.scans())[-1].odometry == pytest.approx(short.scans[-1].odometry, abs=1e-6)
    assert log.problems == []


def test_clocks_that_do_not_fit_are_told_and_the_times_of_recording_taken(
        tmp_path: Path, short: Drive) -> None:
    log = BagLog(bag_of(short, tmp_path / 'bag', skew_ns=10 ** 12))
    assert len(list(log.scans())) > len(short.scans) - 3
    assert 'clocks that are 1e+03 s apart' in log.problems[0]


@pytest.mark.parametrize('arguments, says', [
    (['--scan-topic', 'back'], ['--scan-topic back: there is no such topic',
                                '/scan  sensor_msgs/msg/LaserScan']),
    (['--odom-topic', '/scan'], ['--odom-topic /scan: it is of sensor_msgs/msg/LaserScan']),
    (['--laser', '1,2'], ['--laser 1,2: must be X,Y,YAW in m and degrees']),
    (['--session', '3'], ['--session 3: there is none; there are no sessions at all'])])
def test_what_is_not_in_a_bag_is_named_with_what_is(
        tmp_path: Path, short: Drive, capsys: pytest.CaptureFixture[str], arguments: list[str],
        says: list[str]) -> None:
    bag = bag_of(short, tmp_path / 'bag')
    assert run(['--bag', str(bag), *arguments]) == 2
    said = capsys.readouterr().err
    assert all(each in said for each in says)


def test_a_bag_without_odometry_says_so(tmp_path: Path, short: Drive) -> None:
    with pytest.raises(ConfigError, match='neither a topic of nav_msgs/msg/Odometry nor /tf'):
        BagLog(bag_of(short, tmp_path / 'bag', odometry='none'))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:path.stat().st_size * 2 // 3])


def overwrite(path: Path) -> None:
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle:middle + 6000] = bytes(6000)
    path.write_bytes(data)


@pytest.mark.parametrize('storage', [MCAP, SQLITE])
@pytest.mark.parametrize('harm, least', [(cut, 0.2), (overwrite, 0.3)])
def test_a_damaged_bag_is_used_as_far_as_it_can_be_read(
        tmp_path: Path, short: Drive, storage: Any, harm: Callable[[Path], None], least: float
        ) -> None:
    folder = bag_of(short, tmp_path / 'bag', storage)
    file = next(each for each in folder.iterdir() if each.suffix != '.yaml')
    harm(file)
    log = BagLog(folder)
    try:
        scans = list(log.scans())
    except ConfigError as error:
        assert storage is MCAP and 'no odometry could be read' in str(error)  # one chunk is all
        return
    assert least * len(short.scans) < len(scans) < len(short.scans)
    assert any('damaged' in each or 'truncated' in each for each in log.problems)


def test_what_is_no_bag_is_told(tmp_path: Path) -> None:
    old = tmp_path / 'old.bag'
    old.write_bytes(b'#ROSBAG V2.0\n' + bytes(100))
    with pytest.raises(ConfigError, match='a bag of ROS 1: convert it to ROS 2'):
        BagLog(old)
    (tmp_path / 'empty').mkdir()
    with pytest.raises(ConfigError, match='no .mcap or .db3 files'):
        BagLog(tmp_path / 'empty')
    other = tmp_path / 'other.db3'
    sqlite3.connect(other).execute('CREATE TABLE cakes (name TEXT)').connection.close()
    with pytest.raises(ConfigError, match='not a readable bag of ROS 2: no such table'):
        BagLog(other).topics


def test_topics_are_chosen_by_their_usual_names_or_asked_for(
        tmp_path: Path, short: Drive) -> None:
    from rt_robot_os.features.mapping.bags.topics import choose
    laser, wheels = 'sensor_msgs/msg/LaserScan', 'nav_msgs/msg/Odometry'
    several = {'/front': laser, '/rear': laser, '/odom': wheels, '/visual': wheels}
    with pytest.raises(ConfigError, match='choose one with --scan-topic: /front, /rear'):
        choose(several)
    found = choose(several, 'rear')
    assert (found.scan, found.odometry) == ('/rear', '/odom')
    with pytest.raises(ConfigError, match='point clouds are not supported'):
        choose({'/points': 'sensor_msgs/msg/PointCloud2'})

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

"""Mapping simulated drives and logs, and a core that scans while a process beside it maps."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import replace
import math
import os
from pathlib import Path
import time
from typing import Any

from benchmarks.shared.memory import resident_bytes
from benchmarks.slam import drives as slam_drives
from benchmarks.slam.measures import agreement
from benchmarks.slam.measures import closing_error
from benchmarks.slam.measures import fitted_error
from benchmarks.slam.measures import way_errors
import numpy as np

from rt_robot_os.base.errors import StartError
from rt_robot_os.base.needs import require
from rt_robot_os.base.requirements import EXTRAS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.features.mapping.slam.relations import compare
from rt_robot_os.features.mapping.slam.relations import read_relations
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.settings.model import TopicSettings
from rt_robot_os.tools.bench.cases.mirror.subjects import settings
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.harness import Unavailable
from rt_robot_os.tools.bench.stamps import Stamps

_MAPPER = f'{__name__}:mapper'
_SCAN_HZ, _ODOMETRY_HZ = 10.0, 50.0
_POSE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
_BEAMS = 360
_QUARTERS = 4


def drive_of(name: str, scans: int = 0) -> slam_drives.Drive:
    """
    Make a drive.

    :param name: ``flat``, ``house`` or ``ring``.
    :param scans: take no more of it; 0 for all.
    """
    made: slam_drives.Drive = getattr(slam_drives, f'{name}_drive')(1)
    return replace(made, scans=made.scans[:scans], truth=made.truth[:scans]) if scans else made


def _libraries() -> None:
    try:
        require('mapping', *EXTRAS['slam'])
    except StartError as error:
        raise Unavailable(str(error)) from error


def _timed(scans: Iterable[Scan]) -> tuple[Any, Any, dict[str, Any], float]:
    """Map scans and draw them after each; return mapper, grid, times, and CPU seconds."""
    from rt_robot_os.features.mapping.slam.growing_grid import GrowingGrid
    from rt_robot_os.features.mapping.slam.mapper import Mapper
    mapper, grid = Mapper(), GrowingGrid()
    adds, updates = [], []
    for scan in scans:
        begin_ns = time.thread_time_ns()
        mapper.add(scan)
        added_ns = time.thread_time_ns()
        grid.update(mapper.keyframes)
        adds.append(added_ns - begin_ns)
        updates.append(time.thread_time_ns() - added_ns)
    return (mapper, grid, {'adds': np.array(adds), 'updates': np.array(updates)},
            (sum(adds) + sum(updates)) / NS_PER_S)


def drive(harness: Harness) -> Measurement:
    """Map a simulated drive, and hold way and map against the true ones."""
    _libraries()
    harness.prepare()
    made = drive_of(harness.arguments['drive'], harness.arguments['scans'])
    mapper, grid, samples, cpu_s = _timed(made.scans)
    begin_ns = time.thread_time_ns()
    mapper.optimise_all()
    cpu_s += (time.thread_time_ns() - begin_ns) / NS_PER_S
    while not grid.update(mapper.keyframes):
        pass
    poses = mapper.trajectory()
    rms_m, rms_deg = way_errors(made.truth, poses)
    return Measurement(samples, {
        'scans_per_s': len(made.scans) / cpu_s, 'rms_m': rms_m, 'rms_deg': rms_deg,
        'fitted_m': fitted_error(made.truth, poses),
        'closing_m': closing_error(made.truth, poses),
        'agreement': 100.0 * agreement(grid.grid(), made.truth[0], made.grid),
        'loops': mapper.counts['loops'], 'lost': mapper.counts['lost']})


def log(harness: Harness) -> Measurement:
    """Map a log, and hold its way against relations that are known."""
    _libraries()
    harness.prepare()
    from rt_robot_os.features.mapping.slam.known_lines import load_libraries
    from rt_robot_os.features.mapping.slam.logs import read_log
    a = harness.arguments
    from rt_robot_os.features.mapping.slam.mapper import mapped
    load_libraries()
    scans = read_log(Path(a['data'])).scans
    begin_ns = time.process_time_ns()  # of all threads
    poses = mapped(scans).trajectory()
    cpu_s = (time.process_time_ns() - begin_ns) / NS_PER_S
    return Measurement({}, {'cpu_s': cpu_s, 'scans_per_s': len(poses) / cpu_s,
                            **errors_of(poses, a['relations'])})


def errors_of(poses: Floats, relations: str) -> dict[str, float]:
    """Return the errors of a way on relations; nothing without such a file."""
    if not relations:
        return {}
    found = compare(poses, read_relations(Path(relations)))
    return {name: float(value) for name, value in found.items() if not isinstance(value, list)}


def hour(harness: Harness) -> Measurement:
    """Drive round the flat for a time, and look at what the process takes."""
    _libraries()
    harness.prepare()
    lap = drive_of('flat')
    count = round(harness.arguments['simulated_s'] * _SCAN_HZ)
    sizes: list[int] = []

    def scans() -> Iterable[Scan]:
        for number in range(count):
            if number % max(1, count // _QUARTERS) == 0:
                sizes.append(resident_bytes(os.getpid()))
            yield _lapped(lap, number)

    mapper, _, _, cpu_s = _timed(scans())
    sizes.append(resident_bytes(os.getpid()))
    truth = np.array([lap.truth[number % len(lap.scans)] for number in range(count)])
    last = len(lap.scans)
    off = closing_error(truth[:count], mapper.trajectory()[-count:]) if count > last else math.nan
    return Measurement({}, {
        'scans_per_s': count / cpu_s, 'keyframes': len(mapper.keyframes),
        'begin_mb': sizes[0] / 1e6, 'known_mb': sizes[1] / 1e6, 'end_mb': sizes[-1] / 1e6,
        'growth_mb': (sizes[-1] - sizes[1]) / 1e6, 'closing_m': off})


def _lapped(lap: slam_drives.Drive, number: int) -> Scan:
    """Return a scan of a drive that begins again and again, turned on the spot in between."""
    laps, index = divmod(number, len(lap.scans))
    scan = lap.scans[index]
    whole = between(lap.scans[0].odometry, lap.scans[-1].odometry)
    back = between(lap.truth[-1], lap.truth[0])
    start: Floats = np.zeros(3)
    for _ in range(laps):
        start = composed(composed(start, whole), back)
    return replace(scan, odometry=composed(start, between(lap.scans[0].odometry, scan.odometry)),
                   stamp_ns=scan.stamp_ns + round(laps * len(lap.scans) / _SCAN_HZ * NS_PER_S))


def restarts(harness: Harness) -> Measurement:
    """Find oneself in the map of the flat, at random places."""
    _libraries()
    harness.prepare()
    from benchmarks.slam.restart_trials import restart_trials
    count = harness.arguments['count']
    found = restart_trials(count, 1, slam_drives.shipped_map('flat'))
    times = np.array([round(each * 1e6) for each in found.times_s], np.int64)
    return Measurement({'times': times}, {
        'right': 100.0 * found.right / count, 'wrong': found.wrong, 'none': found.none,
        'count': count})


# ---- a core beside which is mapped -------------------------------------------------------------

def core(harness: Harness) -> Measurement:
    """Run a 1 kHz task in a core that publishes scans and odometry of a drive."""
    _libraries()
    a = harness.arguments
    path = socket_path('bench')
    made = slam_drives.flat_drive(1, beams=_BEAMS)
    tested = Core(_settings(), path)
    stamps = Stamps(2 * (a['warmup_ns'] + a['measure_ns']) // a['period_ns'] + 1000)
    tested.kernel.add_task('bench/probe', stamps.stamp, priority=90,
                           rate_hz=NS_PER_S / a['period_ns'])
    _publish(tested, made)
    maps = tested.bus.subscribe('slam/pose', 'bench/watch')
    seen = [0]

    def watch() -> None:
        while maps.take():
            seen[0] += 1

    tested.kernel.add_task('bench/watch', watch, priority=1, rate_hz=10.0)
    if not a['mapped']:
        return _run(harness, tested, stamps, seen)
    with harness.helper(_MAPPER, {'path': str(path), 'folder': str(harness.folder)},
                        same_cpu=False):
        return _run(harness, tested, stamps, seen)


def _settings() -> Any:
    whole = settings({
        'scan': ('sensor_msgs/msg/LaserScan', {
            'header.frame_id': 'laser', 'ranges': _BEAMS, 'intensities': 0}),
        'odom': ('nav_msgs/msg/Odometry', {
            'header.frame_id': 'odom', 'child_frame_id': 'base_link'}),
        'slam/pose': (_POSE, {'header.frame_id': 'map'})}, depth=64)
    return replace(whole, topics=(*whole.topics, TopicSettings(
        name='map', message='nav_msgs/msg/OccupancyGrid', depth=2,
        fixed={'header.frame_id': 'map'}, tail=4_000_000)))


def _publish(tested: Core, made: slam_drives.Drive) -> None:
    scan, odom = tested.bus.publisher('scan'), tested.bus.publisher('odom')
    ranges = [np.where(np.isfinite(each.ranges), each.ranges, np.inf).astype(np.float32)
              for each in made.scans]
    poses = made.odometry.tolist()
    first, step = made.scans[0].angle_min, made.scans[0].angle_increment
    at = {'scan': 0, 'odom': 0}

    def publish_scan() -> None:
        scan.msg.angle_min, scan.msg.angle_increment = first, step
        scan.msg.range_min, scan.msg.range_max = 0.05, 12.0
        scan.msg.ranges[:] = ranges[at['scan'] % len(ranges)]
        at['scan'] += 1
        scan.publish()

    def publish_odometry() -> None:
        x, y, yaw = poses[at['odom'] % len(poses)]
        at['odom'] += 1
        pose = odom.msg.pose.pose
        pose.position.x, pose.position.y = x, y
        pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        odom.publish()

    tested.kernel.add_task('bench/scan', publish_scan, priority=41, rate_hz=_SCAN_HZ)
    tested.kernel.add_task('bench/odom', publish_odometry, priority=42, rate_hz=_ODOMETRY_HZ)


def _run(harness: Harness, tested: Core, stamps: Stamps, seen: list[int]) -> Measurement:
    a = harness.arguments
    harness.prepare(freeze=True)
    cpu_ns, wall_ns = time.process_time_ns(), time.monotonic_ns()
    tested.run(a['warmup_ns'] + a['measure_ns'])
    cpu_ns, wall_ns = time.process_time_ns() - cpu_ns, time.monotonic_ns() - wall_ns
    if a['mapped'] and not seen[0]:
        raise RuntimeError('nothing was mapped')
    start_ns = tested.kernel.start_ns
    return Measurement({'starts': stamps.taken()}, {
        'phase_ns': start_ns, 'begin_ns': start_ns + a['warmup_ns'],
        'measure_ns': a['measure_ns'], 'cpu_percent': 100.0 * cpu_ns / wall_ns,
        'located': seen[0]})


def mapper(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be the process that maps."""
    from rt_robot_os.features.mapping.process.live_mapping import LiveMapping
    from rt_robot_os.features.mapping.settings import MappingSettings
    live = LiveMapping(
        MappingSettings(pose_topic='', fix_topic='', initial_pose_topic='', start='origin',
                        resume=False, mounting_m=(0.1, 0.0, 0.0), mounting_rad=(0.0, 0.0, 0.0)),
        Path(arguments['path']), Path(arguments['folder']) / 'mapping', lambda text: None)
    ready()
    live.run(lambda: False)

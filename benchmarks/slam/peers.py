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

"""BreezySLAM and KISS-ICP on the same scans, where they can be imported."""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
import math
from pathlib import Path
import time
from typing import Any

from benchmarks.slam.measures import closing_error
from benchmarks.slam.measures import fitted_error
from benchmarks.slam.measures import way_errors
from benchmarks.slam.subjects import drive_of
from benchmarks.slam.subjects import errors_of
import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.logs import read_log
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.harness import Unavailable

_RANGE_MAX_M = 20.0
_MAP_M = 120
_MAP_PIXELS = 2400
_NOTHING_MM = 20000
#: KISS-ICP wants a cloud with some height.
_LEVELS_M = (-0.5, 0.0, 0.5)
_BREEZY = ('BreezySLAM is not on PyPI: clone github.com/simondlevy/BreezySLAM, in its folder '
           'python run `python setup.py build_ext --inplace`, and put that folder on PYTHONPATH')
_KISS = 'pip install kiss-icp'

Locate = Callable[[Scan], Floats]


def breezy(harness: Harness) -> Measurement:
    """Locate scans with BreezySLAM (tinySLAM's random hill climbing, with odometry)."""
    return _measured(harness, _breezy)


def kiss(harness: Harness) -> Measurement:
    """Locate scans with KISS-ICP: scan matching alone, of points in space, without odometry."""
    return _measured(harness, _kiss)


def _measured(harness: Harness, make: Callable[[Scan], Locate]) -> Measurement:
    a = harness.arguments
    truth: Floats | None = None
    if a.get('data'):
        scans = read_log(Path(a['data'])).scans
    else:
        made = drive_of(a['drive'], a['scans'])
        scans, truth = made.scans, made.truth
    locate = make(scans[0])
    harness.prepare()
    begin_ns = time.process_time_ns()
    poses = np.array([locate(scan) for scan in scans])
    # Of all threads: they are compared on one core.
    cpu_s = (time.process_time_ns() - begin_ns) / NS_PER_S
    figures = {'cpu_s': cpu_s, 'scans_per_s': len(scans) / cpu_s}
    if truth is None:
        return Measurement({}, {**figures, **errors_of(poses, a['relations'])})
    rms_m, rms_deg = way_errors(truth, poses)
    return Measurement({}, {**figures, 'rms_m': rms_m, 'rms_deg': rms_deg,
                            'fitted_m': fitted_error(truth, poses),
                            'closing_m': closing_error(truth, poses)})


def _imported(name: str, remedy: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise Unavailable(f'{error}: {remedy}') from error


def _breezy(first: Scan) -> Locate:
    algorithms = _imported('breezyslam.algorithms', _BREEZY)
    sensors = _imported('breezyslam.sensors', _BREEZY)
    beams = len(first.ranges)
    laser = sensors.Laser(beams, 10.0, math.degrees(abs(first.angle_increment)) * (beams - 1),
                          _NOTHING_MM)
    slam = algorithms.RMHC_SLAM(laser, _MAP_PIXELS, _MAP_M, random_seed=1)
    last: list[Floats] = []

    def locate(scan: Scan) -> Floats:
        step = between(last[0], scan.odometry) if last else np.zeros(3)
        last[:] = [scan.odometry]
        usable = np.isfinite(scan.ranges) & (scan.ranges < _RANGE_MAX_M)
        ranges_mm = np.where(usable, 1000.0 * np.where(usable, scan.ranges, 0.0), _NOTHING_MM)
        slam.update([int(each) for each in ranges_mm], (
            1000.0 * math.copysign(math.hypot(step[0], step[1]), step[0]), math.degrees(step[2]),
            0.1))
        x_mm, y_mm, yaw_deg = slam.getpos()
        return np.array((x_mm / 1000.0, y_mm / 1000.0, math.radians(yaw_deg)))

    return locate


def _kiss(first: Scan) -> Locate:
    module = _imported('kiss_icp.kiss_icp', _KISS)
    config = _imported('kiss_icp.config', _KISS).KISSConfig()
    config.data.max_range, config.data.min_range, config.data.deskew = _RANGE_MAX_M, 0.05, False
    config.mapping.voxel_size = 0.2
    config.registration.max_num_threads = 1
    odometry = module.KissICP(config)
    angles = first.angle_min + first.angle_increment * np.arange(len(first.ranges))

    def locate(scan: Scan) -> Floats:
        usable = np.isfinite(scan.ranges) & (scan.ranges < _RANGE_MAX_M)
        ranges, along = scan.ranges[usable], angles[usable]
        points = np.concatenate([np.stack((ranges * np.cos(along), ranges * np.sin(along),
                                           np.full(len(ranges), level)), -1)
                                 for level in _LEVELS_M])
        odometry.register_frame(points, np.zeros(len(points)))
        pose = odometry.last_pose
        return np.array((pose[0, 3], pose[1, 3], math.atan2(pose[1, 0], pose[0, 0])))

    return locate

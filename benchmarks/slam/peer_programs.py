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

"""Karto and GMapping on the scans of a log, by the programs of peer_sources, where built."""

from __future__ import annotations

from pathlib import Path
import shutil
import subprocess
from typing import Final

from benchmarks.slam.subjects import errors_of
import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.logs import read_log
from rt_robot_os.features.mapping.slam.logs import rows
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.harness import Unavailable

#: What a beam without an echo is given as, and what the laser's reach is said to be.
_NOTHING_M: Final = 81.0
_LONGEST_S: Final = 900.0


def karto(harness: Harness) -> Measurement:
    """Map a log with slam_toolbox's Karto, with the settings that it ships."""
    return _measured(harness, 'slam_peer_karto')


def gmapping(harness: Harness) -> Measurement:
    """Map a log with OpenSLAM's GMapping, with the settings that it ships for 5 cm."""
    return _measured(harness, 'slam_peer_gmapping')


def _measured(harness: Harness, program: str) -> Measurement:
    path = shutil.which(program)
    if path is None:
        raise Unavailable(f'{program} is not on PATH: build it of its sources, as '
                          'benchmarks/slam/peer_sources/CMakeLists.txt says')
    scans = read_log(Path(harness.arguments['data'])).scans
    harness.prepare()
    done = subprocess.run([path], input=as_text(scans), capture_output=True, text=True,
                          timeout=_LONGEST_S)
    if done.returncode:
        raise RuntimeError(f'{program} ended with {done.returncode}: {done.stderr.strip()[-500:]}')
    cpu_s, poses = read_answer(done.stdout)
    return Measurement({}, {'cpu_s': cpu_s, 'scans_per_s': len(scans) / cpu_s,
                            **errors_of(poses, harness.arguments['relations'])})


def as_text(scans: tuple[Scan, ...]) -> str:
    """Return scans as the programs read them, see benchmarks/slam/peer_sources/scans.hpp."""
    first = scans[0]
    lines = [f'{len(first.ranges)} {first.angle_min!r} {first.angle_increment!r} {_NOTHING_M}']
    for scan, pose in zip(scans, rows(np.array([each.odometry for each in scans]))):
        usable = np.isfinite(scan.ranges) & (scan.ranges < _NOTHING_M)
        ranges = np.where(usable, scan.ranges, _NOTHING_M).tolist()
        lines.append(' '.join((f'{scan.stamp_ns / NS_PER_S:.6f}', *map(str, pose),
                               *(f'{each:.4f}' for each in ranges))))
    return '\n'.join(lines) + '\n'


def read_answer(text: str) -> tuple[float, Floats]:
    """
    Return the CPU seconds and the poses that a program wrote.

    :return: the poses have the shape (scans, 3).
    :raises ValueError: it wrote something else.
    """
    first, *lines = text.split('\n')
    poses = np.array([[float(each) for each in line.split()] for line in lines if line])
    if poses.ndim != 2 or poses.shape[1] != 3:
        raise ValueError(f'no poses: {text[:100]!r}')
    return float(first), poses

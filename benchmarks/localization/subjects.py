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

"""What the case localization measures: simulated drives, a recording, the time of a step."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
import math
from pathlib import Path
from typing import Any

from benchmarks.localization.recording import expected
from benchmarks.localization.recording import read
from benchmarks.localization.replay import replay
from benchmarks.localization.simulation import rms
from benchmarks.localization.simulation import Scenario
from benchmarks.localization.simulation import simulate
from benchmarks.localization.simulation import Trace
import numpy as np

from rt_robot_os.features.navigation.localization import Localization
from rt_robot_os.features.navigation.odometry import Odometry
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.modules import Module
from rt_robot_os.motion.ekf import Ekf
from rt_robot_os.motion.localizer import Localizer
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.pose_history import OdometryStep
from rt_robot_os.motion.pose_history import PoseFix
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.operation_cost import block_means_ps
from rt_robot_os.topics import Bus

_SURE = (1e-4, 0.0, 0.0, 1e-4, 0.0, 3e-4)
_JOINTS = {'header.frame_id': 'base_link', 'name': ['left_wheel_joint', 'right_wheel_joint'],
           'position': 2, 'velocity': 2, 'effort': 0}
_ODOM = {'header.frame_id': 'odom', 'child_frame_id': 'base_link'}
_STEP_NS = 20_000_000
# A robot that was carried away is back when its error is below, in m.
_FOUND_M = 0.1
# Samples of a recording that a plot shows; of a simulated drive it shows each so-many-th.
_PLOTTED = 1000
_SHOWN = 5


def thousandths(values: Any) -> Samples:
    """Return whole thousandths: of m, of rad, of what has no unit."""
    return np.rint(np.asarray(values, np.float64) * 1000).astype(np.int64)


def simulated(harness: Harness) -> Measurement:
    """
    Drive each seed of each scenario.

    :return: for each scenario, ``scenario sample``: of each seed errors in um and urad, and the
        mean of the innovations in thousandths; the way of the first seed in mm.
    """
    samples: dict[str, Samples] = {}
    seeds = harness.arguments['seeds']
    for name, scenario in harness.arguments['scenarios'].items():
        traces = [simulate(Scenario(seed, **scenario)) for seed in range(1, seeds + 1)]
        for sample, values in {**_figures(traces, scenario), **_way(traces[0])}.items():
            samples[f'{name} {sample}'] = values
    return Measurement(samples)


def _figures(traces: Sequence[Trace], scenario: Mapping[str, Any]) -> dict[str, Samples]:
    """Return one number for each drive."""
    begin_s, end_s = scenario.get('blind', (0.0, 0.0))
    lost_s = scenario.get('kidnapped_s', math.inf)
    found: dict[str, list[float]] = {
        'rms_um': [rms(t.errors_m(0.0, lost_s)) * 1e6 for t in traces],
        'rms_urad': [rms(t.turns_rad(0.0, lost_s)) * 1e6 for t in traces],
        'most_um': [max(t.errors_m(0.0, lost_s)) * 1e6 for t in traces],
        'leap_milli': [t.leaps * 1e3 for t in traces],
        'nis_milli': [1e3 * sum(t.innovations) / len(t.innovations) for t in traces],
        'nees_milli': [1e3 * t.nees(lost_s) for t in traces],
        'innovations': [len(t.innovations) for t in traces]}
    if end_s:
        found['blind_um'] = [
            (max(t.errors_m(begin_s, end_s)) - t.errors_m(0.0, begin_s)[-1]) * 1e6
            for t in traces]
    if lost_s < math.inf:
        found['found_ms'] = [1e3 * max(
            (time_s - lost_s for time_s, error in zip(t.time_s, t.errors_m())
             if time_s >= lost_s and error > _FOUND_M), default=0.0) for t in traces]
    return {name: np.rint(values).astype(np.int64) for name, values in found.items()}


def _way(trace: Trace) -> dict[str, Samples]:
    """Return one drive as it is drawn."""
    found = {'time_ms': thousandths(trace.time_s[::_SHOWN]),
             'error_um': thousandths(np.array(trace.errors_m()[::_SHOWN]) * 1000)}
    for name, poses in (('truth', trace.truth[::_SHOWN]), ('estimate', trace.estimate[::_SHOWN]),
                        ('fixes', trace.fixes)):
        found[f'{name}_x_mm'] = thousandths([pose[0] for pose in poses])
        found[f'{name}_y_mm'] = thousandths([pose[1] for pose in poses])
    return found


def recorded(harness: Harness) -> Measurement:
    """Run the module on a recording; its way in mm, its end, and where others end."""
    path = Path(harness.arguments['data'])
    given = harness.arguments['expected']
    ends = expected(path, Path(given) if given else None)
    roll, pitch, yaw = harness.arguments['imu_mounting']
    drive = replay(read(path), Mounting(rotation_rad=(roll, pitch, yaw)))
    samples, figures = {}, {'poses': float(len(drive.poses))}
    for name, poses in (('estimate', drive.poses), ('odometry', drive.odometry),
                        ('fixes', drive.fixes), ('truth', [pose for _, pose in drive.truth])):
        some = poses[::max(1, len(poses) // _PLOTTED)]
        samples[f'{name}_x_mm'] = thousandths([pose[0] for pose in some])
        samples[f'{name}_y_mm'] = thousandths([pose[1] for pose in some])
    for name, poses in (('estimate', drive.poses), ('odometry', drive.odometry)):
        if poses:
            for axis, value in zip(('x_m', 'y_m', 'heading_rad'), poses[-1]):
                figures[f'{name} {axis}'] = value
    for name, (x, y) in ends.items():
        figures[f'expected {name} x_m'], figures[f'expected {name} y_m'] = x, y
    away, turned = drive.errors()
    if away:
        figures['rms_m'], figures['rms_rad'] = rms(away), rms(turned)
    for name in ('accepted', 'rejected', 'too_late', 'recovered', 'late', 'odom_steps',
                 'odom_jumps', 'odom_not_finite', 'odom_backwards', 'not_finite', 'nis'):
        figures[name] = float(drive.statistics.get(name, 0))
    # Only of a recording with an inertial sensor.
    figures.update({name: float(drive.statistics[name]) for name in (
        'headings', 'headings_refused', 'headings_reopened', 'gyro_gravity_off_deg')
        if name in drive.statistics})
    return Measurement(samples, figures)


def steps(harness: Harness) -> Measurement:
    """Measure what a step costs, in picoseconds."""
    tested: dict[str, Callable[[], object]] = {
        'predict': _predict(), 'correct': _correct(), 'step': _step(0), 'late': _step(25),
        'odometry': _odometry(), 'localization': _localization()}
    harness.prepare(freeze=True)
    share_ns = harness.arguments['measure_ns'] // len(tested)
    return Measurement({name: block_means_ps(operation, share_ns)
                        for name, operation in tested.items()})


def _filter() -> Ekf:
    state = Ekf()
    state.begin((0.0, 0.0, 0.3), _SURE)
    state.begin_drift(0.0, 1e-4)
    return state


def _predict() -> Callable[[], object]:
    state = _filter()
    return lambda: state.predict(0.006, 0.002, 0.02, 1e-7, 1e-6, 0.0, 1e-10)


def _correct() -> Callable[[], object]:
    state = _filter()
    return lambda: state.update_pose((state.x + 1e-4, state.y, state.heading), _SURE)


def _step(late: int) -> Callable[[], object]:
    """Give a step of odometry with a measured pose, so many steps late."""
    localizer = Localizer()
    localizer.begin((0.0, 0.0, 0.0), _SURE)
    stamp_ns = 0

    def step() -> None:
        nonlocal stamp_ns
        stamp_ns += _STEP_NS
        localizer.move(OdometryStep(stamp_ns, 0.006, 0.0, 0.02, 1e-7, 1e-6, 0.0, 1e-10))
        localizer.add_fix(PoseFix(stamp_ns - late * _STEP_NS - _STEP_NS // 3,
                                  (localizer.state.x - 0.006 * late, 0.0, 0.0), _SURE))

    for _ in range(2 * late + 2):
        step()
    return step


def _module(kind: type[Module], bus: Bus, **settings: Any) -> Module:
    module = kind('tested', {**{each.name: each.default for each in kind.fields()}, **settings})
    module.declare(bus, 0.0)
    module.bind(bus, bus.kernel.add_task('tested', module.job, priority=40))
    module.configure()
    return module


def _odometry() -> Callable[[], object]:
    """Give a sample of two wheels that becomes odometry, topics and all."""
    bus = Bus(Kernel(VirtualClock()))
    bus.declare('joint_states', 'sensor_msgs/msg/JointState', _JOINTS)
    joints = bus.publisher('joint_states')
    module = _module(Odometry, bus, wheel_radius_m=0.05, wheel_separation_m=0.3)
    stamp_ns = 0

    def step() -> None:
        nonlocal stamp_ns
        stamp_ns += _STEP_NS
        joints.msg.position[:] = stamp_ns * 6e-9, stamp_ns * 6.1e-9
        joints.publish(stamp_ns)
        module.step()

    return step


def _localization() -> Callable[[], object]:
    """Give a sample of odometry, and a measured pose, that become a pose, topics and all."""
    bus = Bus(Kernel(VirtualClock(start_ns=1 << 60)))
    bus.declare('odom', 'nav_msgs/msg/Odometry', _ODOM)
    bus.declare('stargazer/pose', 'geometry_msgs/msg/PoseWithCovarianceStamped',
                {'header.frame_id': 'map'})
    odom, mark = bus.publisher('odom'), bus.publisher('stargazer/pose')
    odom.msg.pose.pose.orientation.w = mark.msg.pose.pose.orientation.w = 1.0
    mark.msg.pose.covariance[[0, 7, 35]] = 1e-4, 1e-4, 3e-4
    odom.msg.twist.covariance[[0, 35]] = 1e-4, 1e-4
    module = _module(Localization, bus)
    stamp_ns = 0

    def step() -> None:
        nonlocal stamp_ns
        stamp_ns += _STEP_NS
        x = stamp_ns * 3e-10
        mark.msg.pose.pose.position.x = odom.msg.pose.pose.position.x = x
        odom.publish(stamp_ns)
        mark.publish(stamp_ns)
        module.step()

    return step

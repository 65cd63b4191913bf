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
The pose of the robot on its map: ``pose`` and ``map_to_odom``, for each sample of ``odom``.

Between measured poses it uses odometry, which never jumps; measured poses move the frame ``odom``
on the map (REP 105). Without measured poses it continues, and its covariance grows. While there is
no odometry, such as of a board that was unplugged, each measured pose is published as one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from dataclasses import replace
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.localization.corrections import MapCorrections
from rt_robot_os.features.navigation.localization.fix_source import PoseFixSource
from rt_robot_os.features.navigation.localization.odometry_intake import OdometryIntake
from rt_robot_os.features.navigation.localization.odometry_intake import StepTuning
from rt_robot_os.features.navigation.localization.settings import SETTINGS
from rt_robot_os.features.navigation.odometry.gyro import VerticalGyro
from rt_robot_os.features.navigation.odometry.planar import flatten
from rt_robot_os.features.navigation.odometry.planar import half_turn
from rt_robot_os.features.navigation.odometry.planar import set_covariance
from rt_robot_os.modules.base import Module
from rt_robot_os.motion.fix_statistics import disagreement
from rt_robot_os.motion.localizer import Localizer
from rt_robot_os.motion.localizer import LocalizerTuning
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_POSE: Final = 'geometry_msgs/msg/PoseWithCovarianceStamped'
_FIXES: Final = ('fix', 'second_fix', 'third_fix')
# Time of refusals after which a source is reported, though another is used.
_REFUSED_NS: Final = 3 * NS_PER_S
_GYRO_GAP_S: Final = 0.1
_SILENT_S: Final = 1.0
# Time without odometry, at least three of its periods, after which it is not waited for.
_ODOM_WAIT_NS: Final = 3 * NS_PER_S // 10
# A longer pause of measured poses counts as dead time.
_DEAD_NS: Final = NS_PER_S
# A robot does not drive for long on a steeper slope.
_GRAVITY_OFF_RAD: Final = math.radians(15.0)
# With right covariances the mean is 1; for this many its standard deviation is below 0.15.
_NIS_MOST: Final = 2.0
_NIS_FIXES: Final = 50


class Localization(Module):
    """Estimate the pose on the map from odometry, a gyroscope and measured poses."""

    odom = Input('odom', message='nav_msgs/msg/Odometry', wake=True)
    imu = Input('imu/data', message='sensor_msgs/msg/Imu')
    fix = Input('stargazer/pose', message=_POSE, wake=True)
    second_fix = Input('second_fix', message=_POSE, wake=True)
    third_fix = Input('third_fix', message=_POSE, wake=True)
    initial_pose = Input('initialpose', message=_POSE)
    correction = Input('correction', message=_POSE)
    pose = Output('pose', _POSE)
    map_to_odom = Output('map_to_odom', 'geometry_msgs/msg/TransformStamped')

    SETTINGS = SETTINGS

    _intake: OdometryIntake | None = None
    _gyro: VerticalGyro | None = None
    _first_ns = 0
    _begun_ns = 0
    _arrived_ns = 0
    _dead_ns = 0

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Do not subscribe to inputs without a topic, nor to an unused inertial sensor."""
        if attribute == 'imu':
            return bool(self.settings['use_gyro'] or self.settings['use_imu_heading'])
        return bool(self.topic_of(attribute))

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the outputs with the configured frames."""
        s = self.settings
        fixed = {_POSE: {'header.frame_id': s['map_frame_id']}}
        return tuple(replace(p, fixed=fixed.get(p.message, {
            'header.frame_id': s['map_frame_id'], 'child_frame_id': s['odom_frame_id']}))
            for p in super().publications())

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Make the filter and its inputs.

        :raises ConfigError: an input is in another frame.
        """
        s = self.settings
        self._localizer = Localizer(LocalizerTuning(
            kidnapped_s=s['kidnapped_s'], kidnapped_fixes=s['kidnapped_fixes'],
            start_fixes=s['start_fixes'], scale=s['scale_stddev']))
        self._localizer.state.begin_drift(0.0, s[
            'gyro_bias_stddev_rad_s' if s['use_gyro'] else 'wheel_mismatch_stddev_rad_m'] ** 2)
        if self.connected('imu'):
            self._gyro = VerticalGyro(self.imu, self.mountings, _GYRO_GAP_S,
                                      s['use_imu_heading'])
        self._intake = OdometryIntake(
            self.odom, (s['odom_frame_id'], s['base_frame_id']), StepTuning(
                s['speed_max_m_s'], s['gyro_noise_rad'], s['gyro_scale_rad'],
                s['gyro_bias_walk_rad_s' if s['use_gyro'] else 'wheel_mismatch_walk_rad_m'],
                s['imu_heading_stddev_rad'], s['imu_heading_offset_rad']),
            self._gyro, s['use_gyro'])
        self._fixes = [self._source(attribute, number) for number, attribute in enumerate(_FIXES)
                       if self.connected(attribute)]
        self._initial = (self._source('initial_pose', len(_FIXES), timed=False)
                         if self.connected('initial_pose') else None)
        self._corrections = None
        if self.connected('correction'):
            if s['use_imu_heading']:
                raise ConfigError([f'{self.name}: correction_topic turns the map, and '
                                   'use_imu_heading keeps its direction: use one of them'])
            self._corrections = MapCorrections(
                self.correction, self.topic_of('correction'), s['map_frame_id'],
                s['correction_max_m'], self.log)
        if s['initial_pose_known']:
            at, turned = s['initial_stddev_m'] ** 2, s['initial_stddev_rad'] ** 2
            self._localizer.begin(
                (s['initial_x_m'], s['initial_y_m'], s['initial_heading_rad']),
                (at, 0.0, 0.0, at, 0.0, turned))
        flatten(self.pose.msg.pose.covariance)

    def step(self) -> None:
        """Process all new samples; publish a pose for each sample of odometry."""
        localizer, intake, s = self._localizer, self._intake, self.settings
        if intake is None:
            return
        kernel = self.odom.topic.kernel
        now_ns = kernel.now_ns()
        self._first_ns = self._first_ns or now_ns
        located, recovered = localizer.located, localizer.counters.recovered
        reopened = localizer.headings.reopened
        if self._initial is not None:
            self._apply_initial_pose(localizer, self._initial, now_ns)
        if self._corrections is not None:
            self._corrections.apply(localizer, now_ns)
        for source in self._fixes:
            fix = source.next(now_ns)
            while fix is not None:
                localizer.add_fix(fix)
                fix = source.next(now_ns)
        step = intake.next()
        silent_ns = now_ns - (self._arrived_ns or self._first_ns)
        if step is None and localizer.waiting_ns and (
                silent_ns > max(_ODOM_WAIT_NS, 3 * intake.period_ns)):
            self._move_without_odometry(localizer, intake)
        while step is not None:
            self._arrived_ns = now_ns
            if intake.restarted:
                localizer.restart(step.stamp_ns)
            before_ns = localizer.stamp_ns
            if localizer.move(step):
                self._count_dead_time(before_ns)
                if localizer.located:
                    self._publish(localizer, intake)
            step = intake.next()
        self._log_events(localizer, located, recovered)
        if localizer.headings.reopened != reopened:
            self.log.warn('headings of %s contradicted for %.1f s and agree with each other: the '
                          'heading turns by %.0f degrees', self.topic_of('imu'),
                          s['kidnapped_s'], math.degrees(localizer.headings.offset))

    def _apply_initial_pose(self, localizer: Localizer, source: PoseFixSource, now_ns: int
                            ) -> None:
        """Apply the initial pose of an operator."""
        refused = source.refused
        given = source.next(now_ns)
        if source.refused != refused:
            self.log.warn('a pose on %s was refused: %s', source.topic, source.problem)
        if given is not None:
            localizer.begin(given.pose, given.covariance)
            self.log.info('initial pose set to (%.2f m, %.2f m), %.0f degrees', *given.pose[:2],
                          math.degrees(given.pose[2]))

    def _log_events(self, localizer: Localizer, located: bool, recovered: int) -> None:
        """Log that the robot was found, or carried away."""
        if not located and localizer.located:
            self.log.info('found at (%.2f m, %.2f m), %.0f degrees', localizer.state.x,
                          localizer.state.y, math.degrees(localizer.state.heading))
        if localizer.counters.recovered != recovered:
            distance, turn = localizer.jump
            self.log.warn('measured poses contradicted for %.1f s and agree with each other: '
                          'the pose jumps by %.2f m and %.0f degrees',
                          self.settings['kidnapped_s'], distance, math.degrees(turn))

    def statistics(self) -> Mapping[str, Any]:
        """Return the counters of inputs, and the standard deviations of the pose."""
        intake = self._intake
        if intake is None:
            return {}
        localizer = self._localizer
        state = localizer.state
        found: dict[str, Any] = {
            'warning': self._warning(localizer), 'located': localizer.located,
            **asdict(localizer.counters), 'late': localizer.late,
            'latest_ms': localizer.latest_ns / 1e6, 'replayed_steps': localizer.replayed,
            **{f'odom_{name}': value for name, value in asdict(intake.counters).items()},
            'nis': localizer.nis, 'dead_time_s': self._dead_ns / NS_PER_S,
            'jump_m': localizer.jump[0], 'jump_deg': math.degrees(localizer.jump[1]),
            'position_stddev_m': math.sqrt(max(0.0, state.p00 + state.p11)),
            'heading_stddev_deg': math.degrees(math.sqrt(max(0.0, state.p22))),
            'drift': state.drift, 'drift_stddev': math.sqrt(max(0.0, state.p33))}
        for source in self._fixes:
            for name, value in asdict(source.counters).items():
                found[name] = found.get(name, 0) + value
        if self._corrections is not None:
            found.update(asdict(self._corrections.counters))
        if len(self._fixes) > 1:
            found.update(self._sources(localizer))
        if self._gyro is not None:
            found.update(self._gyro.statistics())
            for name, each in (('headings', localizer.headings), ('rests', localizer.drifts)):
                found.update({name: each.accepted, f'{name}_refused': each.refused,
                              f'{name}_refused_in_row': each.in_row,
                              f'{name}_reopened': each.reopened})
        return found

    def _sources(self, localizer: Localizer) -> dict[str, Any]:
        """Return the counters of each source, where there are several."""
        apart_m, apart_rad = disagreement(localizer.records, localizer.stamp_ns)
        found: dict[str, Any] = {'disagreement_m': apart_m,
                                 'disagreement_deg': math.degrees(apart_rad)}
        for source in self._fixes:
            record = localizer.records[source.number]
            found[f'{source.topic} accepted'] = record.accepted
            found[f'{source.topic} rejected'] = record.rejected
        return found

    # ---- work --------------------------------------------------------------------------------

    def _source(self, attribute: str, number: int, timed: bool = True) -> PoseFixSource:
        s = self.settings
        return PoseFixSource(getattr(self, attribute), number, self.topic_of(attribute),
                             s['map_frame_id'],
                             max(s['fix_stddev_min_m'], s.get(f'{attribute}_stddev_min_m', 0.0)),
                             s['fix_stddev_min_rad'],
                             s.get(f'{attribute}_correlation_s', 0.0), timed)

    def _publish(self, localizer: Localizer, intake: OdometryIntake) -> None:
        state, stamp_ns = localizer.state, localizer.stamp_ns
        message = self.pose.msg.pose
        message.pose.position = state.x, state.y, 0.0
        message.pose.orientation = 0.0, 0.0, *half_turn(state.heading)
        set_covariance(message.covariance, state.covariance)
        self.pose.publish(stamp_ns)
        x, y, heading = localizer.transform(intake.pose)
        transform = self.map_to_odom.msg.transform
        transform.translation = x, y, 0.0
        transform.rotation = 0.0, 0.0, *half_turn(heading)
        self.map_to_odom.publish(stamp_ns)

    def _move_without_odometry(self, localizer: Localizer, intake: OdometryIntake) -> None:
        """Advance the estimate by measured poses alone, up to the newest of them."""
        before_ns = localizer.stamp_ns
        if localizer.move(intake.without(localizer.waiting_ns)):
            self._count_dead_time(before_ns)
            if localizer.located:
                self._publish(localizer, intake)

    def _count_dead_time(self, before_ns: int) -> None:
        """Count the time beyond a second without an accepted pose."""
        stamp_ns = self._localizer.stamp_ns
        if not self._begun_ns or not before_ns:
            self._begun_ns = stamp_ns
            return
        dead_ns = stamp_ns - max(self._begun_ns, self._localizer.accepted_ns) - _DEAD_NS
        if dead_ns > 0:
            self._dead_ns += min(dead_ns, stamp_ns - before_ns)

    def _warning(self, localizer: Localizer) -> str:
        kernel, topic = self.odom.topic.kernel, self.topic_of('odom')
        if not self._arrived_ns:
            return f'no samples yet on {topic}'
        silent_s = (kernel.now_ns() - self._arrived_ns) / NS_PER_S
        if silent_s > _SILENT_S:
            return (f'{topic} has been silent, or its clock has stood still, for {silent_s:.1f} s:'
                    ' the pose is that of measured poses alone')
        for source in self._fixes:
            if (why := source.warning()):
                return why
        if not localizer.located:
            return f'the pose is not known yet: no measured poses that agree, on {self._named()}'
        if self._gyro is not None and (why := self._imu_warning(localizer, self._gyro)):
            return why
        if (why := self._source_warning(localizer)):
            return why
        deviation = math.sqrt(max(0.0, localizer.state.p00 + localizer.state.p11))
        if deviation > self.settings['stddev_warn_m']:
            return (f'the standard deviation of the position is {deviation:.1f} m: no measured '
                    'poses are used')
        silent_s = (localizer.stamp_ns - localizer.fix_ns) / NS_PER_S
        if localizer.fix_ns and 0.0 < self.settings['fix_silent_warn_s'] < silent_s:
            return (f'no measured pose for {silent_s:.0f} s on {self._named()}: the pose is that '
                    f'of odometry alone, with a standard deviation of {deviation:.2f} m')
        if localizer.nis > _NIS_MOST and localizer.counters.accepted >= _NIS_FIXES:
            return (f'measured poses scatter {math.sqrt(localizer.nis):.1f} times as much as '
                    'their covariance says')
        if self._gyro is not None and not self._gyro.covered:
            return (f'no samples of {self.topic_of("imu")} at the time of {topic}: the turn is '
                    'that of odometry')
        return ''

    def _imu_warning(self, localizer: Localizer, gyro: VerticalGyro) -> str:
        """Report an inertial sensor that contradicts its mounting, or the estimate."""
        topic = self.topic_of('imu')
        if gyro.gravity_off_rad > _GRAVITY_OFF_RAD:
            return (f'gravity on {topic} is {math.degrees(gyro.gravity_off_rad):.0f} degrees from '
                    'where its mounting says: set mounting_rad of its device')
        headings = localizer.headings
        if headings.refused_s > _SILENT_S:
            return (f'headings of {topic} have contradicted the estimate for '
                    f'{headings.refused_s:.1f} s, by {abs(math.degrees(headings.offset)):.0f} '
                    'degrees: check its mounting_rad, imu_heading_offset_rad, and for iron nearby')
        if localizer.drifts.refused_s > _SILENT_S:
            return (f'the rate of {topic} at rest has contradicted the estimated bias for '
                    f'{localizer.drifts.refused_s:.1f} s: is gyro_bias_stddev_rad_s too small?')
        return ''

    def _source_warning(self, localizer: Localizer) -> str:
        """Report contradictions of measured poses and corrections with the estimate."""
        contradicted_s = (localizer.fix_ns - localizer.accepted_ns) / NS_PER_S
        if localizer.accepted_ns and contradicted_s > _SILENT_S:
            return (f'measured poses have contradicted the estimate for {contradicted_s:.1f} s: '
                    'is the map right?')
        for source in self._fixes:
            record = localizer.records[source.number]
            refused_ns = record.fix_ns - max(record.accepted_ns, self._begun_ns)
            if refused_ns > _REFUSED_NS and localizer.accepted_ns > record.accepted_ns:
                x, y, turn = record.offset
                return (f'{source.topic} has contradicted the estimate for '
                        f'{refused_ns / NS_PER_S:.1f} s, by {math.hypot(x, y):.2f} m and '
                        f'{math.degrees(abs(turn)):.1f} degrees: is its map another one?')
        apart_m, apart_rad = disagreement(localizer.records, localizer.stamp_ns)
        if apart_m > self.settings['disagreement_warn_m']:
            return (f'{self._named()} differ by {apart_m:.2f} m and '
                    f'{math.degrees(apart_rad):.1f} degrees in the mean: are their maps the same?')
        return self._corrections.warning() if self._corrections is not None else ''

    def _named(self) -> str:
        return ', '.join(source.topic for source in self._fixes) or 'any topic; set initial_pose'

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
Attitude of the robot: orientation from an inertial sensor, as ``sensor_msgs/msg/Imu``.

Each new sample of the sensor is published again with an orientation, its covariance, and an
angular velocity without bias. The world's axes are east, north, up as in REP 103 and REP 145.
When the sensor stops publishing, so does this module: nothing old is published as new.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.features.navigation.attitude.base import AttitudeFilter
from rt_robot_os.features.navigation.attitude.base import FilterTuning
from rt_robot_os.features.navigation.attitude.intake import ImuIntake
from rt_robot_os.features.navigation.attitude.mahony import MahonyFilter
from rt_robot_os.features.navigation.attitude.uncertainty import Uncertainty
from rt_robot_os.features.navigation.attitude.vqf_filter import no_vqf
from rt_robot_os.features.navigation.attitude.vqf_filter import VqfFilter
from rt_robot_os.modules.base import Module
from rt_robot_os.motion import quaternion
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

NAMES: Final = ('auto', 'vqf', 'mahony')


def chosen(name: str) -> str:
    """
    Return which filter a name means here; not for the real-time loop.

    :param name: one of :data:`NAMES`; ``auto`` is vqf where it is installed.
    :raises ConfigError: that filter is not installed.
    """
    if name == 'mahony':
        return name
    # Searched for, not imported: this runs whenever a configuration is checked.
    problem = no_vqf()
    if name == 'vqf' and problem:
        raise ConfigError([problem])
    return 'mahony' if problem else 'vqf'


def make_filter(name: str, tuning: FilterTuning, sample_s: float, field_s: float
                ) -> AttitudeFilter:
    """
    Make a filter; not for the real-time loop.

    :param name: one of :data:`NAMES`. With ``auto`` a vqf that cannot be imported is passed over.
    :param sample_s: usual time from sample to sample.
    :param field_s: the same of the magnetic field.
    :raises ConfigError: the filter named is not installed, or cannot be imported.
    """
    makers: dict[str, Callable[[], AttitudeFilter]] = {
        'vqf': lambda: VqfFilter(tuning, sample_s, field_s),
        'mahony': lambda: MahonyFilter(tuning)}
    try:
        return makers[chosen(name)]()
    except ConfigError:
        if name != 'auto':
            raise
        return makers['mahony']()


_IMU: Final = 'sensor_msgs/msg/Imu'
_FIELD: Final = 'sensor_msgs/msg/MagneticField'
# A sensor whose topic does not say how often it measures.
_USUAL_RATE_HZ: Final = 100.0
# A gap is at least so many periods of the sensor, whatever is set.
_GAP_PERIODS: Final = 5.0
_DEFAULT: Final = FilterTuning()
_STDDEV: Final = ('of {} that has settled; 0: the value measured with recordings, see '
                  'docs/attitude.md')


class Attitude(Module):
    """Estimate the orientation of an inertial sensor, with or without magnetometer."""

    imu = Input('imu/data', message=_IMU)
    mag = Input('imu/mag', message=_FIELD)
    attitude = Output('attitude/imu', _IMU, follows='imu')

    SETTINGS = (
        Field('filter', str, 'auto', 'The filter; auto is vqf where it is installed '
              '(pip install vqf), else mahony, which needs nothing', choices=NAMES),
        Field('axes', int, 9, '9: north comes from the magnetic field of mag_topic. 6: without; '
              'the heading is relative to the start, and drifts', choices=(6, 9)),
        Field('frame_id', str, 'imu_link', 'Coordinate frame of the samples: that of the sensor'),
        Field('sample_rate_hz', float, 0.0, 'Samples a second of the sensor, which vqf needs; '
              '0: the rate of its topic. The time between two samples is that of their stamps',
              'Hz', 0.0, 10000.0),
        Field('inclination_time_s', float, _DEFAULT.inclination_time_s,
              'Averaging time of the acceleration to find up. Longer tolerates longer '
              'accelerations, shorter tolerates a worse gyroscope', 's', 0.1, 60.0, live=True),
        Field('heading_time_s', float, _DEFAULT.heading_time_s,
              'The same of the magnetic field, to find north', 's', 0.1, 600.0, live=True),
        Field('declination_deg', float, 0.0, 'How far magnetic north is east of true north at '
              'your place; the heading is then from true north', 'degrees', -180.0, 180.0,
              live=True),
        Field('field_rejection', bool, _DEFAULT.field_rejection,
              'Reject a magnetic field whose length or dip is not that of the earth', live=True),
        Field('bias_in_motion', bool, _DEFAULT.bias_in_motion,
              'Learn the bias of the gyroscope while the sensor moves', live=True),
        Field('bias_at_rest', bool, _DEFAULT.bias_at_rest, 'Learn it while the sensor rests. A '
              'robot that turns for seconds at a steady rate below bias_max_rad_s looks as if at '
              'rest: disable this for such a robot', live=True),
        Field('bias_max_rad_s', float, _DEFAULT.bias_maximum_rad_s,
              'Largest accepted bias, each axis', 'rad/s', 0.0001, 0.5),
        Field('rest_rate_rad_s', float, _DEFAULT.rest_rate_rad_s, 'At rest the angular velocity '
              'stays so near to its average of half a second', 'rad/s', 0.0001, 1.0, live=True),
        Field('rest_acceleration_m_s2', float, _DEFAULT.rest_acceleration_m_s2,
              'The same of the acceleration', 'm/s^2', 0.001, 10.0, live=True),
        Field('gap_max_s', float, 0.25, 'The longest time between two samples to integrate over, '
              'at least five periods of the sensor; after a longer one up and north are found '
              'again', 's', 0.001, 10.0),
        Field('subtract_bias', bool, True, 'Publish the angular velocity without its bias; off: '
              'unmodified', live=True),
        Field('inclination_stddev_rad', float, 0.0,
              'Standard deviation ' + _STDDEV.format('a roll and pitch'), 'rad', 0.0, 1.0,
              live=True),
        Field('heading_stddev_rad', float, 0.0,
              'Standard deviation ' + _STDDEV.format('a heading from the magnetic field'), 'rad',
              0.0, 1.0, live=True),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Check that the filter is available; it is made later.

        :raises ConfigError: it is not installed.
        """
        super().__init__(name, settings)
        chosen(settings['filter'])
        self._with_field = settings['axes'] == 9
        self._filter: AttitudeFilter | None = None

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Do not subscribe to the magnetometer when its field is not used."""
        return attribute != 'mag' or self._with_field

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the output, in the frame of the sensor."""
        return tuple(replace(p, fixed={'header.frame_id': self.settings['frame_id']})
                     for p in super().publications())

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Make the filter.

        :raises ConfigError: the sensor is in another frame, or vqf cannot be imported.
        """
        frame = self.imu.msg.header.frame_id
        if frame != self.settings['frame_id']:
            raise ConfigError([
                f'{self.name}.frame_id = {self.settings["frame_id"]!r}: {self.topic_of("imu")} '
                f'is in the frame {frame!r}, and so is its orientation: set frame_id to it'])
        sample_hz = (self.settings['sample_rate_hz'] or self.imu.topic.rate_hz or _USUAL_RATE_HZ)
        field_hz, mag = sample_hz, None
        if self._with_field:
            mag = self.mag
            field_hz = mag.topic.rate_hz or sample_hz
        gap_s = max(self.settings['gap_max_s'], _GAP_PERIODS / sample_hz)
        self._intake = ImuIntake(self.imu, mag, 1 / sample_hz, gap_s)
        self._filter = make_filter(
            self.settings['filter'], self._tuning(), 1 / sample_hz, 1 / field_hz)
        self._uncertainty = Uncertainty(
            self._with_field, self.settings['inclination_stddev_rad'],
            self.settings['heading_stddev_rad'])
        self._turn_to_true_north()

    def changed(self, name: str) -> None:
        """Apply a setting between two samples."""
        if self._filter is None:
            return
        if name == 'declination_deg':
            self._turn_to_true_north()
        elif name.endswith('_stddev_rad'):
            self._uncertainty.settle_at(self.settings['inclination_stddev_rad'],
                                        self.settings['heading_stddev_rad'])
        elif name != 'subtract_bias':
            self._filter.tune(self._tuning())

    def step(self) -> None:
        """Process all new samples and publish each with its orientation."""
        intake = self._intake
        while intake.next_sample():
            self._update(intake)

    def statistics(self) -> dict[str, Any]:
        """Return the counters of samples, and the state of the filter."""
        now = self._filter
        if now is None:
            return {}
        counters = self._intake.counters
        warning = ''
        if counters.samples and not now.aligned:
            warning = 'no acceleration yet: up is unknown'
        elif self._with_field and counters.samples and not now.heading_known:
            warning = f'no magnetic field yet on {self.topic_of("mag")}: north is unknown'
        x, y, z = now.bias
        return {
            'warning': warning, 'filter': now.name, **counters.as_dict(),
            'bias_x_rad_s': x, 'bias_y_rad_s': y, 'bias_z_rad_s': z,
            'bias_stddev_rad_s': now.bias_stddev, 'at_rest': now.at_rest,
            'acceleration_rejected': now.acceleration_rejected,
            'field_rejected': now.field_rejected,
            'inclination_stddev_deg': math.degrees(self._uncertainty.inclination),
            'heading_stddev_deg': math.degrees(self._uncertainty.heading)}

    # ---- work --------------------------------------------------------------------------------

    def _update(self, intake: ImuIntake) -> None:
        estimate, uncertainty = self._filter, self._uncertainty
        if estimate is None:
            return
        if intake.gap_s:
            estimate.restart()
            uncertainty.restart(intake.gap_s)
        turned = estimate.update(intake.rate, intake.acceleration, intake.field, intake.dt_s)
        uncertainty.update(estimate, intake.acceleration is not None, intake.field is not None,
                           intake.dt_s)
        self._publish(estimate, turned)

    def _publish(self, estimate: AttitudeFilter, turned: Quaternion) -> None:
        source, message = self.imu.msg, self.attitude.msg
        covariance = message.orientation_covariance
        if estimate.aligned:
            message.orientation = quaternion.multiply(self._to_true_north, turned)
            inclination, heading = self._uncertainty.inclination, self._uncertainty.heading
            covariance[0] = covariance[4] = inclination * inclination
            covariance[8] = heading * heading
        else:
            message.orientation = quaternion.IDENTITY
            covariance[0], covariance[4], covariance[8] = -1.0, 0.0, 0.0
        x, y, z = self._intake.rate
        if self.settings['subtract_bias']:
            a, b, c = estimate.bias
            x, y, z = x - a, y - b, z - c
        message.angular_velocity = x, y, z
        message.linear_acceleration = source.linear_acceleration
        message.angular_velocity_covariance[:] = source.angular_velocity_covariance
        message.linear_acceleration_covariance[:] = source.linear_acceleration_covariance
        self.attitude.publish(self.imu.stamp_ns)

    def _tuning(self) -> FilterTuning:
        s = self.settings
        return FilterTuning(
            s['inclination_time_s'], s['heading_time_s'], s['bias_in_motion'], s['bias_at_rest'],
            s['bias_max_rad_s'], s['rest_rate_rad_s'], s['rest_acceleration_m_s2'],
            s['field_rejection'])

    def _turn_to_true_north(self) -> None:
        """Set the rotation from magnetic to true north."""
        angle = -math.radians(self.settings['declination_deg']) if self._with_field else 0.0
        self._to_true_north = quaternion.about_up(angle)

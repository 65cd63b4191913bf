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
The filters that are compared: ours, and those of other packages, each as its documentation says.

All get each sample once, in order. The magnetic field is given when it has changed; to filters
that want one with each sample the last one is given again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import itertools
import math
from typing import Any
from typing import Final

from benchmarks.attitude_comparison.recordings import Array
from benchmarks.attitude_comparison.recordings import Recording
import numpy as np

from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.features.navigation.attitude import AttitudeFilter
from rt_robot_os.features.navigation.attitude import FilterTuning
from rt_robot_os.features.navigation.attitude import MahonyFilter
from rt_robot_os.features.navigation.attitude import VqfFilter
from rt_robot_os.motion.quaternion import about_up
from rt_robot_os.motion.quaternion import from_up
from rt_robot_os.motion.quaternion import heading_of_field
from rt_robot_os.motion.quaternion import IDENTITY
from rt_robot_os.motion.quaternion import multiply
from rt_robot_os.motion.quaternion import Quaternion


@dataclass(frozen=True)
class Peer:
    """
    A filter.

    :ivar package: on PyPI; empty for our own.
    :ivar axes: 9 with magnetometer, 6 without.
    :ivar run: gives the orientation after each sample; raises ImportError without the package.
    """

    name: str
    package: str
    axes: int
    run: Callable[[Recording], Array]


def ours(make: Callable[[Recording], AttitudeFilter], axes: int) -> Callable[[Recording], Array]:
    """Run one of our filters as the module does."""
    def run(recording: Recording) -> Array:
        attitude = make(recording)
        times = recording.time_s.tolist()
        steps = [times[1] - times[0], *(b - a for a, b in itertools.pairwise(times))]
        new = fields_new(recording)
        return np.array([
            attitude.update(tuple(rate), tuple(force), tuple(field) if is_new else None, dt_s)
            for rate, force, field, is_new, dt_s in zip(
                recording.rate.tolist(), recording.acceleration.tolist(),
                recording.field.tolist(), new.tolist() if axes == 9 else itertools.repeat(False),
                steps)])

    return run


def fields_new(recording: Recording) -> Any:
    """Return for each row whether the magnetometer has measured anew."""
    return np.concatenate(([True], (np.diff(recording.field, axis=0) != 0).any(axis=1)))


def vqf_filter(recording: Recording) -> AttitudeFilter:
    """Make our adapter of vqf."""
    sample_s = 1 / recording.rate_hz
    field_s = sample_s * len(recording.field) / max(1, int(fields_new(recording).sum()))
    return VqfFilter(FilterTuning(), sample_s, field_s)


def _ahrs(name: str, axes: int, **gains: float) -> Callable[[Recording], Array]:
    def run(recording: Recording) -> Array:
        from ahrs import filters
        fields = {'mag': recording.field} if axes == 9 else {}
        # Its own first guess is made for other axes of the world than its steps.
        x, y, z, w = _first(recording, axes, quarter=name == 'Madgwick')
        made = getattr(filters, name)(
            gyr=recording.rate, acc=recording.acceleration, frequency=recording.rate_hz,
            q0=np.array((w, x, y, z)), **fields, **gains)
        turned: Array = np.asarray(made.Q)[:, [1, 2, 3, 0]]
        return turned

    return run


def _first(recording: Recording, axes: int, quarter: bool) -> Quaternion:
    """
    Return the orientation that the first sample shows.

    :param quarter: with x to the north, as Madgwick has it, not to the east.
    """
    force, field = recording.acceleration[0].tolist(), recording.field[0].tolist()
    turned = from_up(tuple(force)) or IDENTITY
    if axes == 9:
        turned = multiply(about_up(-heading_of_field(turned, tuple(field))[0]), turned)
        turned = multiply(about_up(-math.pi / 2), turned) if quarter else turned
    return turned


def _imufusion(axes: int, timeout_s: float) -> Callable[[Recording], Array]:
    def run(recording: Recording) -> Array:
        import imufusion
        made = imufusion.Ahrs()
        made.set_settings(imufusion.AhrsSettings(
            sample_rate=recording.rate_hz, convention=imufusion.CONVENTION_ENU, gain=0.5,
            gyroscope_range=2000.0, acceleration_rejection=10.0, magnetic_rejection=10.0,
            rejection_timeout=timeout_s))
        bias = imufusion.Bias()
        bias.set_settings(imufusion.BiasSettings(sample_rate=recording.rate_hz))
        result = np.empty((len(recording.rate), 4))
        rates = np.degrees(recording.rate)
        forces = recording.acceleration / STANDARD_GRAVITY_M_S2
        for row, (rate, force, field) in enumerate(zip(rates, forces, recording.field)):
            rate = bias.update(rate)
            if axes == 9:
                made.update(rate, force, field)
            else:
                made.update_no_magnetometer(rate, force)
            result[row] = made.get_quaternion()
        return result[:, [1, 2, 3, 0]]

    return run


def _mahony(recording: Recording) -> AttitudeFilter:
    return MahonyFilter(FilterTuning())


# imufusion: as in its example, which gives a rejected field up after 5 s, and after 60 s as ours
# and vqf do. ahrs: its own gains, and those that the authors of BROAD found best for all of it.
PEERS: Final = (
    Peer('mahony', '', 9, ours(_mahony, 9)),
    Peer('vqf', 'vqf', 9, ours(vqf_filter, 9)),
    Peer('imufusion, 5 s', 'imufusion', 9, _imufusion(9, 5.0)),
    Peer('imufusion, 60 s', 'imufusion', 9, _imufusion(9, 60.0)),
    Peer('ahrs Mahony', 'ahrs', 9, _ahrs('Mahony', 9)),
    Peer('ahrs Mahony, tuned', 'ahrs', 9, _ahrs('Mahony', 9, k_P=0.74, k_I=0.0012)),
    Peer('ahrs Madgwick', 'ahrs', 9, _ahrs('Madgwick', 9)),
    Peer('ahrs Madgwick, tuned', 'ahrs', 9, _ahrs('Madgwick', 9, gain_marg=0.12)),
    Peer('mahony', '', 6, ours(_mahony, 6)),
    Peer('vqf', 'vqf', 6, ours(vqf_filter, 6)),
    Peer('imufusion', 'imufusion', 6, _imufusion(6, 5.0)),
    Peer('ahrs Mahony, tuned', 'ahrs', 6, _ahrs('Mahony', 6, k_P=0.74, k_I=0.0012)),
    Peer('ahrs Madgwick', 'ahrs', 6, _ahrs('Madgwick', 6)),
    Peer('ahrs Madgwick, tuned', 'ahrs', 6, _ahrs('Madgwick', 6, gain_imu=0.12)),
)

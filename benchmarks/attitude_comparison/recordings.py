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

"""Recordings of inertial sensors, with what is known of how they were turned."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2

Array = npt.NDArray[np.float64]
# Names in the files of BROAD.
_BROAD: Final = ('imu_gyr', 'imu_acc', 'imu_mag', 'opt_quat', 'movement', 'sampling_rate')
BROAD_ENDINGS: Final = ('.hdf5', '.mat')


@dataclass(frozen=True)
class Recording:
    """
    Samples, a row each.

    :ivar time_s: of each sample.
    :ivar rate: rad/s.
    :ivar acceleration: m/s^2.
    :ivar field: the same row again where the magnetometer has measured nothing new.
    :ivar reference: the true orientation as x, y, z, w; NaN where the cameras lost it. None when
        there is none.
    :ivar counted: the rows that count for the error.
    """

    name: str
    time_s: Array
    rate: Array
    acceleration: Array
    field: Array
    reference: Array | None
    counted: npt.NDArray[np.bool_]

    @property
    def rate_hz(self) -> float:
        """Return the samples a second."""
        return float((len(self.time_s) - 1) / (self.time_s[-1] - self.time_s[0]))


def xio(path: Path) -> Recording:
    """
    Read the recording of x-io Technologies: moved by hand, 100 Hz, no reference.

    Its columns are s, degrees/s, g and microtesla.
    """
    rows = np.loadtxt(path, delimiter=',', skiprows=1)
    return Recording(
        path.stem, rows[:, 0].copy(), np.radians(rows[:, 1:4]),
        rows[:, 4:7] * STANDARD_GRAVITY_M_S2, rows[:, 7:10].copy(), None,
        np.ones(len(rows), np.bool_))


def broad_files(folder: Path) -> list[Path]:
    """List the trials of BROAD in a folder and the folders in it, one file each, by name."""
    found = {path.stem: path for ending in reversed(BROAD_ENDINGS)
             for path in sorted(folder.rglob(f'[0-9][0-9]_*{ending}'))}
    return [found[name] for name in sorted(found)]


def broad(path: Path) -> Recording:
    """
    Read a trial of BROAD, the benchmark of Laidig, Caruso, Cereatti and Seel (CC BY 4.0).

    Its orientation was measured with cameras; the trials begin and end at rest, and what counts is
    the movement between.

    :raises ConfigError: the package that reads such files is not installed, or it is another file.
    """
    data = _hdf5(path) if path.suffix == '.hdf5' else _mat(path)
    try:
        rate, force, field, turned, moves, rate_hz = (data[name] for name in _BROAD)
    except KeyError as error:
        raise ConfigError([f'{path}: no {error} in it, so it is no trial of BROAD']) from None
    return Recording(
        path.stem, np.arange(len(rate)) / float(np.squeeze(rate_hz)), _floats(rate),
        _floats(force), _floats(field), _floats(turned[:, [1, 2, 3, 0]]),
        np.squeeze(moves).astype(np.bool_))


def _floats(values: Any) -> Array:
    return np.ascontiguousarray(values, np.float64)


def _hdf5(path: Path) -> dict[str, Any]:
    try:
        import h5py
    except ImportError as error:
        raise ConfigError([f'{path}: python3 -m pip install h5py ({error})']) from error
    with h5py.File(path) as file:
        return {**{name: np.array(file[name]) for name in file}, **file.attrs}


def _mat(path: Path) -> dict[str, Any]:
    try:
        from scipy.io import loadmat
    except ImportError as error:
        raise ConfigError([f'{path}: python3 -m pip install scipy ({error})']) from error
    loaded: dict[str, Any] = loadmat(path)
    return loaded

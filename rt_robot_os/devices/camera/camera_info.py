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

"""Calibration of a camera: a file of the ROS package camera_calibration, as CameraInfo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.linux.file_urls import path_of
from rt_robot_os.linux.folders import read_file

_REMEDY: Final = 'use a file of camera_calibration, or delete camera_info'
_LARGEST: Final = 1e12  # also an integer may be too large for a float; NaN is not below it
_IDENTITY: Final = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
# Number of coefficients of each model, as in image_geometry and OpenCV.
_MODELS: Final = {'': (0,), 'plumb_bob': (4, 5), 'rational_polynomial': (8, 12, 14),
                  'equidistant': (4,), 'fisheye': (4,), 'thin_prism': (12, 14)}


@dataclass(frozen=True)
class CameraCalibration:
    """
    The content of CameraInfo, without the header.

    :ivar k: 3x3 row by row; all 0 for an uncalibrated camera.
    """

    width: int
    height: int
    model: str
    d: tuple[float, ...]
    k: tuple[float, ...]
    r: tuple[float, ...]
    p: tuple[float, ...]

    @property
    def fixed(self) -> dict[str, object]:
        """Return the fields that are fixed at declaration."""
        return {'distortion_model': self.model, 'd': len(self.d)}

    def fill(self, message: Any) -> None:
        """Write it into a CameraInfo; called once, because it does not change."""
        message.height, message.width = self.height, self.width
        if self.d:
            message.d[:] = self.d
        message.k[:], message.r[:], message.p[:] = self.k, self.r, self.p


def uncalibrated(width: int, height: int) -> CameraCalibration:
    """Return the CameraInfo of an uncalibrated camera: K[0] is 0."""
    return CameraCalibration(width, height, '', (), (0.0,) * 9, (0.0,) * 9, (0.0,) * 12)


def load_calibration(url: str, width: int, height: int) -> CameraCalibration:
    """
    Read a calibration; not for the real-time loop.

    :param width: of the pictures of the camera.
    :raises ConfigError: the file is missing, damaged, or for pictures of another size.
    """
    import yaml
    path = path_of(url, 'camera_info')
    try:
        content = yaml.safe_load(read_file(path).decode('utf-8'))
    except OSError as error:
        raise ConfigError([f'camera_info {path}: {error.strerror}: {_REMEDY}']) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError([f'camera_info {path} is no YAML: {error}: {_REMEDY}']) from error
    if not isinstance(content, Mapping):
        raise ConfigError([f'camera_info {path} contains no calibration: {_REMEDY}'])
    return _checked(content, path, width, height)


def _checked(content: Mapping[str, Any], path: Path, width: int, height: int
             ) -> CameraCalibration:
    problems: list[str] = []
    size = (content.get('image_width'), content.get('image_height'))
    if size != (width, height):
        problems.append(f'image_width and image_height are {size[0]}x{size[1]}, the camera has '
                        f'{width}x{height}: calibrate for this size, or set width and height')
    model = content.get('distortion_model', 'plumb_bob')
    d = _numbers(content, 'distortion_coefficients', 0, problems)
    if not isinstance(model, str) or model not in _MODELS:
        problems.append(f'distortion_model is {model!r}: use one of '
                        f'{", ".join(name for name in _MODELS if name)}')
    elif d is not None and len(d) not in _MODELS[model]:
        counts = ' or '.join(map(str, _MODELS[model]))
        problems.append(f'{model} takes {counts} distortion_coefficients, not {len(d)}')
    k = _numbers(content, 'camera_matrix', 9, problems)
    r = _numbers(content, 'rectification_matrix', 9, problems, _IDENTITY)
    p = _numbers(content, 'projection_matrix', 12, problems, (0.0,) * 12)
    if problems or d is None or k is None or r is None or p is None:
        raise ConfigError([f'camera_info {path}: {text}' for text in problems])
    return CameraCalibration(width, height, model, d, k, r, p)


def _numbers(content: Mapping[str, Any], key: str, count: int, problems: list[str],
             absent: tuple[float, ...] | None = None) -> tuple[float, ...] | None:
    part = content.get(key)
    if part is None and absent is not None:
        return absent
    data = part.get('data') if isinstance(part, Mapping) else None
    good = isinstance(data, list) and len(data) <= 64 and all(
        isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < _LARGEST for v in data)
    if not good or data is None or (count and len(data) != count):
        wanted = f'{count} numbers' if count else 'numbers'
        problems.append(f'{key}.data must be a list of {wanted}: {_REMEDY}')
        return None
    return tuple(float(v) for v in data)

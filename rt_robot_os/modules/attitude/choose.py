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


"""Choose a filter by name."""

from __future__ import annotations

from collections.abc import Callable
import importlib.util
from typing import Final

from rt_robot_os.errors import ConfigError
from rt_robot_os.modules.attitude.base import AttitudeFilter
from rt_robot_os.modules.attitude.base import Tuning
from rt_robot_os.modules.attitude.mahony import MahonyFilter
from rt_robot_os.modules.attitude.vqf_filter import INSTALL
from rt_robot_os.modules.attitude.vqf_filter import VqfFilter

NAMES: Final = ('auto', 'vqf', 'mahony')


def chosen(name: str) -> str:
    """
    Return which filter a name means here; not for the real-time loop.

    :param name: one of :data:`NAMES`; ``auto`` is vqf where it is installed.
    :raises ConfigError: that filter is not installed.
    """
    if name == 'mahony':
        return name
    # Looked for, not imported: this is asked of every configuration that is only checked.
    installed = importlib.util.find_spec('vqf') is not None
    if name == 'vqf' and not installed:
        raise ConfigError([f"filter = 'vqf': the package vqf is not installed: {INSTALL}, or "
                           'choose auto or mahony'])
    return 'vqf' if installed else 'mahony'


def make_filter(name: str, tuning: Tuning, sample_s: float, field_s: float) -> AttitudeFilter:
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

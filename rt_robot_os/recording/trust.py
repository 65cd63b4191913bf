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
Check which classes the configuration of a recording may import: its source may be untrusted.

The type of a module can name any class of any Python package, and its import runs code. So only
registered types of this installation are used, and those that the user permits.
"""

from __future__ import annotations

from collections.abc import Collection
from importlib.util import find_spec
from pathlib import Path

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.modules.registry import MODULES
from rt_robot_os.settings import RobotSettings


def check_trusted(settings: RobotSettings, allowed: Collection[str] = ()) -> None:
    """
    Check that a configuration imports only registered types; imports nothing itself.

    :param allowed: types of modules, ``package.module:Class``, that the user permits.
    :raises RecordingError: it would import others; the message gives the remedy.
    """
    known = {*MODULES.names(), *allowed}
    for module in settings.modules:
        if module.type not in known:
            raise RecordingError(
                f'the recording would import {module.type!r:.200} for its module '
                f'{module.name!r:.80}, which is not registered. If you trust it, permit it: '
                f'--allow {module.type:.200}')
    for device in settings.devices:
        if device.type not in DRIVERS.names():
            raise RecordingError(
                f'the recording has a device {device.name!r:.80} of type {device.type!r:.80}, for '
                'which no driver is installed; install its package')
    for topic in settings.topics:
        package = topic.message.partition('/')[0]
        if not _has_messages(package):
            raise RecordingError(
                f'the recording has a topic {topic.topic!r:.80} of type {topic.message!r:.200}, '
                f'but the ROS 2 package {package!r:.80} with its messages is not installed')


def _has_messages(package: str) -> bool:
    if not package.isidentifier():
        return False
    try:
        spec = find_spec(package)
    except (ImportError, ValueError):
        return False
    return spec is not None and any(
        (Path(place) / 'msg' / '__init__.py').is_file()
        for place in spec.submodule_search_locations or ())

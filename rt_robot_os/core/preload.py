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

"""What a core does while it waits for its settings: it imports what they will name."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TextIO

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.core.part import installed_parts
from rt_robot_os.core.simulators import device_folder
from rt_robot_os.core.simulators import Simulators
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.modules.registry import module_class
from rt_robot_os.settings import from_json
from rt_robot_os.topics.resolve import message_class


def preload(stdin: TextIO, simulators: Simulators, path: Path | None) -> None:
    """
    Read the expected settings, and import what they name; opens nothing.

    Problems are ignored here: they are reported when the final settings are read.

    :param stdin: begins with a line of settings; an empty line if they are not known yet.
    :param path: of the core's socket; None for the default.
    """
    try:
        settings = from_json(stdin.readline())
    except ConfigError:
        return
    if simulators.wanted(settings):
        with suppress(OSError, RtRobotError):
            simulators.load(device_folder(path or socket_path()))
    messages = dict.fromkeys([*(each.message for each in settings.mirrors),
                              *(each.message for each in settings.topics)])
    for load, names in ((DRIVERS.load, [each.type for each in settings.devices]),
                        (module_class, [each.type for each in settings.modules]),
                        (message_class, messages)):
        for name in names:
            with suppress(RtRobotError):
                load(name)
    with suppress(RtRobotError):
        installed_parts()

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
Add the settings that are newer than a recording.

A recording has the settings of the release that made it. Settings of later releases are added
here, so that every recording can still be replayed.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from rt_robot_os.base.schema import ABSENT
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.modules.registry import module_class
from rt_robot_os.settings import RobotSettings


def completed(settings: RobotSettings) -> tuple[RobotSettings, list[str]]:
    """
    Complete the settings of devices and modules; imports their classes.

    :param settings: of a recording, with classes that may be imported.
    :return: the settings, and the keys that were added, such as ``guard.unseen``.
    """
    devices = [(each, _added(each.settings, DRIVERS.load(each.type).fields()))
               for each in settings.devices]
    modules = [(each, _added(each.settings, module_class(each.type).fields()))
               for each in settings.modules]
    keys = [f'{each.name}.{key}' for each, added in devices for key in added]
    keys += [f'{each.name}.{key}' for each, added in modules for key in added]
    return replace(
        settings,
        devices=tuple(replace(each, settings={**each.settings, **added})
                      for each, added in devices),
        modules=tuple(replace(each, settings={**each.settings, **added})
                      for each, added in modules)), keys


def _added(given: Mapping[str, Any], fields: Iterable[Field]) -> dict[str, Any]:
    """Return the settings that were not recorded, with values that do not change a replay."""
    return {field.name: field.value_before() for field in fields
            if field.name not in given and field.value_before() not in (ABSENT, REQUIRED)}

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


"""The settings of the robot itself by section, as they are declared in the model."""

from __future__ import annotations

from typing import Final

from rt_robot_os.schema import declared
from rt_robot_os.settings.model import CoreSettings
from rt_robot_os.settings.model import DeviceSettings
from rt_robot_os.settings.model import LISTS
from rt_robot_os.settings.model import LogSettings
from rt_robot_os.settings.model import MirrorSettings
from rt_robot_os.settings.model import ModuleSettings
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import SLOWEST_HZ
from rt_robot_os.settings.model import TaskSettings
from rt_robot_os.settings.model import TopicSettings
from rt_robot_os.settings.model import WatchdogSettings

__all__ = ['CORE', 'DEVICE', 'LISTS', 'LOG', 'MIRROR', 'MODULE', 'ROBOT', 'SLOWEST_HZ', 'TASK',
           'TOPIC', 'WATCHDOG']

ROBOT: Final = declared(RobotSettings)
CORE: Final = declared(CoreSettings)
WATCHDOG: Final = declared(WatchdogSettings)
LOG: Final = declared(LogSettings)
TASK: Final = declared(TaskSettings)
DEVICE: Final = declared(DeviceSettings)
MODULE: Final = declared(ModuleSettings)
TOPIC: Final = declared(TopicSettings)
MIRROR: Final = declared(MirrorSettings)

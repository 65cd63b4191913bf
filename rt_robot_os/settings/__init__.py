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
Settings: ROS 2 parameter files to frozen, checked facts; every problem is reported at once.

Nothing is opened here, and nothing of ROS 2 is needed.
"""

from __future__ import annotations

from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from rt_robot_os.settings.catalogue import Catalogue
    from rt_robot_os.settings.catalogue import PartKind
    from rt_robot_os.settings.files import default_path
    from rt_robot_os.settings.json_text import from_json
    from rt_robot_os.settings.json_text import to_json
    from rt_robot_os.settings.load import load
    from rt_robot_os.settings.model import DeviceSettings
    from rt_robot_os.settings.model import MirrorSettings
    from rt_robot_os.settings.model import ModuleSettings
    from rt_robot_os.settings.model import RobotSettings
    from rt_robot_os.settings.model import SIM_PORT
    from rt_robot_os.settings.model import TaskSettings
    from rt_robot_os.settings.model import TopicSettings
    from rt_robot_os.settings.parameters import changed
    from rt_robot_os.settings.parameters import check_change
    from rt_robot_os.settings.parameters import ParameterDescription
    from rt_robot_os.settings.parameters import parameters
    from rt_robot_os.settings.parameters import RobotParameters
    from rt_robot_os.settings.process_model import CoreSettings
    from rt_robot_os.settings.process_model import LogSettings
    from rt_robot_os.settings.process_model import WatchdogSettings
    from rt_robot_os.settings.ros_args import parse_ros_args
    from rt_robot_os.settings.ros_args import RosArguments
    from rt_robot_os.settings.service_model import ServiceSettings
    from rt_robot_os.sim.world_settings import WorldSettings

# The module of each name, relative to this package.
_PLACES: Final = {
    'Catalogue': 'catalogue',
    'CoreSettings': 'process_model',
    'DeviceSettings': 'model',
    'LogSettings': 'process_model',
    'MirrorSettings': 'model',
    'ModuleSettings': 'model',
    'ParameterDescription': 'parameters',
    'PartKind': 'catalogue',
    'RobotParameters': 'parameters',
    'RobotSettings': 'model',
    'RosArguments': 'ros_args',
    'SIM_PORT': 'model',
    'ServiceSettings': 'service_model',
    'TaskSettings': 'model',
    'TopicSettings': 'model',
    'WatchdogSettings': 'process_model',
    'WorldSettings': '.sim.world_settings',
    'changed': 'parameters',
    'check_change': 'parameters',
    'default_path': 'files',
    'from_json': 'json_text',
    'load': 'load',
    'parameters': 'parameters',
    'parse_ros_args': 'ros_args',
    'to_json': 'json_text',
}
__all__ = [
    'Catalogue', 'CoreSettings', 'DeviceSettings', 'LogSettings', 'MirrorSettings',
    'ModuleSettings', 'ParameterDescription', 'PartKind', 'RobotParameters', 'RobotSettings',
    'RosArguments', 'SIM_PORT', 'ServiceSettings', 'TaskSettings', 'TopicSettings',
    'WatchdogSettings',
    'WorldSettings', 'changed', 'check_change', 'default_path', 'from_json', 'load', 'parameters',
    'parse_ros_args', 'to_json',
]

lazy_names(__name__, _PLACES)

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

"""The modules by the name that ``type`` has in the configuration, or ``package.module:Class``."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.plugins import PluginRegistry
from rt_robot_os.modules.base import Module

_OWN: Final = {
    'agent': 'rt_robot_os.features.agent.module:AgentModule',
    'alarms': 'rt_robot_os.features.alarms.module:Alarms',
    'assessment': 'rt_robot_os.features.health.assessment:Assessment',
    'attitude': 'rt_robot_os.features.navigation.attitude:Attitude',
    'collision_guard': 'rt_robot_os.features.navigation.collision_guard:CollisionGuard',
    'fall_detector': 'rt_robot_os.features.health.fall_detector:FallDetection',
    'localization': 'rt_robot_os.features.navigation.localization:Localization',
    'observer': 'rt_robot_os.features.agent.observer:Observer',
    'odometry': 'rt_robot_os.features.navigation.odometry:Odometry',
    'person_finder': 'rt_robot_os.features.agent.person_finder:PersonFinder',
    'planner': 'rt_robot_os.features.navigation.planner:Planner',
    'pulse_check': 'rt_robot_os.features.health.pulse_check:PulseCheck',
    'rule': 'rt_robot_os.features.health.rule:RuleModule',
    'sensor_network': 'rt_robot_os.features.wsn.sensor_network:SensorNetwork',
    'sensor_readings': 'rt_robot_os.features.wsn.sensor_readings:SensorReadings',
    'trajectory': 'rt_robot_os.features.navigation.trajectory:Trajectory',
    'twist_guard': 'rt_robot_os.features.navigation.twist_guard:TwistGuard',
    'velocity_mux': 'rt_robot_os.features.navigation.velocity_mux:VelocityMux',
    'vital_signs': 'rt_robot_os.features.health.vital_signs:VitalSigns',
    'watch': 'rt_robot_os.features.alarms.watch:Watch',
    'whereabouts': 'rt_robot_os.features.health.whereabouts:Whereabouts',
}

MODULES: Final[PluginRegistry[Module]] = PluginRegistry(
    'rt_robot_os.modules', Module, 'module', _OWN)


def names() -> tuple[str, ...]:
    """Return the registered names, sorted."""
    return MODULES.names()


def module_class(name: str) -> type[Module]:
    """
    Find a module class; not for the real-time loop.

    :param name: a registered name, or ``package.module:Class`` for one that is not registered.
    :raises ConfigError: there is none of that name, or it cannot be imported.
    """
    if ':' in name:
        return PluginRegistry(MODULES.group, Module, 'module', {name: name}).load(name)
    return MODULES.load(name)

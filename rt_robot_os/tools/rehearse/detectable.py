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

"""The emergencies that a robot can detect with its settings, with their person or place."""

from __future__ import annotations

from collections.abc import Iterator

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import RobotSettings
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.scenario import CALLERS

_BUTTON = 'alarm'
_SMOKE = 'smoke'


def detectable_emergencies(settings: RobotSettings, world: World) -> tuple[tuple[str, str], ...]:
    """
    Return the emergencies that the robot should detect, with the person or the place.

    :raises ConfigError: it cannot detect any.
    """
    found = tuple(dict.fromkeys(_detectable(settings, world)))
    if not found:
        raise ConfigError(['this robot detects no emergencies: it needs a world with people, '
                           'and a fall_detector, an assessment, or a rule of kind help or '
                           'smoke, as in config/assisted_living.yaml'])
    return found


def nodes_of(world: World) -> tuple[str, ...]:
    """Return the names of the nodes that may die."""
    return tuple(node.name for node in world.nodes)


def _detectable(settings: RobotSettings, world: World) -> Iterator[tuple[str, str]]:
    people = {person.name for person in world.people}
    belts = {device.sim.get('on') for device in settings.devices if device.sim}
    buttons = {node.person for node in world.nodes if _BUTTON in node.quantities}
    smells = {node.name for node in world.nodes if _SMOKE in node.quantities}
    for module in settings.modules:
        values = module.settings
        person, subject = values.get('person'), values.get('subject')
        if module.type == 'fall_detector' and person in people & belts:
            yield 'fall', person
        elif module.type == 'assessment' and person in people:
            yield 'sick', person
        elif module.type == 'rule' and values.get('kind') == 'help' and subject in buttons:
            yield 'help', subject
        elif module.type == 'rule' and values.get('kind') == 'smoke' and subject in smells:
            yield 'smoke', subject
        elif module.type == 'agent':  # causes of other programs are served as well
            yield from (('call', caller) for caller in CALLERS)

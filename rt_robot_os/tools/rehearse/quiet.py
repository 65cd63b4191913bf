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

"""Command ``rehearse quiet``: hours without emergencies, to count false alarms."""

from __future__ import annotations

import argparse
from collections import Counter
import json
import time
from typing import Any

from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.settings import RobotSettings
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.detectable import nodes_of
from rt_robot_os.tools.rehearse.options import add_settings
from rt_robot_os.tools.rehearse.options import settings_of
from rt_robot_os.tools.rehearse.scenario import quiet_scenario
from rt_robot_os.tools.rehearse.scenario_run import ScenarioRun


def add_to(commands: Any) -> None:
    """Add the parser of the command."""
    parser = commands.add_parser(
        'quiet', help='hours without emergencies',
        description='Simulate people who walk, sit and sleep for hours of virtual time, while '
        'nodes, sink, sensors, channels, disk and core fail and recover. Every alarm that is not '
        'technical is a false alarm.')
    add_settings(parser)
    parser.add_argument('--hours', type=float, default=24.0, help='duration (%(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='random seed (%(default)s)')
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """
    Run quiet hours, and count the alarms.

    :raises ConfigError: the settings cannot be used.
    """
    begin_s = time.monotonic()
    found = quiet_hours(settings_of(arguments), arguments.hours, arguments.seed)
    found['wall_s'] = round(time.monotonic() - begin_s, 1)
    if arguments.json:
        print(json.dumps(found, indent=1))
    else:
        print(f'{found["hours"]:g} h in {found["wall_s"]:g} s, {found["restarts"]} restarts of '
              f'the core, {found["troubles"]} other troubles')
        print('technical alarms:', ', '.join(
            f'{count} {kind}' for kind, count in found['technical'].items()) or 'none')
        for each in found['false_alarms']:
            print(f'{each["at_s"]:9.1f} s  {each["level"]} alarm of {each["subject"]}: '
                  f'{", ".join(each["kinds"])}: {each["text"]}')
        print(f'{len(found["false_alarms"])} false alarms, '
              f'{found["false_alarms_per_person_day"]:.2f} a person and day')
    return FAILED if found['false_alarms'] else OK


def quiet_hours(settings: RobotSettings, hours: float, seed: int) -> dict[str, Any]:
    """
    Run quiet hours.

    :return: the alarms, as in the JSON.
    :raises AssertionError: a job of the robot failed.
    """
    world = World(settings.world)
    people = [person.name for person in world.people]
    scenario = quiet_scenario(seed, hours, people, nodes_of(world))
    record = ScenarioRun(settings, scenario, hours * 3600.0).run()
    technical: Counter[str] = Counter()
    false = []
    for events in record.alarms().values():
        worst = next((each for each in events if each['level'] != 'technical'), None)
        if worst is None:
            technical.update(events[-1]['kinds'])
        elif not any(each['event'] == 'test' for each in events):
            false.append({'at_s': round(worst['t_ns'] / NS_PER_S, 1), **{
                key: worst[key] for key in ('level', 'subject', 'kinds', 'text')}})
    return {
        'hours': hours, 'people': len(people), 'restarts': record.crashes,
        'troubles': sum(each.what not in ('sit', 'sleep', 'core_killed')
                        for each in scenario.occurrences),
        'technical': dict(technical.most_common()), 'false_alarms': false,
        'false_alarms_per_person_day': len(false) / max(len(people), 1) / hours * 24.0,
        'robot_moved_m': round(record.moved_m, 1)}

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

"""The settings of the multiplexer: lists that are read column by column, and their checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.velocity_mux.sources import Lock
from rt_robot_os.features.navigation.velocity_mux.sources import VelocitySource
from rt_robot_os.modules.run_on import RUN_ON_MAX

_PRIORITY_MAXIMUM: Final = 255  # as in twist_mux
HOLD_S: Final = 1.0

SETTINGS: Final = (
    Field('sources', list, ['teleop', 'agent', 'trajectory', 'ros'],
          'Sources that may steer; each has an item in the three lists that follow'),
    Field('source_topics', list,
          ['cmd_vel_teleop', 'cmd_vel_agent', 'cmd_vel_trajectory', 'cmd_vel'],
          'The topic of each, a geometry_msgs/msg/Twist'),
    Field('source_priorities', list, [100, 60, 40, 20],
          'The priority of each; the highest that is fresh steers, of equal ones the first',
          '', 0, _PRIORITY_MAXIMUM, item=int),
    Field('source_timeouts_s', list, [0.5, 0.5, 0.5, 0.5],
          'Age at which the last command of each no longer counts', 's', 0.01, 60.0, item=float),
    Field('source_holds_s', list, [], 'Age of its last command up to which each, once it has '
          'steered, keeps the robot from those below it; at least its time-out; empty: '
          f'{HOLD_S:g} s for each', 's', 0.0, 60.0, item=float),
    Field('locks', list, [], 'What blocks sources, such as pause; each has an item in the '
          'three lists that follow'),
    Field('lock_topics', list, [], 'The topic of each, a std_msgs/msg/Bool: true locks'),
    Field('lock_priorities', list, [], 'Sources below it are blocked; those of the same '
          'priority are not', '', 0, _PRIORITY_MAXIMUM, item=int),
    Field('lock_timeouts_s', list, [], 'Time without a message after which it locks, whatever '
          'its last value; it also locks until the first message; 0: no timeout', 's', 0.0, 60.0,
          item=float),
    Field('dead_man_sources', list, ['teleop'],
          'Sources that steer only while the dead-man switch is held'),
    Field('dead_man_topic', str, '', 'The dead-man switch, a std_msgs/msg/Bool that is sent '
          'repeatedly: true while it is held; empty: there is none, and fresh commands are '
          'enough'),
    Field('dead_man_timeout_s', float, 0.3,
          'Time without a message after which it counts as released', 's',
          0.01, 60.0),
    Field('estop_topic', str, 'estop', 'True stops, a std_msgs/msg/Bool; false alone does '
          'not release; empty: there is none'),
    Field('estop_release_topic', str, 'estop_release', 'True releases the e-stop when no cause '
          'for it is active any more, a std_msgs/msg/Bool'),
    Field('estop_at_start', bool, False, 'Start with the e-stop set: nothing moves before the '
          'release'),
    Field('motor_faults_topic', str, '', 'Faults of the motors, a std_msgs/msg/UInt32: each is '
          'an e-stop, except lost bytes, refused commands and a low battery; empty: the board '
          'handles them alone'),
    Field('linear_absurd_m_s', float, 10.0, 'A command beyond it, along any axis, is an error '
          'and treated as a standstill', 'm/s', 0.01, 100.0, live=True),
    Field('angular_absurd_rad_s', float, 20.0, 'The same about any axis', 'rad/s', 0.01, 1000.0,
          live=True),
    RUN_ON_MAX,
)


def sources_of(name: str, settings: Mapping[str, Any]) -> list[VelocitySource]:
    """
    Make the sources, the highest priority first; of equal ones the first stays first.

    :param name: of the module, for errors.
    :raises ConfigError: the lists are inconsistent.
    """
    problems = _uneven(name, settings, 'source', 'sources')
    names = settings['sources']
    holds_s = settings['source_holds_s'] or [HOLD_S] * len(names)
    if len(holds_s) != len(names):
        problems.append(f'{name}.source_holds_s has {len(holds_s)} items, sources has '
                        f'{len(names)}: give one for each, or none')
    if not names:
        problems.append(f'{name}.sources is empty: no source could steer')
    problems += [f'{name}.dead_man_sources: {each!r} is not one of the sources, {", ".join(names)}'
                 for each in settings['dead_man_sources']
                 if settings['dead_man_topic'] and each not in names]
    if not settings['estop_release_topic'] and (
            settings['estop_topic'] or settings['estop_at_start']
            or settings['motor_faults_topic']):
        problems.append(f'{name}.estop_release_topic is empty: nothing could release the e-stop')
    problems += [
        f'{name}.{key}: {settings[written]!r} is its own output, {written}: it would receive '
        f'its own commands' for key in ('source_topics', 'lock_topics')
        for written in ('command_topic', 'steering_topic') if settings[written] in settings[key]]
    if problems:
        raise ConfigError(problems)
    made = [VelocitySource(each, priority, round(timeout_s * NS_PER_S),
                           each in settings['dead_man_sources'], round(hold_s * NS_PER_S))
            for each, priority, timeout_s, hold_s in zip(
                names, settings['source_priorities'], settings['source_timeouts_s'], holds_s)]
    return sorted(made, key=lambda source: -source.priority)


def locks_of(name: str, settings: Mapping[str, Any]) -> list[Lock]:
    """
    Make the locks.

    :raises ConfigError: the lists are inconsistent.
    """
    problems = _uneven(name, settings, 'lock', 'locks')
    if problems:
        raise ConfigError(problems)
    return [Lock(each, priority, round(timeout_s * NS_PER_S)) for each, priority, timeout_s in zip(
        settings['locks'], settings['lock_priorities'], settings['lock_timeouts_s'])]


def _uneven(name: str, settings: Mapping[str, Any], prefix: str, names: str) -> list[str]:
    """Return problems: lists of other lengths than the names, and duplicates."""
    wanted = settings[names]
    problems = [
        f'{name}.{key} has {len(settings[key])} items, {names} has {len(wanted)} '
        f'({", ".join(wanted) or "none"}): give one for each'
        for key in (f'{prefix}_topics', f'{prefix}_priorities', f'{prefix}_timeouts_s')
        if len(settings[key]) != len(wanted)]
    for key in (names, f'{prefix}_topics'):
        twice = sorted({each for each in settings[key] if settings[key].count(each) > 1})
        problems += [f'{name}.{key}: {each!r} is listed twice' for each in twice]
    return problems

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

"""ROS 2: which one is sourced, whether rclpy works, whether ROS 2 finds this package."""

from __future__ import annotations

from collections.abc import Iterator
import os

from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import bad
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.system import System

DISTRIBUTION = 'jazzy'
_PACKAGE = 'rt_robot_os'
# Linux takes ports from 32768 on for outgoing connections; higher domains would collide with them.
_SAFE_DOMAIN = 101
_LAST_DOMAIN = 232
_RANGES = ('SUBNET', 'LOCALHOST', 'OFF', 'SYSTEM_DEFAULT')
_SOURCE = f'source /opt/ros/{DISTRIBUTION}/setup.bash'


def _prefixes(system: System) -> list[str]:
    return [part for part in system.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if part]


def distribution(system: System) -> Iterator[Finding]:
    """Look which distribution of ROS 2 is sourced."""
    name = system.environ.get('ROS_DISTRO', '')
    others = sorted({words[3] for prefix in _prefixes(system)
                     if (words := prefix.split('/'))[1:3] == ['opt', 'ros'] and len(words) > 3
                     and words[3] != DISTRIBUTION})
    fresh = Remedy(('env -i HOME="$HOME" TERM="$TERM" PATH=/usr/bin:/bin bash --norc', _SOURCE),
                   'take other setup.bash lines out of ~/.bashrc; for now, a shell without them:')
    if name and name != DISTRIBUTION:
        yield bad(f'{name} is sourced, the package needs {DISTRIBUTION}', fresh, weight=95)
    elif others:
        yield bad(f'{", ".join(others)} is sourced as well as {DISTRIBUTION}', fresh, weight=90)
    elif name:
        yield ok(f'{name} is sourced')
    elif system.exists(f'/opt/ros/{DISTRIBUTION}/setup.bash'):
        yield warn(f'/opt/ros/{DISTRIBUTION} is installed, but not sourced here',
                   Remedy((_SOURCE,)), weight=50)
    else:
        installed = system.names('/opt/ros')
        yield ok('no installation' + (f' of {DISTRIBUTION} (only {", ".join(installed)})'
                                      if installed else ' in /opt/ros: wheels, if rclpy is there'))


def rclpy(system: System) -> Iterator[Finding]:
    """Import rclpy in a child, and let it load its middleware."""
    facts = system.probe('rclpy')
    if facts.get('error'):
        sourced = bool(system.environ.get('ROS_DISTRO'))
        remedy = (Remedy(('deactivate; sudo apt install ros-jazzy-rclpy',),
                         'the Python of ROS 2 Jazzy is 3.12; leave other virtual environments')
                  if sourced else
                  Remedy((_SOURCE,)) if system.exists(f'/opt/ros/{DISTRIBUTION}') else
                  Remedy(('./scripts/run doctor',), 'makes a virtual environment with the wheels '
                         'of ROS 2 Jazzy'))
        yield bad(f'cannot be used: {facts["error"]}', remedy, weight=95,
                  why='`robot` needs it; `core` alone runs without')
        return
    file = facts['file']
    place = ('/'.join(file.split('/')[:4]) if file.startswith('/opt/ros/') else
             'wheel' if '/site-packages/' in file else os.path.dirname(file))
    yield ok(f'{facts["version"] or "works"} ({place}), {facts["rmw"]}')


def middleware(system: System) -> Iterator[Finding]:
    """Compare the requested middleware with the one that was loaded."""
    wanted = system.environ.get('RMW_IMPLEMENTATION', '')
    facts = system.probe('rclpy')
    if facts.get('error'):
        yield absent('rclpy cannot be used')
    elif wanted and facts['rmw'] != wanted:
        package = f'ros-{DISTRIBUTION}-{wanted.replace("_", "-")}'
        yield warn(f'RMW_IMPLEMENTATION is {wanted}, but {facts["rmw"]} is used', Remedy(
            (f'sudo apt install {package}',), 'or: unset RMW_IMPLEMENTATION'), weight=40)
    else:
        yield ok(facts['rmw'] + (' (RMW_IMPLEMENTATION)' if wanted else ' (the default)'))


def package(system: System) -> Iterator[Finding]:
    """Look whether `ros2 run` finds this package."""
    found = [prefix for prefix in _prefixes(system) if system.exists(
        f'{prefix}/share/ament_index/resource_index/packages/{_PACKAGE}')]
    if found:
        yield ok(found[0])
        return
    tool = any(system.exists(f'{folder}/ros2')
               for folder in system.environ.get('PATH', '').split(os.pathsep) if folder)
    if not tool and not _prefixes(system):
        yield absent('there is no `ros2` command here: use ./scripts/run')
        return
    yield warn(f'no prefix in AMENT_PREFIX_PATH has {_PACKAGE}', Remedy(
        ('source install/setup.bash',), 'in the workspace, after: colcon build'), weight=50)


def domain(system: System) -> Iterator[Finding]:
    """Check the domain and how far discovery reaches."""
    text = system.environ.get('ROS_DOMAIN_ID', '')
    if text and not (text.isdigit() and int(text) <= _LAST_DOMAIN):
        yield bad(f'ROS_DOMAIN_ID is {text!r}, not a number from 0 to {_SAFE_DOMAIN}',
                  Remedy(('export ROS_DOMAIN_ID=0',)), weight=85,
                  why='the node does not start with it')
    elif text and int(text) > _SAFE_DOMAIN:
        yield warn(f'ROS_DOMAIN_ID is {text}: its ports collide with outgoing connections',
                   Remedy(('export ROS_DOMAIN_ID=42',), f'0 to {_SAFE_DOMAIN} are safe'),
                   weight=25)
    else:
        yield ok(text or '0 (the default)')


def discovery(system: System) -> Iterator[Finding]:
    """Check the variables that limit discovery."""
    old = system.environ.get('ROS_LOCALHOST_ONLY', '')
    reach = system.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', '')
    if reach and reach not in _RANGES:
        yield warn(f'ROS_AUTOMATIC_DISCOVERY_RANGE is {reach!r}: not one of {", ".join(_RANGES)}',
                   Remedy(('export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET',)), weight=30)
    elif old:
        new = 'LOCALHOST' if old == '1' else 'SUBNET'
        yield warn(f'ROS_LOCALHOST_ONLY={old} is deprecated'
                   + (f' and overrides ROS_AUTOMATIC_DISCOVERY_RANGE={reach}' if reach else ''),
                   Remedy(('unset ROS_LOCALHOST_ONLY',
                           f'export ROS_AUTOMATIC_DISCOVERY_RANGE={new}')), weight=15)
    else:
        yield ok(reach or 'SUBNET (the default)')


CHECKS = (
    Check('ros.distribution', 'ROS distribution', 'libraries of two distributions in one process '
          'crash, or see different messages', distribution),
    Check('ros.rclpy', 'rclpy', 'the node needs it', rclpy),
    Check('ros.middleware', 'middleware', 'nodes with different middleware may not see each other',
          middleware),
    Check('ros.package', 'this package', '`ros2 run` and launch files search it there', package),
    Check('ros.domain', 'ROS domain', 'only nodes of the same domain see each other', domain),
    Check('ros.discovery', 'discovery', 'it decides which machines see the topics', discovery),
)

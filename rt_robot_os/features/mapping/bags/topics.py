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

"""Choose the topics of a bag: scans, odometry and transforms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.bags.storage import ODOMETRY
from rt_robot_os.features.mapping.bags.storage import SCAN
from rt_robot_os.features.mapping.bags.storage import TRANSFORMS

_SHOWN_MOST: Final = 40
#: Names that are preferred when there are several.
_SCANS: Final = ('/scan', 'scan')
_ODOMETRIES: Final = ('/odom', 'odom')
#: Types with scans that are not supported.
_COUSINS: Final = {'sensor_msgs/msg/PointCloud2': 'point clouds',
                   'sensor_msgs/msg/MultiEchoLaserScan': 'scans of several echoes',
                   'sensor_msgs/LaserScan': 'scans of ROS 1'}


@dataclass(frozen=True)
class Topics:
    """
    The topics that are read.

    :ivar odometry: '' when it comes from transforms.
    :ivar moving: of moving transforms, and
    :ivar fixed: of static ones.
    """

    scan: str
    odometry: str
    moving: tuple[str, ...]
    fixed: tuple[str, ...]

    @property
    def wanted(self) -> frozenset[str]:
        """Return all of them."""
        return frozenset((self.scan, *filter(None, (self.odometry,)), *self.moving, *self.fixed))


def choose(types: Mapping[str, str], scan_topic: str = '', odom_topic: str = '') -> Topics:
    """
    Choose the topics of a bag.

    :param scan_topic: the requested one; '' for the only one.
    :param odom_topic: as well; it may be a topic of transforms.
    :raises ConfigError: there is none, or the choice is ambiguous; lists the topics.
    """
    scan = _asked(types, scan_topic, '--scan-topic', (SCAN,)) if scan_topic else _only(
        types, SCAN, _SCANS, '--scan-topic')
    if not scan:
        cousins = sorted({_COUSINS[kind] for kind in types.values() if kind in _COUSINS})
        raise ConfigError(['no scans in it: there is no topic of ' + SCAN + (
            f' ({", ".join(cousins)} are not supported)' if cousins else ''), *listed(types)])
    moving = tuple(name for name, kind in types.items()
                   if kind == TRANSFORMS and not name.endswith('_static'))
    fixed = tuple(name for name, kind in types.items()
                  if kind == TRANSFORMS and name.endswith('_static'))
    odometry = _asked(types, odom_topic, '--odom-topic', (ODOMETRY, TRANSFORMS)) if (
        odom_topic) else _only(types, ODOMETRY, _ODOMETRIES, '--odom-topic')
    if odometry in moving:
        odometry, moving = '', (odometry,)
    elif not odometry and not moving:
        raise ConfigError([f'no odometry in it: there is neither a topic of {ODOMETRY} nor /tf',
                           *listed(types)])
    return Topics(scan, odometry, moving, fixed)


def listed(types: Mapping[str, str]) -> list[str]:
    """Return a line for each topic."""
    if not types:
        return ['it has no topics']
    lines = [f'{name}  {kind}' for name, kind in sorted(types.items())]
    more = len(lines) - _SHOWN_MOST
    return ['topics in it:', *(f'  {each}' for each in lines[:_SHOWN_MOST]),
            *([f'  and {more} more'] if more > 0 else [])]


def _asked(types: Mapping[str, str], topic: str, option: str, kinds: tuple[str, ...]) -> str:
    for name in (topic, f'/{topic}', topic.lstrip('/')):
        if types.get(name) in kinds:
            return name
        if name in types:
            raise ConfigError([f'{option} {topic}: it is of {types[name]}, not of '
                               f'{" or ".join(kinds)}', *listed(types)])
    raise ConfigError([f'{option} {topic}: there is no such topic', *listed(types)])


def _only(types: Mapping[str, str], kind: str, usual: tuple[str, ...], option: str) -> str:
    found = [name for name, each in types.items() if each == kind]
    for name in usual:
        if name in found:
            return name
    if len(found) > 1:
        raise ConfigError([f'several topics of {kind}: choose one with {option}: '
                           f'{", ".join(sorted(found))}'])
    return found[0] if found else ''

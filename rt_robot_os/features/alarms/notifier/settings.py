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
The settings of the notifier: its channels, in the parameter file of the robot.

::

    /**/notifier:
      ros__parameters:
        channels: [operator]
        operator: {type: webhook, url: 'https://example.org/alarm'}
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import re
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.features.alarms.notifier.channel import Channel
from rt_robot_os.features.alarms.notifier.channel import VARIABLE
from rt_robot_os.features.alarms.notifier.local import CommandChannel
from rt_robot_os.features.alarms.notifier.local import ConsoleChannel
from rt_robot_os.features.alarms.notifier.local import FileChannel
from rt_robot_os.features.alarms.notifier.mail import MailChannel
from rt_robot_os.features.alarms.notifier.webhook import WebhookChannel
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import read_section
from rt_robot_os.settings.sections import ROS_OWN
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import flatten
from rt_robot_os.settings.tree import Leaf

Kind = Callable[[Mapping[str, Any], Mapping[str, str]], Channel]
KINDS: Final[Mapping[str, Any]] = {
    'console': ConsoleChannel, 'file': FileChannel, 'command': CommandChannel,
    'webhook': WebhookChannel, 'email': MailChannel}
_NAME: Final = re.compile(r'[a-z][a-z0-9_-]{0,31}', re.ASCII)
#: Channels of the robot itself, which need no notifier.
_ROBOTS: Final = ('robot',)

TOP: Final = (
    Field('channels', list, [], 'Names of the channels, each with a section of that name; the '
          'steps of the module of alarms name them'),
    Field('folder', str, '', 'Folder of the delivery log; when absent '
          'notifier-ROBOT in $ROS_HOME or ~/.ros'),
    Field('heartbeat_s', float, 5.0, 'How often notifier/heartbeat is published', 's', 0.1,
          3600.0),
    Field('expires_s', float, 60.0, 'An older notification is reported as failed instead of '
          'delivered: later steps have been notified since', 's', 1.0,
          86400.0))
COMMON: Final = (
    Field('type', str, 'console', 'Type of the channel', choices=tuple(KINDS)),
    Field('timeout_s', float, 8.0, 'Time limit of a delivery: shorter than '
          'delivery_timeout_s of the module of alarms', 's', 0.1, 600.0),
    Field('queue', int, 32, 'Notifications that may wait for it; more are reported as failed', '',
          1, 1000))


@dataclass(frozen=True)
class ChannelSettings:
    """
    A channel, ready to be used.

    :ivar queue: how many notifications may wait for it.
    """

    name: str
    type: str  # noqa: A003
    queue: int
    channel: Channel


@dataclass(frozen=True)
class NotifierSettings:
    """All of it; see :data:`TOP`."""

    channels: tuple[ChannelSettings, ...]
    folder: str
    heartbeat_s: float
    expires_s: float


def load(paths: Sequence[Path], overrides: Mapping[str, Any], environ: Mapping[str, str],
         node: str = 'notifier', namespace: str = '/') -> NotifierSettings:
    """
    Read the parameter files and make the channels; opens nothing.

    :param overrides: by dotted name; they win over the files.
    :raises ConfigError: with one line for each problem.
    """
    # Imported late: `--help` needs none of it.
    from rt_robot_os.settings.program_settings import read_parameters
    tree, problems = read_parameters(paths, overrides, node, namespace)
    top = read_section(tree, '', TOP, problems, set(tree.children) | ROS_OWN).values
    names = top.get('channels', ())
    # The secrets of a channel are hidden from the programs of others.
    secret = {leaf.value[1:] for leaf in flatten(tree).values()
              if isinstance(leaf.value, str) and leaf.value.startswith(VARIABLE)}
    plain = {name: value for name, value in environ.items() if name not in secret}
    channels = [each for name in dict.fromkeys(names)
                if (each := _channel(tree, name, environ, plain, problems)) is not None]
    for name, node_ in tree.children.items():
        if name not in names and name not in ROS_OWN and all(name != each.name for each in TOP):
            problems.add(node_.origin, f"{name}: this section is in no list: add it to 'channels' "
                         "or delete it (what is the robot's stands under its own name, not "
                         'under /**)')
    problems.raise_any()
    return NotifierSettings(tuple(channels), top['folder'], top['heartbeat_s'], top['expires_s'])


def _channel(tree: Branch, name: str, environ: Mapping[str, str], plain: Mapping[str, str],
             problems: Problems) -> ChannelSettings | None:
    branch = tree.children.get(name)
    if not _NAME.fullmatch(name) or name in _ROBOTS:
        problems.value(tree.origin, 'channels', name, 'a channel is named by a small letter, then '
                       'small letters, digits, _ and -; robot is the voice of the robot itself')
        return None
    if not isinstance(branch, Branch):
        problems.value(tree.origin, 'channels', name, f'has no section: write {name}: '
                       '{type: console}')
        return None
    kind = branch.children.get('type')
    cls = KINDS.get(str(kind.value)) if isinstance(kind, Leaf) else None
    section = read_section(branch, name, (*COMMON, *(cls.SETTINGS if cls is not None else ())),
                           problems, () if cls is not None else tuple(branch.children))
    if cls is None:
        if kind is None:
            problems.add(branch.origin, f'{name}.type is missing: it must be one of '
                         f'{", ".join(KINDS)}')
        return None
    try:
        return ChannelSettings(name, section.values['type'], section.values['queue'],
                               cls(section.values, plain if cls is CommandChannel else environ))
    except KeyError:
        return None  # a value is missing, which was reported
    except ValueError as error:
        problems.add(branch.origin, f'{name}: {error}')
        return None

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


"""The names ROS 2 allows, and why a name is not one of them."""

from __future__ import annotations

import re
from typing import Final

TOKEN_RULE: Final = "letters, digits and '_', not beginning with a digit"

# What rmw allows a whole topic name: 255 less the prefix that DDS gets.
LONGEST_TOPIC: Final = 247

# What rmw allows.
LONGEST_NODE: Final = 255

_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*', re.ASCII)
_MESSAGE = re.compile(r'[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*', re.ASCII)


def is_token(name: str) -> bool:
    """Return whether a name is one ROS token: a device, a node, one part of a topic."""
    return _TOKEN.fullmatch(name) is not None


def topic_problem(name: str, example: str = 'imu/data') -> str | None:
    """
    Return what is wrong with the name of a topic inside the robot.

    :return: None for tokens separated by single slashes, else the remedy.
    """
    # Late: for the command line alone the names of nodes do, and topics need NumPy.
    from rt_robot_os.topics.bus import TOPIC_NAME
    if len(name) > LONGEST_TOPIC:
        return f'must be at most {LONGEST_TOPIC} characters'
    if TOPIC_NAME.fullmatch(name):
        return None
    return f"must be names of {TOKEN_RULE}, separated by '/', such as {example}"


def ros_topic_problem(name: str) -> str | None:
    """Return what is wrong with a ROS topic name, which may also begin with '/' or '~/'."""
    for prefix in ('~/', '/'):
        if name.startswith(prefix):
            return topic_problem(name[len(prefix):], f'{prefix}imu/data')
    return topic_problem(name)


def message_problem(name: str) -> str | None:
    """Return what is wrong with the spelling of a message type."""
    if _MESSAGE.fullmatch(name):
        return None
    return 'must be package/msg/Type, such as geometry_msgs/msg/Twist'


def namespace_problem(name: str) -> str | None:
    """Return what is wrong with a namespace: '/' or tokens, each behind a slash."""
    if name == '/' or (name.startswith('/') and topic_problem(name[1:]) is None):
        return None
    return f"must be '/' or begin with '/', in names of {TOKEN_RULE}, such as /lab"


def full_name(namespace: str, node: str) -> str:
    """Join a namespace and a node's name."""
    return f"{namespace.rstrip('/')}/{node}"


def full_topic(name: str, namespace: str, node: str) -> str:
    """Return the whole name of a ROS topic, as ``ros2 topic list`` shows it."""
    if name.startswith('/'):
        return name
    if name.startswith('~/'):
        return f'{full_name(namespace, node)}/{name[2:]}'
    return f"{namespace.rstrip('/')}/{name}"

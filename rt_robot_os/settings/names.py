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


"""The names that ROS 2 allows, and the problem of a name that it does not."""

from __future__ import annotations

import re
from typing import Final

TOKEN_RULE: Final = "letters, digits and '_', not beginning with a digit"

# The limit of rmw for a full topic name: 255 less the prefix for DDS.
LONGEST_TOPIC: Final = 247

# The limit of rmw.
LONGEST_NODE: Final = 255

_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*', re.ASCII)
_MESSAGE = re.compile(r'[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*', re.ASCII)


def is_token(name: str) -> bool:
    """Return whether a name is a ROS token: the name of a device or a node, a part of a topic."""
    return _TOKEN.fullmatch(name) is not None


def topic_problem(name: str, example: str = 'imu/data') -> str | None:
    """
    Return the problem of the name of a topic in the core.

    :return: None for tokens separated by single slashes, otherwise the remedy.
    """
    # Late: it imports NumPy, and the command line needs only the names of nodes.
    from rt_robot_os.topics.bus import TOPIC_NAME
    if len(name) > LONGEST_TOPIC:
        return f'must be at most {LONGEST_TOPIC} characters'
    if TOPIC_NAME.fullmatch(name):
        return None
    return f"must be names of {TOKEN_RULE}, separated by '/', such as {example}"


def ros_topic_problem(name: str) -> str | None:
    """Return the problem of a ROS topic name, which may also begin with '/' or '~/'."""
    for prefix in ('~/', '/'):
        if name.startswith(prefix):
            return topic_problem(name[len(prefix):], f'{prefix}imu/data')
    return topic_problem(name)


def message_problem(name: str) -> str | None:
    """Return the problem of the name of a message type."""
    if _MESSAGE.fullmatch(name):
        return None
    return 'must be package/msg/Type, such as geometry_msgs/msg/Twist'


def namespace_problem(name: str) -> str | None:
    """Return the problem of a namespace: it must be '/' or tokens, each behind a slash."""
    if name == '/' or (name.startswith('/') and topic_problem(name[1:]) is None):
        return None
    return f"must be '/' or begin with '/', in names of {TOKEN_RULE}, such as /lab"


def full_name(namespace: str, node: str) -> str:
    """Join a namespace and a node's name."""
    return f"{namespace.rstrip('/')}/{node}"


def full_topic(name: str, namespace: str, node: str) -> str:
    """Return the full name of a ROS topic, as ``ros2 topic list`` shows it."""
    if name.startswith('/'):
        return name
    if name.startswith('~/'):
        return f'{full_name(namespace, node)}/{name[2:]}'
    return f"{namespace.rstrip('/')}/{name}"

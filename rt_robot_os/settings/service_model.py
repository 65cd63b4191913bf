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

"""The settings of services of the node: most publish a string in the core and await an answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import setting

TRIGGER: Final = 'std_srvs/srv/Trigger'
SET_BOOL: Final = 'std_srvs/srv/SetBool'
LOAD_MAP: Final = 'nav_msgs/srv/LoadMap'
GET_MAP: Final = 'nav_msgs/srv/GetMap'
#: In the text of a LoadMap, the placeholder for the map_url of the request.
MAP_URL: Final = '{map_url}'


@dataclass(frozen=True, slots=True)
class ServiceSettings:
    """
    A service of the node.

    :ivar name: its section.
    :ivar service: as written; relative names follow the node's namespace.
    """

    name: str
    topic: str = setting(
        REQUIRED, 'the topic in the core on which the text is published, a std_msgs/msg/String; '
        'for a GetMap the topic whose last sample it returns, a nav_msgs/msg/OccupancyGrid')
    text: str = setting(
        '', 'the string that is published; for a SetBool that of true; for a LoadMap with '
        '{map_url} in place of the map_url of the request; a GetMap has none')
    service: str = setting(
        '', 'its name in ROS; when absent ~/ and the name of the section: /robot/NAME')
    type: str = setting(  # noqa: A003
        TRIGGER, 'its type', choices=(TRIGGER, SET_BOOL, LOAD_MAP, GET_MAP))
    text_false: str = setting('', 'the string that a SetBool publishes for false')
    answer_topic: str = setting(
        '', 'the topic of the answer: a std_msgs/msg/String in JSON, {"command": the text, "ok": '
        'true, "text": "why"}; when absent the response is that the text is published')
    started_by: str = setting(
        '', 'the command that starts the process that answers, for the error when it is not '
        'connected; one word: a program of this package, such as mapping')
    timeout_s: float = setting(
        2.0, 'time-out of the answer', 's', 0.05, 600.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'service', self.service or f'~/{self.name}')

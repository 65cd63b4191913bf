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

"""Survey files of sensor nodes."""

from __future__ import annotations

from rt_robot_os.linux.file_urls import read_text_file
from rt_robot_os.messages.survey import read_survey
from rt_robot_os.messages.survey import SurveyedNode


def load_survey(url: str, key: str) -> tuple[SurveyedNode, ...]:
    """
    Read a YAML file with ``nodes:``, such as that of a world; not for the real-time loop.

    :param url: a path, ``file://`` or ``package://package/path``.
    :param key: key of the setting, for errors.
    :raises ConfigError: it cannot be read; the text has the file, the line and the remedy.
    """
    path, text = read_text_file(url, key, 'a YAML file with nodes')
    return read_survey(text, str(path))

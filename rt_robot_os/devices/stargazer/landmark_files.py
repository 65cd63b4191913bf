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

"""The file of landmarks that a configuration names."""

from __future__ import annotations

from rt_robot_os.linux.file_urls import read_text_file
from rt_robot_os.motion.landmarks import CeilingLandmark
from rt_robot_os.motion.landmarks import read_landmarks


def load_landmarks(url: str, key: str) -> dict[int, CeilingLandmark]:
    """
    Read a file of landmarks, CSV or YAML; not for the real-time loop.

    :param url: a path, ``file://`` or ``package://package/path``.
    :param key: of the setting that names it, for the errors.
    :return: by number.
    :raises ConfigError: it cannot be read; the message names the file, the line and the remedy.
    """
    path, text = read_text_file(url, key, 'a CSV or YAML file of landmarks')
    return read_landmarks(text, str(path))

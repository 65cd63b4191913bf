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

"""The settings of a program that runs in a separate process, with its own node section."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rt_robot_os.base.schema import declared
from rt_robot_os.settings.files import read_files
from rt_robot_os.settings.files import read_overrides
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import read_section
from rt_robot_os.settings.sections import ROS_OWN
from rt_robot_os.settings.sections import Section
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import COMMAND_LINE
from rt_robot_os.settings.tree import merge


def read_parameters(paths: Sequence[Path], overrides: Mapping[str, Any], node: str,
                    namespace: str, *, is_needed: bool = True) -> tuple[Branch, Problems]:
    """
    Read the parameters of a node from files; opens nothing else.

    :param overrides: by dotted name; they win over the files.
    :param is_needed: False for files of the robot, which may have no section for the node.
    :return: the parameters, and the problems so far.
    """
    problems = Problems([*(str(path) for path in paths), COMMAND_LINE])
    return merge(read_files(list(paths), namespace, node, problems, is_needed=is_needed),
                 read_overrides(overrides, problems)), problems


def read_values(model: type, paths: Sequence[Path], overrides: Mapping[str, Any], node: str,
                namespace: str, check: Callable[[Section, Problems], None] | None = None,
                *, is_needed: bool = True) -> dict[str, Any]:
    """
    Read the settings of a node that has no sections.

    :param model: the dataclass that declares them.
    :param overrides: by dotted name; they win over the files.
    :param check: further checks, which report problems.
    :param is_needed: False for files of the robot, which may have no section for the node.
    :return: all settings by name, for :func:`rt_robot_os.base.schema.made`; lists as tuples.
    :raises ConfigError: with one line for each problem.
    """
    tree, problems = read_parameters(paths, overrides, node, namespace,
                                     is_needed=is_needed)
    section = read_section(tree, '', declared(model), problems, ROS_OWN)
    if check is not None:
        check(section, problems)
    problems.raise_any()
    return {key: tuple(value) if isinstance(value, list) else value
            for key, value in section.values.items()}

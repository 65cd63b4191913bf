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

"""The entry point: from files and command line to checked settings, or all problems."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import replace
import os
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.files import default_path
from rt_robot_os.settings.files import read_files
from rt_robot_os.settings.files import read_overrides
from rt_robot_os.settings.installed import installed
from rt_robot_os.settings.model import LISTS
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import SIM_PORT
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.robot import read_robot
from rt_robot_os.settings.ros_args import parse_ros_args
from rt_robot_os.settings.ros_args import RosArguments
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import COMMAND_LINE
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import merge
from rt_robot_os.settings.tree import Origin

_ORIGIN = Origin(COMMAND_LINE)


def load(
    paths: Sequence[Path], overrides: Mapping[str, Any] = MappingProxyType({}),
    node: str = 'robot', namespace: str = '/', catalogue: Catalogue | None = None,
    simulate: bool = False,
) -> RobotSettings:
    """
    Read ROS 2 parameter files and check them against everything they refer to; opens no device.

    :param paths: later files win, key by key.
    :param overrides: by dotted name (``imu.rate_hz``); they win over the files.
    :param node: the node's name; only its sections and wildcards count.
    :param namespace: the node's namespace.
    :param catalogue: of drivers, modules and so on; that of the installation when None.
    :param simulate: every device is simulated, whatever its port.
    :raises ConfigError: with one line for each problem.
    """
    problems = Problems([*(str(path) for path in paths), COMMAND_LINE])
    tree = read_files([Path(path) for path in paths], namespace, node, problems)
    tree = lay_over(tree, read_overrides(overrides, problems))
    known = catalogue or installed()
    if simulate:
        tree = simulate_all(tree, known)
    settings = read_robot(tree, namespace, node, known, problems)
    return replace(settings, files=tuple(os.path.realpath(path) for path in paths))


def load_from_arguments(argv: Sequence[str], simulate: bool = False,
                        files: Sequence[Path] = ()) -> tuple[RobotSettings, RosArguments]:
    """
    Read the parameter files and overrides of a command line.

    Without a parameter file the package's own ``robot.yaml`` is used, with simulated devices.

    :param argv: without the program's name.
    :param simulate: all devices are simulated.
    :param files: parameter files without a flag.
    :raises ConfigError: with one line for each problem.
    """
    ros = parse_ros_args(argv)
    files = (*files, *ros.params_files) or (default_path(),)
    # A launch file names the shipped file when its user names none.
    shipped = [os.path.realpath(path) for path in files] == [os.path.realpath(default_path())]
    # The shipped file is written for the default name of the node, whatever its actual name.
    node, namespace = ('robot', '/') if shipped else (ros.node_name, ros.namespace)
    settings = load(files, ros.overrides, node, namespace, simulate=simulate)
    return replace(settings, simulation_asked=simulate or not shipped), ros


def lay_over(files: Branch, line: Branch) -> Branch:
    """
    Merge the command line over the files.

    ``devices:=[imu]`` disables the other devices, as ``gps.enabled:=false`` does; likewise for
    modules. A mirror or a topic that is not in such a list is removed.
    """
    tree = merge(files, line)
    off: dict[str, Leaf | Branch] = {}
    for list_name, kind in LISTS.items():
        before, now = _names(files, list_name), _names(line, list_name)
        if before is None or now is None:
            continue
        left = tuple(name for name in before if name not in now)
        if hasattr(kind, 'enabled'):
            off[list_name] = Leaf(line.children[list_name].origin, (*now, *left))
            off |= {name: Branch(_ORIGIN, {'enabled': Leaf(_ORIGIN, False)}) for name in left
                    if isinstance(tree.children.get(name), Branch)}
        else:
            for name in left:
                tree.children.pop(name, None)
    return merge(tree, Branch(_ORIGIN, off))


def _names(tree: Branch, list_name: str) -> tuple[str, ...] | None:
    node = tree.children.get(list_name)
    if not isinstance(node, Leaf) or node.fault or not isinstance(node.value, tuple):
        return None
    return node.value if all(isinstance(name, str) for name in node.value) else None


def simulate_all(tree: Branch, catalogue: Catalogue) -> Branch:
    """Set the port of every device that has one to the simulated port."""
    overlay: dict[str, Leaf | Branch] = {}
    for name in _names(tree, 'devices') or ():
        section = tree.children.get(name)
        kind = section.children.get('type') if isinstance(section, Branch) else None
        if not isinstance(kind, Leaf) or not isinstance(kind.value, str):
            continue
        try:
            fields = catalogue.drivers.find(kind.value).fields
        except ConfigError:
            continue  # reported where the section is read
        if any(field.name == 'port' for field in fields):
            overlay[name] = Branch(_ORIGIN, {'port': Leaf(_ORIGIN, SIM_PORT)})
    return merge(tree, Branch(_ORIGIN, overlay))

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

"""What the command line means beyond its values: parts that are left out, devices simulated."""

from __future__ import annotations

from rt_robot_os.errors import ConfigError
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.model import LISTS
from rt_robot_os.settings.model import SIM_PORT
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import COMMAND_LINE
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import merge
from rt_robot_os.settings.tree import Origin

_ORIGIN = Origin(COMMAND_LINE)


def lay_over(files: Branch, line: Branch) -> Branch:
    """
    Lay the command line over the files.

    ``devices:=[imu]`` switches the others off, as ``gps.enabled:=false`` does, and so do modules;
    a mirror or a topic that is not in such a list is left out.
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
    """Give every device that has a port the simulated one."""
    overlay: dict[str, Leaf | Branch] = {}
    for name in _names(tree, 'devices') or ():
        section = tree.children.get(name)
        kind = section.children.get('type') if isinstance(section, Branch) else None
        if not isinstance(kind, Leaf) or not isinstance(kind.value, str):
            continue
        try:
            fields = catalogue.drivers.find(kind.value).fields
        except ConfigError:
            continue  # told where the section is read
        if any(field.name == 'port' for field in fields):
            overlay[name] = Branch(_ORIGIN, {'port': Leaf(_ORIGIN, SIM_PORT)})
    return merge(tree, Branch(_ORIGIN, overlay))

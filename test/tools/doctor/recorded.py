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

"""A system that was recorded in a text file: its files, its environment, its answers."""

from __future__ import annotations

from collections.abc import Mapping
import json
import os
from pathlib import Path
from typing import Any

from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.registry import ask
from rt_robot_os.tools.doctor.registry import GROUPS
from rt_robot_os.tools.doctor.system import ProbeError
from rt_robot_os.tools.doctor.system import System
from rt_robot_os.tools.doctor.system import Wanted

FOLDER = Path(__file__).parent / 'machines'
NAMES = sorted(path.stem for path in FOLDER.glob('*.txt'))
CHECKS = {check.key: check for group in GROUPS for check in group.checks}


class Recorded(System):
    """
    A machine below a root of its own.

    :param facts: what is no file: uname, user, environment, answers of child processes.
    """

    def __init__(self, root: Path, facts: Mapping[str, Any]) -> None:
        wanted = dict(facts.get('wanted', {}))
        wanted['ports'] = tuple(wanted.get('ports', ()))
        super().__init__(Wanted(**wanted), root, facts['environ'])
        self.facts = facts

    release = property(lambda self: self.facts['release'])
    version = property(lambda self: self.facts['version'])
    machine = property(lambda self: self.facts['machine'])
    uid = property(lambda self: self.facts['uid'])
    user = property(lambda self: self.facts['user'])
    own_pids = property(lambda self: frozenset())

    def may(self, path: str, mode: int) -> bool:
        return self.exists(path) and path not in self.facts.get('denied', ())

    def group_of(self, path: str) -> str:
        return str(self.facts.get('groups', {}).get(path, ''))

    def free_bytes(self, path: str) -> int:
        os.stat(self.path(path))
        return int(self.facts['free_mb']) << 20

    def probe(self, name: str, *arguments: object) -> Mapping[str, Any]:
        try:
            return dict(self.facts['probes'][name])
        except KeyError:
            raise ProbeError(f'the probe {name!r} ended with code 1') from None


def unpack(name: str, root: Path) -> Recorded:
    """Make the files of a recorded machine below a folder."""
    facts: Mapping[str, Any] = {}
    text = (FOLDER / f'{name}.txt').read_text()
    for section in text.split('\n== ')[1:]:
        title, _, content = section.partition('\n')
        if title == 'machine':
            facts = json.loads(content)
            continue
        path, arrow, target = title.partition(' -> ')
        place = root / path.lstrip('/')
        place.parent.mkdir(parents=True, exist_ok=True)
        if arrow:
            place.symlink_to(target)
        elif place.name == 'cmdline' and place.parent.name.isdigit():
            place.write_bytes(content.strip().replace(' ', '\0').encode())
        else:
            place.write_text(content)
    return Recorded(root, facts)


def found(system: System, key: str) -> list[Finding]:
    """Ask one check."""
    return ask(CHECKS[key], system)

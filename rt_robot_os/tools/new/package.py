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

"""The files of a package with a new driver or module, filled in from templates."""

from __future__ import annotations

import importlib.util
import keyword
from pathlib import Path
import re
import shutil
import tempfile
from typing import Final

LONGEST_PACKAGE, LONGEST_NAME = 25, 20

_TEMPLATES: Final = Path(__file__).with_name('templates')
_COMMON: Final = {
    'package.xml.in': 'package.xml', 'setup.cfg.in': 'setup.cfg', 'setup.py.in': 'setup.py',
    'launch.xml.in': 'launch/@package@.launch.xml', 'robot.yaml.in': 'config/@package@.yaml',
    'README.md.in': 'README.md'}
_DRIVER: Final = {
    'device.py.in': ('@package@/@driver@/__init__.py', 'the parts of the device'),
    'wire.py.in': ('@package@/@driver@/wire.py', 'the bytes of the device'),
    'driver.py.in': ('@package@/@driver@/driver.py', 'the driver: from frames to messages'),
    'simulated.py.in': ('@package@/@driver@/simulated.py', 'the simulated device'),
    'test_driver.py.in': ('test/test_@driver@.py', 'bytes of the data sheet')}
_MODULE: Final = {
    'module.py.in': ('@package@/@module@.py', 'the module: inputs, outputs, settings, one step'),
    'test_module.py.in': ('test/test_@module@.py', 'the expected behaviour')}


def name_problem(noun: str, name: str, longest: int) -> str:
    """Return the problem of a name; empty if it is valid."""
    rule = (f'must have 2 to {longest} lower-case letters, digits and single _, begin with a '
            'letter and not end with _')
    if not re.fullmatch(r'[a-z](_?[a-z0-9])+', name) or len(name) > longest:
        return f'{noun} {name!r}: {rule}, such as my_{noun}'
    if keyword.iskeyword(name) or keyword.issoftkeyword(name):
        return f'{noun} {name!r}: is a keyword of Python: choose another'
    return ''


def _taken() -> set[str]:
    """Return the names of the sections of a configuration."""
    from rt_robot_os.base.schema import declared
    from rt_robot_os.settings.model import RobotSettings
    from rt_robot_os.settings.model import SECTIONS
    return {*(each.name for each in declared(RobotSettings)), *SECTIONS, 'imu', 'imu_data'}


def problems_of(package: str, driver: str, module: str) -> list[str]:
    """Return the problems of the given names."""
    # Imported late: not needed for `--help`.
    from rt_robot_os.devices.registry import DRIVERS
    from rt_robot_os.modules import registry as modules
    found = [name_problem('package', package, LONGEST_PACKAGE)]
    if not found[0] and importlib.util.find_spec(package) is not None:
        found.append(f'package {package!r}: Python has a module of that name already: choose '
                     'another')
    for noun, name, known in (('driver', driver, DRIVERS.names()),
                              ('module', module, modules.names())):
        if not name:
            continue
        found.append(name_problem(noun, name, LONGEST_NAME))
        if name in known:
            found.append(f'{noun} {name!r}: exists already: choose another')
        elif name in _taken():
            found.append(f'{noun} {name!r}: is a reserved key of the configuration: '
                         'choose another')
    if driver and driver == module:
        found.append(f'driver and module are both {driver!r}: give each its own name')
    return [each for each in found if each]


def sorted_imports(text: str) -> str:
    """Sort the imports of each block in the order of the linter, by module."""
    def key(line: str) -> tuple[str, str]:
        words = line.split()
        return words[1].lower(), words[-1].lower()

    def in_order(block: re.Match[str]) -> str:
        return ''.join(sorted(block[0].splitlines(keepends=True), key=key))

    return re.sub(r'(?:^(?:from|import) .*\n)+', in_order, text, flags=re.MULTILINE)


class Package:
    """
    The files of a package, by their paths in it.

    :param driver: its name; empty without one.
    :param module: its name; empty without one.
    """

    def __init__(self, package: str, driver: str, module: str) -> None:
        self._values = {
            'package': package, 'driver': driver, 'module': module,
            'Driver': _camel(driver), 'Module': _camel(module)}
        chosen = {**(_DRIVER if driver else {}), **(_MODULE if module else {})}
        self._values |= self._computed(driver, module)
        self._values['files'] = '\n'.join(
            f'| `{self._filled(path)}` | {what} |' for path, what in chosen.values())
        places = _COMMON | {name: path for name, (path, _) in chosen.items()}
        self.files = {self._filled(path): self._read(name) for name, path in places.items()}
        self.files |= {f'resource/{package}': '', f'{package}/__init__.py': ''}

    def _computed(self, driver: str, module: str) -> dict[str, str]:
        """Return the parts that depend on driver and module."""
        groups = {
            'devices': driver,
            'modules': module and f'{module}:@Module@'}
        names = {'devices': driver, 'modules': module}
        entries = [f"        'rt_robot_os.{group}': [\n"
                   f"            '{names[group]} = '\n            '@package@.{place}'],"
                   for group, place in groups.items() if place]
        topics = {f'{name}_out': name for name in (driver, module) if name}
        topics |= {'imu_data': 'imu/data'} if module else {}
        return {
            'entry_points': self._filled('\n'.join(entries)),
            'what': ' and '.join([*(['A driver'] if driver else []),
                                  *(['a module' if driver else 'A module'] if module else [])]),
            'devices': ', '.join([*([driver] if driver else []), *(['imu'] if module else [])]),
            'driver_section': self._read('driver_section.in') if driver else '',
            'imu_section': self._read('imu_section.in') if module else '',
            'module_section': self._read('module_section.in') if module else '',
            'mirrors': ', '.join(topics),
            'mirror_sections': ''.join(
                f'\n    {name}: {{topic: {topic}, direction: out}}'
                for name, topic in topics.items())}

    def _read(self, name: str) -> str:
        text = self._filled((_TEMPLATES / name).read_text())
        return sorted_imports(text) if name.endswith('.py.in') else text

    def _filled(self, text: str) -> str:
        return re.sub(r'@(\w+)@', lambda found: self._values[found[1]], text)

    def write(self, folder: Path) -> None:
        """
        Write all files, or none.

        :raises OSError: a file cannot be written, or exists already.
        """
        with tempfile.TemporaryDirectory(prefix='.new-', dir=folder.parent) as name:
            whole = Path(name) / folder.name
            for place, text in self.files.items():
                path = whole / place
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            folder.mkdir()  # fails if it exists, also if another process has just made it
            try:
                for each in whole.iterdir():
                    each.rename(folder / each.name)
            except OSError:
                shutil.rmtree(folder, ignore_errors=True)
                raise


def _camel(name: str) -> str:
    return ''.join(part.capitalize() for part in name.split('_'))

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

"""Check the layers: who may import whom, and which module alone may use a dangerous library."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from collections.abc import Iterator
from dataclasses import dataclass
import functools
from pathlib import Path
import re

from rt_robot_os.base.features import features
from setup_programs import PROGRAMS

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'rt_robot_os'

# The folders of the package from the bottom up, and what each holds. A folder may import itself
# and those before it; docs/architecture.md shows this table.
LAYERS = {
    'base': 'errors, nanoseconds and units, fields of settings, reports, logging, plug-ins, '
            'programs, required libraries, the build of the C core',
    'linux': 'libc: timers, signal masks, memory locks, processes, files; the only user of ctypes',
    'messages': 'messages that cross a process, one type each, with limits, JSON and CDR',
    'motion': 'pure computations: angles, frames, the differential drive, estimators, maps, '
              'controllers',
    'kernel': 'tasks, dispatch, clocks, statistics, traces: '
              '[how it is cut](decisions/0127-kernel-in-three-thirds.md)',
    'topics': 'CDR layouts, rings, publishers, subscriptions',
    'sim': 'what simulated devices share: ptys, faults, the server that runs them, and '
           '[the one world](world.md) that they look at; the runner of scenarios',
    'devices': 'the contract of a driver, the SensorManager, serial lines, I2C, captures; a '
               'folder for each device: driver, wire format, simulated device, page',
    'modules': 'the contract of a function module and the registry',
    'link': 'packets, server, client, stamps',
    'settings': 'YAML to checked settings',
    'core': 'the composition root of the real-time process',
    'recording': 'MCAP recordings and their replay; the only user of mcap',
    'features': 'what a robot does, a folder each: `alarms`, `agent`, `health`, `mapping`, '
                '`navigation`, `wsn`',
    'ros': 'the node; the only user of rclpy',
    'gateway': "the robot's side of the connection to a server",
    'monitor': 'the server: API, live connections, database, accounts, page',
    'tools': '`bench`, `doctor`, `plan`, `black_box`, `top` and other programs',
    'testing': 'what the tests of packages of users import',
}

RANK = {name: row for row, name in enumerate(LAYERS)}

# A feature may import the others that its manifest requires; all that is below features anyway.
FEATURES = features()

BRINGS = '| feature | what it does | modules | devices | programs | requires |'

# The two sides of a connection to a server know what crosses it, and general foundations; the
# gateway knows the link to the core, too, and how to read maps and messages of any type.
SERVER_SIDES = {
    'monitor': ('base', 'linux', 'messages', 'settings'),
    'gateway': ('base', 'linux', 'messages', 'settings', 'link', 'topics.resolve',
                'motion.angles', 'motion.grid_map', 'motion.map_message'),
}

# A simulated device stands beside its driver: they share the bytes, and nothing else.
SIMULATED = re.compile(r'(devices|features\.\w+)\.\w+\.simulated(_\w+)?')
SIMULATED_MAY_IMPORT = re.compile(
    r'(devices|features\.\w+)\.\w+\.(simulated(_\w+)?|wire|mtdata2|rtcm)'
    r'|devices\.(capture\..*|i2c\.packets|stargazer\.landmark_files)'
    r'|features\.(health|wsn)\..*|(base|linux|messages|motion|sim)(\..*)?')
# The driver, the simulated device and the recogniser share the bytes of a device; its folder
# declares names, for every process, and imports nothing.
WIRE = re.compile(r'(devices|features\.\w+)\.\w+\.(wire|mtdata2|rtcm)')
WIRE_MAY_IMPORT = re.compile(
    r'(devices|features\.\w+)\.(\w+\.(wire|mtdata2|rtcm)|framing|partial_sums)'
    r'|base\.units|features\.wsn\.packets(\..*)?')

# Wherever they stand: what a program is made of may import everything, and nobody imports it.
PROGRAM = re.compile(r'[\w.]+\.(\w+_)?(program|command)')
PROGRAM_LINES = 100

# The contract; what a driver is stays with the driver.
CORE_KNOWS_OF_DEVICES = ('device', 'manager', 'registry', 'service', 'simulators', 'state')

# library -> the only places that may import it
LIBRARIES = {
    'rclpy': (f'{PACKAGE}.ros', f'{PACKAGE}.tools.bench.cases', f'{PACKAGE}.tools.bench.subjects'),
    'ctypes': (f'{PACKAGE}.linux',),
    'serial': (f'{PACKAGE}.devices.serial.transport', f'{PACKAGE}.sim'),
    'cv2': (f'{PACKAGE}.devices.capture.pictures',),
    'PIL': (f'{PACKAGE}.devices.capture.camera', f'{PACKAGE}.devices.capture.pictures'),
    'sounddevice': (f'{PACKAGE}.gateway.voice_sound',
                    f'{PACKAGE}.devices.capture.sound'),
    'mcap': (f'{PACKAGE}.features.mapping.bags.mcap_file', f'{PACKAGE}.recording'),
    'smbus2': (f'{PACKAGE}.devices.i2c.linux_bus',),
    'rich': (f'{PACKAGE}.tools.top.live',),
    'scipy': (f'{PACKAGE}.features.mapping.slam',),
    'aiortc': (f'{PACKAGE}.gateway',),
    'av': (f'{PACKAGE}.gateway.voice_call',),
    'alembic': (f'{PACKAGE}.monitor.store',),
    'argon2': (f'{PACKAGE}.monitor.security',),
    'cryptography': (f'{PACKAGE}.monitor.security',),
    'fastapi': (f'{PACKAGE}.monitor',),
    'pydantic': (f'{PACKAGE}.monitor',),
    'sqlalchemy': (f'{PACKAGE}.monitor',),
    'starlette': (f'{PACKAGE}.monitor',),
    'uvicorn': (f'{PACKAGE}.monitor',),
    'websockets': (f'{PACKAGE}.gateway',),
}


@dataclass(frozen=True)
class Import:
    importer: str
    imported: str
    line: int
    lazy: bool       # inside a function
    typing: bool     # under TYPE_CHECKING

    def __str__(self) -> str:
        """Say where it stands, as a compiler does."""
        return f'{self.importer}:{self.line} imports {self.imported}'


# The import statements of a file; whether each is inside a function, and under TYPE_CHECKING.
Statements = list[tuple[ast.Import | ast.ImportFrom, bool, bool]]


# Read by the first test, not by each process that collects; whole trees are too many to be kept.
@functools.cache
def _modules() -> dict[str, Statements]:
    found = {}
    for path in sorted((ROOT / PACKAGE).rglob('*.py')):
        parts = list(path.relative_to(ROOT).with_suffix('').parts)
        if parts[-1] == '__init__':
            parts.pop()
        found['.'.join(parts)] = _read(path)
    return found


def _read(path: Path) -> Statements:
    return list(_statements(ast.parse(path.read_text(), filename=str(path))))


def _statements(
    node: ast.AST, lazy: bool = False, typing: bool = False,
) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool, bool]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.Import, ast.ImportFrom)):
            yield child, lazy, typing
        elif isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield from _statements(child, True, typing)
        elif isinstance(child, (ast.stmt, ast.ExceptHandler, ast.match_case)):
            only_typing = isinstance(child, ast.If) and 'TYPE_CHECKING' in ast.unparse(child.test)
            yield from _statements(child, lazy, typing or only_typing)


@functools.cache
def _imports() -> list[Import]:
    found = []
    for importer, statements in _modules().items():
        for node, lazy, typing in statements:
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                base = '.' * node.level + (node.module or '')
                names = [f'{base}.{alias.name}' if f'{base}.{alias.name}' in _modules() else base
                         for alias in node.names]
            found += [Import(importer, name, node.lineno, lazy, typing) for name in set(names)]
    return found


@functools.cache
def _own() -> list[Import]:
    return [one for one in _imports() if one.imported.split('.')[0] == PACKAGE]


def _inside(module: str, places: tuple[str, ...]) -> bool:
    return any(module == place or module.startswith(place + '.') for place in places)


def _layer(module: str) -> str:
    return module.split('.')[1] if '.' in module else ''


def _feature(module: str) -> str:
    parts = module.split('.')
    return parts[2] if len(parts) > 2 and parts[1] == 'features' else ''


def _allowed(one: Import) -> bool:
    importer, imported = _layer(one.importer), _layer(one.imported)
    feature, other = _feature(one.importer), _feature(one.imported)
    if feature and other and feature != other:
        return other in FEATURES[feature].requires
    return importer == imported or RANK[imported] < RANK[importer]


def _listed(names: Iterable[str]) -> str:
    return ', '.join(f'`{name}`' for name in names) or '-'


def test_every_module_belongs_to_a_layer() -> None:
    assert {_layer(name) for name in _modules()} == {'', *LAYERS}
    assert {_feature(name) for name in _modules()} == {'', *FEATURES}


def test_no_layer_imports_a_higher_one() -> None:
    assert [str(one) for one in _own() if not _allowed(one)] == []


def test_gateway_and_monitor_know_only_messages_and_foundations_of_the_robot() -> None:
    assert [str(one) for one in _own() if (side := _layer(one.importer)) in SERVER_SIDES
            and not _inside(one.imported, tuple(
                f'{PACKAGE}.{name}' for name in (side, *SERVER_SIDES[side])))] == []


def test_endpoints_of_the_server_stand_in_its_api() -> None:
    places = {str(path.relative_to(ROOT / PACKAGE / 'monitor'))
              for path in (ROOT / PACKAGE / 'monitor').rglob('*.py')
              if 'APIRouter(' in path.read_text(encoding='utf-8')}
    assert len(places) > 10 and {each.split('/')[0] for each in places} == {'api'}


def test_the_architecture_shows_the_layers() -> None:
    rows = [f'| `{name}` | {text} |' for name, text in LAYERS.items()]
    brings = [f'| `{name}` | {each.summary} | {_listed(each.modules)} | {_listed(each.devices)} | '
              f'{_listed(each.programs)} | {_listed(each.requires)} |'
              for name, each in FEATURES.items()]
    page = (ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8')
    for table in (['| folder | what it holds |', '|---|---|', *rows],
                  [BRINGS, '|---|---|---|---|---|---|', *brings]):
        assert '\n'.join(table) in page, 'docs/architecture.md must have this table:\n' + (
            '\n'.join(table))


def test_the_core_knows_no_kind_of_device_or_module() -> None:
    allowed = {f'{PACKAGE}.devices.{name}' for name in CORE_KNOWS_OF_DEVICES} | {
        f'{PACKAGE}.modules', f'{PACKAGE}.modules.registry'}
    assert [str(one) for one in _own()
            if _layer(one.importer) == 'core' and _layer(one.imported) in ('devices', 'modules')
            and not PROGRAM.fullmatch(one.importer.partition('.')[2])
            and one.imported not in allowed] == []


def test_the_bytes_of_a_device_need_neither_its_driver_nor_its_simulated_device() -> None:
    folders = {name.rpartition('.')[0] for name in _modules() if name.endswith('.simulated')}
    assert len(folders) > 10
    assert [str(one) for one in _own()
            if WIRE.fullmatch(one.importer.partition('.')[2])
            and not WIRE_MAY_IMPORT.fullmatch(one.imported.partition('.')[2])] == []
    assert [str(one) for one in _own() if one.importer in folders
            and one.importer != f'{PACKAGE}.devices.capture'
            and one.imported != f'{PACKAGE}.devices.parts'] == []


def test_a_simulated_device_shares_bytes_with_its_driver_and_nothing_else() -> None:
    assert [str(one) for one in _own() if SIMULATED.fullmatch(one.importer.partition('.')[2])
            and not SIMULATED_MAY_IMPORT.fullmatch(one.imported.partition('.')[2])] == []


def test_a_library_is_imported_only_where_it_belongs() -> None:
    assert [str(one) for one in _imports()
            if (library := one.imported.split('.')[0]) in LIBRARIES
            and not _inside(one.importer, LIBRARIES[library])] == []


def test_every_program_is_the_thin_main_of_its_part() -> None:
    assert PROGRAMS
    for name, target in PROGRAMS.items():
        module, _, function = target.partition(':')
        assert PROGRAM.fullmatch(module) and module.endswith('program'), (name, target)
        assert function == 'main', (name, target)
        tree = ast.parse((ROOT / f"{module.replace('.', '/')}.py").read_text())
        assert not any(isinstance(node, ast.ClassDef) for node in ast.walk(tree)), target
        assert max(node.lineno for node in ast.walk(tree) if hasattr(node, 'lineno')) < (
            PROGRAM_LINES), target
        # Before Ctrl-C is seen to, it imports nothing that takes long.
        folders = module.split('.')[:-1]
        before = {'.'.join(folders[:count]) for count in range(2, len(folders) + 1)} | {module}
        early = {one.imported for one in _own()
                 if one.importer in before and not (one.lazy or one.typing)}
        assert early <= {f'{PACKAGE}.base.lazy_names', f'{PACKAGE}.base.programs'}, target


def test_an_import_is_of_one_name_and_of_a_module_by_its_package() -> None:
    files = dict(_modules())
    for folder in ('benchmarks', 'scripts', 'test'):
        for path in sorted((ROOT / folder).rglob('*.py')):
            files[str(path.relative_to(ROOT))] = _read(path)
    odd = []
    for name, statements in files.items():
        for node, _, _ in statements:
            if len(node.names) > 1 if isinstance(node, ast.ImportFrom) else any(
                    alias.name.startswith(f'{PACKAGE}.') for alias in node.names):
                odd.append(f'{name}:{node.lineno}: {ast.unparse(node)}')
    assert odd == []


def test_imports_are_absolute() -> None:
    assert [str(one) for one in _imports() if one.imported.startswith('.')] == []


def test_no_import_cycle() -> None:
    graph: dict[str, set[str]] = {name: set() for name in _modules()}
    for one in _own():
        graph[one.importer].add(one.imported)  # for typing only, or in a function, as well
    # Take away what imports nothing that is left; what stays is in a cycle or needs one.
    while free := [name for name, needs in graph.items() if not needs & graph.keys()]:
        for name in free:
            del graph[name]
    assert {name: sorted(needs & graph.keys()) for name, needs in graph.items()} == {}

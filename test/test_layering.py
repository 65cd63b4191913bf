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
from collections.abc import Iterator
from dataclasses import dataclass
import functools
from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'rt_robot_os'

# From the bottom up. A layer may import itself and every layer of the rows before it.
LAYERS = (
    ('requirements',),
    ('compiled', 'lazy_names', 'moved', 'safe_text'),
    ('errors', 'reports', 'schema', 'units'),
    ('live_settings', 'logger', 'needs', 'plugins', 'programs'),
    ('output_files',),
    ('motion', 'uplink'),
    ('wsn',),
    ('alarms',),
    ('agent', 'health'),
    ('texts',),
    ('linux', 'slam'),
    ('kernel',),
    ('dumps',),
    ('topics',),
    ('devices',),
    ('modules',),
    ('link',),
    ('clients.top',),
    ('settings',),
    ('tools.plan',),
    ('core',),
    ('clients.recording',),
    ('clients.ros',),
    ('clients.gateway', 'clients.notifier', 'monitor'),
    ('clients.alarms', 'clients.mapping', 'clients.parameters', 'tools.black_box',
     'tools.doctor', 'tools.health', 'tools.new', 'tools.wsn'),
    ('tools.bench', 'tools.rehearse'),
    ('program',),
    ('testing',),
)

RANK = {name: row for row, names in enumerate(LAYERS) for name in names}

# Twins stand beside the drivers: they share the bytes with them, never a driver.
TWIN = re.compile(r'devices\.\w+\.twin(_\w+)?')
TWIN_MAY_IMPORT = re.compile(
    r'devices\.(\w+\.(twin(_\w+)?|wire|mtdata2|rtcm)|atmosphere|capture\..*|i2c\.packets)'
    r'|health\..*|(errors|linux|motion|plugins|reports|schema|sim|units|wsn)(\..*)?')
# The driver, the twin and who asks whose bytes they are share the bytes of a device; its folder
# declares names, for every process, and imports nothing.
WIRE = re.compile(r'devices\.\w+\.(wire|mtdata2|rtcm)')
WIRE_MAY_IMPORT = re.compile(r'devices\.(\w+\.(wire|mtdata2|rtcm)|framing|partial_sums)'
                             r'|units|wsn\.packets(\..*)?')
# The frame of the twins finds them in the table of devices, which names drivers and imports none.
TABLE = f'{PACKAGE}.devices.table'
MAY_IMPORT_SIM = ('settings', 'core', 'clients.ros', 'tools.bench', 'tools.rehearse', 'program',
                  'sim', 'testing')

# Wherever they stand: what a program is made of may import everything, and nobody imports it.
PROGRAM = re.compile(r'[\w.]+\.(\w+_)?(program|command)')
PROGRAM_LINES = 100

# The contract; what a driver is stays with the driver.
CORE_KNOWS_OF_DEVICES = ('device', 'manager', 'registry', 'service', 'state')

# library -> the only places that may import it
LIBRARIES = {
    'rclpy': (f'{PACKAGE}.clients.ros', f'{PACKAGE}.tools.bench.peers'),
    'ctypes': (f'{PACKAGE}.linux',),
    'serial': (f'{PACKAGE}.devices.serial.transport', f'{PACKAGE}.sim'),
    'cv2': (f'{PACKAGE}.devices.capture.pictures',),
    'PIL': (f'{PACKAGE}.devices.capture.camera', f'{PACKAGE}.devices.capture.pictures'),
    'sounddevice': (f'{PACKAGE}.clients.gateway.voice_sound',
                    f'{PACKAGE}.devices.capture.sound'),
    'mcap': (f'{PACKAGE}.clients.mapping.bags.mcap_file', f'{PACKAGE}.clients.recording'),
    'smbus2': (f'{PACKAGE}.devices.i2c.linux_bus',),
    'rich': (f'{PACKAGE}.clients.top.live',),
    'scipy': (f'{PACKAGE}.slam',),
    'aiortc': (f'{PACKAGE}.clients.gateway',),
    'av': (f'{PACKAGE}.clients.gateway.voice_call',),
    'alembic': (f'{PACKAGE}.monitor.store',),
    'argon2': (f'{PACKAGE}.monitor.security',),
    'cryptography': (f'{PACKAGE}.monitor.security',),
    'fastapi': (f'{PACKAGE}.monitor',),
    'pydantic': (f'{PACKAGE}.monitor',),
    'sqlalchemy': (f'{PACKAGE}.monitor',),
    'starlette': (f'{PACKAGE}.monitor',),
    'uvicorn': (f'{PACKAGE}.monitor',),
    'websockets': (f'{PACKAGE}.clients.gateway', f'{PACKAGE}.tools.bench.workers.gateway'),
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
    name = module.partition('.')[2]
    if TWIN.fullmatch(name):
        return 'sim'
    if PROGRAM.fullmatch(name):
        return 'program'
    return next((layer for layer in RANK if _inside(name, (layer,))), name.partition('.')[0])


def _allowed(one: Import) -> bool:
    importer, imported = _layer(one.importer), _layer(one.imported)
    if importer == 'sim':
        found = one.imported == TABLE and _inside(one.importer, (f'{PACKAGE}.sim',))
        return found or bool(TWIN_MAY_IMPORT.fullmatch(one.imported.partition('.')[2]))
    if imported == 'sim':
        return importer in MAY_IMPORT_SIM
    if importer == imported or (
            importer == '' and imported == 'moved'):
        return True
    return importer in RANK and imported in RANK and RANK[imported] < RANK[importer]


def test_every_module_belongs_to_a_layer() -> None:
    known = {'', 'sim', 'clients', 'tools', *RANK}
    assert sorted({_layer(name) for name in _modules()} - known) == []


def test_no_layer_imports_a_higher_one() -> None:
    assert [str(one) for one in _own() if not _allowed(one)] == []


def test_the_core_knows_no_kind_of_device_or_module() -> None:
    allowed = {f'{PACKAGE}.devices.{name}' for name in CORE_KNOWS_OF_DEVICES} | {
        f'{PACKAGE}.modules', f'{PACKAGE}.modules.registry'}
    assert [str(one) for one in _own()
            if _layer(one.importer) == 'core' and _layer(one.imported) in ('devices', 'modules')
            and one.imported not in allowed] == []


def test_the_bytes_of_a_device_need_neither_its_driver_nor_its_twin() -> None:
    folders = {name.rpartition('.')[0] for name in _modules() if name.endswith('.twin')}
    assert len(folders) > 10
    assert [str(one) for one in _own()
            if WIRE.fullmatch(one.importer.partition('.')[2])
            and not WIRE_MAY_IMPORT.fullmatch(one.imported.partition('.')[2])] == []
    assert [str(one) for one in _own() if one.importer in folders
            and one.importer != f'{PACKAGE}.devices.capture'
            and one.imported != f'{PACKAGE}.devices.parts'] == []


def test_a_library_is_imported_only_where_it_belongs() -> None:
    assert [str(one) for one in _imports()
            if (library := one.imported.split('.')[0]) in LIBRARIES
            and not _inside(one.importer, LIBRARIES[library])] == []


def test_every_program_is_the_thin_main_of_its_part() -> None:
    scripts = dict(re.findall(r"'(\w+) = ([\w.]+:\w+)'", (ROOT / 'setup.py').read_text()))
    assert scripts
    for name, target in scripts.items():
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
        assert early <= {f'{PACKAGE}.lazy_names', f'{PACKAGE}.programs'}, target


def test_an_import_is_of_one_name_and_of_a_module_by_its_package() -> None:
    files = dict(_modules())
    for folder in ('test', 'scripts'):
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

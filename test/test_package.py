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

"""Check what users meet before any code runs: manifests, executables, launch file, links."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import configparser
import fnmatch
import functools
import importlib
import os
from pathlib import Path
import re
import subprocess
import sys
import tokenize
from xml.etree import ElementTree

import pytest

from rt_robot_os.base import needs
from rt_robot_os.base.programs import Program
from rt_robot_os.base.requirements import BASE
from rt_robot_os.base.requirements import EXTRAS
from rt_robot_os.base.requirements import LIBRARIES
from rt_robot_os.base.requirements import libraries
from rt_robot_os.base.requirements import PROGRAMS
import setup_programs

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'rt_robot_os'

# import name -> rosdep key of what every robot needs and ROS 2 does not bring
KEYS = {
    'numpy': 'python3-numpy', 'rich': 'python3-rich', 'serial': 'python3-serial',
    'yaml': 'python3-yaml'}

# import name -> the library that brings it, for those that the table does not list
BROUGHT = {'av': 'aiortc', 'starlette': 'fastapi'}
# import name -> the library of the table
TABLE = {each.module: each.name for each in LIBRARIES.values()}
# What is given to the functions of needs.py.
ASKED = re.compile(r"(?:EXTRAS\[|, |\n +)'([\w-]+)'[\]),]")
EXTRAS_ASKED = {extra: EXTRAS[extra] for extra in ('gateway', 'monitor', 'slam')}
# What runs setup.py is there when it runs.
BUILD = {'setuptools'}


def _setup() -> dict[str, ast.expr]:
    """Return the keyword arguments that setup.py gives to setup()."""
    for node in ast.walk(ast.parse((ROOT / 'setup.py').read_text())):
        if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'setup':
            return {keyword.arg: keyword.value for keyword in node.keywords if keyword.arg}
    raise LookupError('setup.py does not call setup()')


SETUP = _setup()
MANIFEST = ElementTree.parse(ROOT / 'package.xml').getroot()
EXECUTABLES = setup_programs.PROGRAMS


def _manifest(tag: str) -> list[str]:
    return [element.text or '' for element in MANIFEST.findall(tag)]


def _texts() -> Iterator[Path]:
    """Yield every text file of the repository, but what the scripts and colcon made."""
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [name for name in folders
                      if not (name.startswith('.') and name != '.ci')
                      and name not in ('__pycache__', 'build', 'install', 'log')
                      and not name.endswith('.egg-info')]
        for name in names:
            path = Path(folder, name)
            # In a further work tree .git is a file.
            if name != '.git' and not name.endswith(
                    ('.pyc', '.png', '.mcap', '.bin', '.lock', '.so')):
                yield path


def test_the_manifest_is_complete() -> None:
    assert MANIFEST.get('format') == '3'
    assert _manifest('name') == [PACKAGE]
    assert _manifest('license') == ['Apache-2.0']
    assert MANIFEST.findtext('export/build_type') == 'ament_python'
    maintainer = MANIFEST.find('maintainer')
    assert maintainer is not None
    assert re.fullmatch(r'[\w.+-]+@[\w-]+(\.[\w-]+)+', maintainer.get('email', ''))
    for tag in ('exec_depend', 'test_depend'):
        assert _manifest(tag) == sorted(set(_manifest(tag)))


def test_rosdep_needs_no_pip_which_ubuntu_keeps_from_the_python_of_the_system() -> None:
    keys = _manifest('exec_depend') + _manifest('test_depend')
    assert [key for key in keys if key.endswith('-pip')] == []


def test_the_version_is_the_same_everywhere() -> None:
    changelog = (ROOT / 'CHANGELOG.rst').read_text()
    newest = re.search(r'^(\d+\.\d+\.\d+|Forthcoming)\b.*\n-+\n', changelog, re.MULTILINE)
    assert newest is not None
    version = ast.literal_eval(SETUP['version'])
    assert _manifest('version') == [version]
    released = re.findall(r'^(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)$', changelog, re.MULTILINE)
    assert released[0] == version


@functools.cache
def _imported() -> set[str]:
    """Return the libraries that the package imports; also those that it imports by their name."""
    found = set()
    for path in (ROOT / PACKAGE).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found.add(node.module)
            elif isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'import_module':
                found |= {each.value for each in node.args if isinstance(each, ast.Constant)}
    return {name.split('.')[0] for name in found} - set(sys.stdlib_module_names) - {PACKAGE}


def test_what_is_imported_is_installed_with_the_package_by_pip_and_by_rosdep() -> None:
    of_ros = {name for name in _manifest('exec_depend') if not name.startswith('python3-')}
    optional = {name for names in EXTRAS.values() for name in names}
    found = {TABLE.get(name) or BROUGHT.get(name, name) for name in _imported() - of_ros - BUILD}
    assert found - optional == set(BASE) - BUILD
    assert {KEYS[LIBRARIES[name].module] for name in found - optional} == set(
        _manifest('exec_depend')) - of_ros


def test_what_is_optional_is_asked_for_by_name_where_it_is_needed() -> None:
    asked = {name for path in (ROOT / PACKAGE).rglob('*.py') for name in ASKED.findall(
        path.read_text()) for name in EXTRAS_ASKED.get(name, (name,))}
    optional = {name for extra, names in EXTRAS.items() for name in names
                if extra not in ('docs', 'peers', 'test')}
    assert sorted(optional - asked) == []


def test_setup_states_what_the_table_lists() -> None:
    done = subprocess.run(
        [sys.executable, '-c', 'import runpy, setuptools; setuptools.setup = lambda **given: print'
         '(*given["install_requires"], *sum(given["extras_require"].values(), []), sep="\\n"); '
         'runpy.run_path("setup.py")'], cwd=ROOT, capture_output=True, text=True, check=True)
    stated = set(done.stdout.split('\n')) - {''}
    assert stated == {each.requirement for each in libraries(['base', *EXTRAS])}


def test_the_table_names_only_what_there_is() -> None:
    listed = {name for names in (BASE, *EXTRAS.values()) for name in names}
    assert listed == set(LIBRARIES)
    assert set(PROGRAMS) - {'test'} <= set(EXECUTABLES)
    assert {extra for extras in PROGRAMS.values() for extra in extras} <= set(EXTRAS)


def test_the_page_on_libraries_lists_what_the_table_does() -> None:
    text = (ROOT / needs.PAGE).read_text()
    for extra in ('base', *EXTRAS):
        listed = ', '.join(f'{each.name} {each.lowest}' for each in libraries([extra]))
        assert re.search(rf'^\| `{extra}` \|[^|]+\| {re.escape(listed)} \|$', text,
                         re.MULTILINE), extra
    for program, extras in PROGRAMS.items():
        row = f'| `{program}` | {", ".join(f"`{extra}`" for extra in extras)} |'
        assert program == 'test' or row in text
    for name, lowest in re.findall(r'^\| ([\w-]+) \| (\d[\d.]*) \| \d', text, re.MULTILINE):
        assert LIBRARIES[name].lowest == lowest


def test_the_decision_on_dependencies_names_them_all() -> None:
    text = (ROOT / 'docs' / 'decisions' / '0004-dependencies.md').read_text()
    named = {heading: set(re.findall(r'^\| `([\w-]+)` \|', section, re.MULTILINE))
             for heading, section in re.findall(r'^## ([^\n]*)\n(.*?)(?=^## |\Z)', text,
                                                re.MULTILINE | re.DOTALL)}
    ours = {name for extra, names in EXTRAS.items() for name in names
            if extra not in ('docs', 'test')}
    assert named['Needed to run'] == set(BASE) - BUILD
    assert named['Optional'] == ours
    assert named['For tests and documentation'] == {*EXTRAS['docs'], *EXTRAS['test']} - ours


@pytest.mark.parametrize('name', sorted(EXECUTABLES))
def test_an_executable_can_be_started(name: str) -> None:
    module, _, function = EXECUTABLES[name].partition(':')
    main = getattr(importlib.import_module(module), function)
    assert callable(main.load() if isinstance(main, Program) else main)


def test_executables_land_where_ros2_run_looks() -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / 'setup.cfg')
    assert config['develop']['script_dir'] == f'$base/lib/{PACKAGE}'
    assert config['install']['install_scripts'] == f'$base/lib/{PACKAGE}'


def test_every_module_and_data_file_is_installed() -> None:
    patterns = [f'{PACKAGE}/{pattern.value!s}' for pattern in ast.walk(SETUP['package_data'])
                if isinstance(pattern, ast.Constant) and str(pattern.value) != PACKAGE]
    missing = []
    for path in sorted((ROOT / PACKAGE).rglob('*')):
        name = path.relative_to(ROOT).as_posix()
        if not path.is_file() or path.suffix in ('.pyc', '.so'):
            continue
        if path.suffix == '.py':
            if not (path.parent / '__init__.py').is_file():
                missing.append(f'{name}: no __init__.py beside it')
        elif not any(fnmatch.fnmatch(name, pattern) for pattern in patterns):
            missing.append(f'{name}: not in package_data')
    assert missing == []
    assert (ROOT / PACKAGE / 'py.typed').is_file()
    assert (ROOT / 'resource' / PACKAGE).read_bytes() == b''


def test_the_launch_files_start_executables_that_exist() -> None:
    nodes = [node for path in (ROOT / 'launch').glob('*.xml')
             for node in ElementTree.parse(path).getroot().iter('node')]
    ours = [node for node in nodes if not node.get('pkg', '').startswith('nav2_')]
    assert ours
    for node in ours:
        assert node.get('pkg') == PACKAGE
        assert node.get('exec') in EXECUTABLES


def test_the_scripts_can_be_executed() -> None:
    for name in ('scripts/install', 'scripts/lowest', 'scripts/run', 'scripts/test',
                 'scripts/tf2_msgs', '.ci/run'):
        assert os.access(ROOT / name, os.X_OK), name


def _anchors(text: str) -> set[str]:
    """Return what the headings of a page are linked by, in the manner of code forges."""
    headings = re.findall(r'^#+ +(.+?) *$', re.sub(r'```.*?```', '', text, flags=re.DOTALL),
                          re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-') for heading in headings}


def _broken(page: Path) -> Iterator[str]:
    text = re.sub(r'```.*?```|`[^`\n]*`', '', page.read_text(), flags=re.DOTALL)
    for target in re.findall(r'\]\(<?([^)>\s]+)', text):
        if re.match(r'[a-z]+:', target):
            continue
        name, _, anchor = target.partition('#')
        path = (page.parent / name).resolve() if name else page
        if not path.exists():
            yield f'{page.relative_to(ROOT)}: {target}: no such file'
        elif anchor and path.suffix == '.md' and anchor not in _anchors(path.read_text()):
            yield f'{page.relative_to(ROOT)}: {target}: no such heading'


def test_every_link_in_the_documents_leads_somewhere() -> None:
    pages = [*ROOT.glob('*.md'), *sorted((ROOT / 'docs').rglob('*.md'))]
    assert ROOT / 'README.md' in pages
    assert [broken for page in pages for broken in _broken(page)] == []


def test_no_file_names_a_path_of_one_machine_or_a_registry() -> None:
    places = '|'.join(['wor' + 'k/', 'opt/d' + 'ev', 'ro' + 'ot/', 'home/[a-z]'])
    hosts = '|'.join(['py' + 'pi.org', 'python' + 'hosted', 'deb' + 'ian.org', 'npm' + 'js.'])
    pattern = re.compile(rf'(?<![\w/.$}}~-])/(?:{places})|{hosts}')
    found = []
    for path in _texts():
        for number, line in enumerate(path.read_text(errors='replace').splitlines(), 1):
            if pattern.search(line):
                found.append(f'{path.relative_to(ROOT)}:{number}: {line.strip()}')
    assert found == []


def test_the_readme_names_every_program() -> None:
    found = re.search(r'^\| program \|.*?\n\n', (ROOT / 'README.md').read_text(),
                      re.DOTALL | re.MULTILINE)
    assert found is not None
    named = {name for row in found[0].strip().splitlines()[2:]
             for name in re.findall(r'`(\w+)`', row.split('|')[1])}
    assert sorted(named) == sorted(EXECUTABLES)


def test_every_page_can_be_found_from_the_readme() -> None:
    targets = re.findall(r'\]\((docs/[^)#]*)', (ROOT / 'README.md').read_text())
    pages = {page.relative_to(ROOT).as_posix() for page in (ROOT / 'docs').rglob('*.md')}
    found = {page for page in pages if page in targets or f'{page.rpartition("/")[0]}/' in targets}
    assert sorted(pages - found) == []


# A file with its folder, or the name of a module or page.
NAMED_FILE = re.compile(
    r'(?<![\w/.{}$*@<~-])((?:[\w-]+/)+[\w-]+\.(?:py|md|rst|yaml|json|trace|svg|xml|cfg)'
    r'|[a-z]\w*\.(?:py|md))(?![\w/(])')
NAMED_MODULE = re.compile(rf'(?<![\w.\'"/@]){PACKAGE}((?:\.[a-z_]\w*)+)')
RELATIVE_ROLE = re.compile(r':mod:`\.(\w+)`')
NAMED_BEFORE = re.compile(r'`((?:blackbox|drivers|sensors)\.[a-z_]\w*[\w.]*)`')
OF_OTHERS = re.compile(
    r'Documentation/.*|(conf|setup|sitecustomize|usercustomize)\.py|.*/cases/NAME\.py')
NAMES_OF_METADATA = ('drivers', 'modules', 'session', 'simulators')


def _prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield what people read in a file: comments and docstrings, or a page without its code."""
    text = path.read_text()
    if path.suffix == '.md':
        text = re.sub(r'```.*?```|~~~.*?~~~', lambda code: '\n' * code[0].count('\n'), text,
                      flags=re.DOTALL)
        text = re.sub(r'\]\([^)]*\)', ']', text)
        yield from enumerate(text.splitlines(), 1)
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) \
                and ast.get_docstring(node, clean=False) is not None:
            first = node.body[0].lineno
            yield from enumerate((ast.get_docstring(node, clean=False) or '').split('\n'), first)
    with tokenize.open(path) as file:
        yield from ((token.start[0], token.string)
                    for token in tokenize.generate_tokens(file.readline)
                    if token.type == tokenize.COMMENT)


def _stands_there(module: str) -> bool:
    """Tell whether a dotted name is a module of the package, or a name in one."""
    parts = module.split('.')
    folder = ROOT / PACKAGE
    while parts and (folder / parts[0]).is_dir():
        folder /= parts.pop(0)
    if parts and (folder / f'{parts[0]}.py').is_file():
        return True
    return len(parts) < 2


def _missing(page: str, line: str, endings: set[str]) -> list[str]:
    """Give what a line of a page names that is not there."""
    return [
        *(found for found in NAMED_FILE.findall(line)
          if found not in endings and not OF_OTHERS.fullmatch(found)),
        *(f'{PACKAGE}{found}' for found in NAMED_MODULE.findall(line)
          if found[1:] not in NAMES_OF_METADATA and not _stands_there(found[1:])),
        *NAMED_BEFORE.findall(line),
        *(f'.{found}' for found in RELATIVE_ROLE.findall(line)
          if not (ROOT / page).with_name(f'{found}.py').is_file())]


def test_files_and_modules_named_in_comments_and_pages_are_there() -> None:
    files = {path.relative_to(ROOT).as_posix() for path in _texts()}
    endings = {'/'.join(name.split('/')[-count:]) for name in files
               for count in range(1, name.count('/') + 2)}
    pages = {name for name in files if name.endswith(('.py', '.md')) and 'test/golden' not in name}
    missing = []
    for name in sorted(pages):
        lines = (ROOT / name).read_text().splitlines()
        if any(_missing(name, line, endings) for line in lines):  # to take it apart takes long
            missing += [f'{name}:{number}: {found}' for number, line in _prose(ROOT / name)
                        for found in _missing(name, line, endings)]
    assert missing == []


@pytest.mark.parametrize('made_for, here, said', [
    ('ros', 'wheels', 'was made for ROS 2 that is sourced, and here it is not'),
    ('wheels', 'ros', 'was made without ROS, and here ROS 2 is sourced')])
def test_an_environment_that_was_named_is_not_thrown_away_for_another_kind_of_shell(
        tmp_path: Path, made_for: str, here: str, said: str) -> None:
    (tmp_path / '.rt_robot_os').write_text(f'{made_for}\n')
    done = subprocess.run(
        ['bash', '-c',
         '. "$0"; MODE=$1; VENV=$RT_ROBOT_OS_VENV; PYTHON=$VENV/bin/python; make_venv',
         ROOT / 'scripts' / 'environment.bash', here],
        env={**os.environ, 'RT_ROBOT_OS_VENV': str(tmp_path)}, capture_output=True, text=True)
    assert done.returncode == 2 and said in done.stderr
    assert (tmp_path / '.rt_robot_os').exists()

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

"""What users' packages import is there, also where it only leads to a new place."""

from __future__ import annotations

import importlib
from pathlib import Path
import re
from typing import Any
import warnings

import pytest

FILE = 'public_names.txt'
SHOWN = ('README.md', 'docs/**/*.md', 'docs/**/*.py', 'examples/**/*.md', 'examples/**/*.py',
         'rt_robot_os/**/templates/*.in', 'rt_robot_os/**/*.in')
IMPORT = re.compile(r'from (rt_robot_os[\w.]*) import ([\w, ]+)')
Names = dict[str, set[str]]


def read(text: str) -> Names:
    """Read lines ``module: name name``."""
    pairs = (line.partition(':') for line in text.splitlines())
    return {module: set(names.split()) for module, _, names in pairs}


def write(names: Names) -> str:
    """Write what :func:`read` reads."""
    return ''.join(f'{module}: {" ".join(sorted(names[module]))}'.rstrip() + '\n'
                   for module in sorted(names))


def shown(root: Path) -> Names:
    """Give what the documentation, the examples and the templates import."""
    found: Names = {}
    for path in {path for pattern in SHOWN for path in root.glob(pattern)}:
        if not {'build', 'install'} & set(path.relative_to(root).parts):
            for module, names in IMPORT.findall(path.read_text(encoding='utf-8')):
                found.setdefault(module, set()).update(re.findall(r'\w+', names))
    return found


def lines() -> list[str]:
    """Give the lines of the file."""
    return (Path(__file__).parent / FILE).read_text(encoding='utf-8').splitlines()


@pytest.mark.parametrize('line', lines(), ids=lambda line: str(line).partition(':')[0])
def test_what_was_public_is_still_there(line: str) -> None:
    (module_name, names), = read(line).items()
    with warnings.catch_warnings():
        # It may say where the new place is.
        warnings.simplefilter('ignore', DeprecationWarning)
        module = importlib.import_module(module_name)
        missing = [name for name in sorted(names) if not hasattr(module, name)]
        assert not missing, f'{module_name}: users import {", ".join(missing)} from it'
        values = [getattr(module, name) for name in names]
    for value in values:
        if isinstance(value, type) and value.__module__.startswith('rt_robot_os.'):
            home = importlib.import_module(value.__module__)
            assert getattr(home, value.__name__) is value, f'{value}: there are two of it'


def test_what_the_documentation_imports_is_in_the_file(golden: Any) -> None:
    known = read('\n'.join(lines()))
    found = shown(golden.root)
    assert len(found) >= 8
    for module, names in found.items():
        known[module] = known.get(module, set()) | names
    # The file only grows by this: what goes is deleted by hand, and told to users.
    golden.check(FILE, write(known))

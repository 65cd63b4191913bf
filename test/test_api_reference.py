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

"""What users write code against is documented, and Sphinx understands all of it."""

from __future__ import annotations

from collections.abc import Iterator
import importlib
import importlib.util
import inspect
from pathlib import Path
import subprocess
import sys
from types import ModuleType
from typing import Any

import pytest

pytest.importorskip('rcl_interfaces', reason='the ROS 2 messages are not installed')

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = ROOT / 'scripts' / 'api_reference.py'


def _script() -> ModuleType:
    spec = importlib.util.spec_from_file_location('api_reference', SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MODULES = [name for _, names in _script().PAGES.values() for name in names]


def _public(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """Give the classes and functions of a module, and their methods, that have no underscore."""
    for name in getattr(module, '__all__', list(vars(module))):
        value = getattr(module, name)
        ours = (getattr(value, '__module__', '') or '').startswith('rt_robot_os')
        if name.startswith('_') or not ours or not (
                inspect.isclass(value) or inspect.isfunction(value)):
            continue
        yield name, value
        for key, member in vars(value).items() if inspect.isclass(value) else ():
            if not key.startswith(('_', 'test_')) and (
                    inspect.isfunction(member) or isinstance(member, property)):
                yield f'{name}.{key}', getattr(value, key)


@pytest.mark.parametrize('name', MODULES)
def test_every_public_name_says_what_it_is_for(name: str) -> None:
    module = importlib.import_module(name)
    assert inspect.getdoc(module)
    assert [what for what, value in _public(module) if not inspect.getdoc(value)] == []


def test_sphinx_makes_the_reference_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip('sphinx', reason='Sphinx is not installed')
    done = subprocess.run([sys.executable, str(SCRIPT), '--out', str(tmp_path)], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, done.stdout
    page = (tmp_path / 'modules.html').read_text()
    assert 'rt_robot_os.modules.Module.step' in page
    assert 'Do one job, in the real-time loop.' in page

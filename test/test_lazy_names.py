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

"""Public names of a package are imported when they are first asked for, and are what they were."""

from __future__ import annotations

from pathlib import Path
import sys

import pytest

INIT = """
from rt_robot_os.base.lazy_names import lazy_names
lazy_names(__name__, {'Thing': 'inner.things', 'make': 'make'})
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
            request: pytest.FixtureRequest) -> str:
    name = f'lazy_{request.node.name}'
    (tmp_path / name / 'inner').mkdir(parents=True)
    (tmp_path / name / '__init__.py').write_text(INIT)
    (tmp_path / name / 'inner' / 'things.py').write_text('class Thing: pass')
    (tmp_path / name / 'make.py').write_text('def make(): return 1')
    monkeypatch.syspath_prepend(tmp_path)
    return name


def test_nothing_is_imported_before_it_is_asked_for(package: str) -> None:
    lazy = __import__(package)
    assert f'{package}.inner.things' not in sys.modules
    assert {'Thing', 'make'} <= set(dir(lazy))
    assert lazy.Thing is sys.modules[f'{package}.inner.things'].Thing
    assert lazy.Thing is lazy.Thing


def test_a_module_does_not_hide_a_name_like_its_own(package: str) -> None:
    lazy = __import__(f'{package}.make')
    assert lazy.make() == 1
    assert sys.modules[f'{package}.make'].make is lazy.make


def test_other_names_are_there_or_not_as_ever(package: str) -> None:
    lazy = __import__(package)
    setattr(lazy, 'more', 2)
    assert lazy.more == 2
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'Nothing'"):
        lazy.Nothing

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

"""Compare with the files of this folder, and write them anew when asked to."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import difflib
from importlib import metadata
import os
from pathlib import Path

import pytest

from rt_robot_os.base import plugins
from setup_programs import PROGRAMS

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parents[1]
REMEDY = ('What users see has changed. If that is meant: UPDATE_GOLDEN=1 ./scripts/test '
          'test/golden, read what git diff shows, and say so in CHANGELOG.rst.')
_MOST_LINES = 60


def _as_it_is(text: str) -> str:
    return text


class Golden:
    """The files of this folder; with ``UPDATE_GOLDEN`` set they are written, not compared."""

    folder = FOLDER
    root = ROOT
    remedy = REMEDY
    updating = 'UPDATE_GOLDEN' in os.environ

    def check(self, name: str, text: str, key: Callable[[str], str] = _as_it_is) -> None:
        """
        Compare a text with a file, or write it.

        :param key: texts of the same key are the same; only where they cannot be alike to the
            last byte.
        """
        path = FOLDER / name
        if self.updating:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8')
        wanted = path.read_text(encoding='utf-8') if path.exists() else ''
        if key(wanted) == key(text):
            return
        lines = list(difflib.unified_diff(
            wanted.splitlines(), text.splitlines(), f'test/golden/{name}', 'now', lineterm=''))
        more = [f'... and {len(lines) - _MOST_LINES} more lines'] if len(
            lines) > _MOST_LINES else []
        pytest.fail('\n'.join([*lines[:_MOST_LINES], *more, REMEDY]), pytrace=False)

    def check_files(self, folder: str, names: set[str]) -> None:
        """Check that a folder holds these files and no others; delete those when updating."""
        for path in sorted((FOLDER / folder).glob('*')):
            if path.name not in names and self.updating:
                path.unlink()
        found = {path.name for path in (FOLDER / folder).glob('*')}
        assert found == names, REMEDY

    @staticmethod
    def programs() -> dict[str, str]:
        """Give the programs of the package: name and ``module:function``, as setup.py says."""
        return PROGRAMS


@pytest.fixture(autouse=True)
def without_plugins(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch,
) -> Iterator[None]:
    """Hide the drivers and modules of other packages on this machine, but those of a test."""
    ours = str(tmp_path_factory.getbasetemp())
    found = metadata.Distribution.entry_points.fget  # type: ignore[attr-defined]

    def entry_points(self: metadata.Distribution) -> metadata.EntryPoints:
        points = found(self)
        if str(self.locate_file('')).startswith(ours):
            return points
        return metadata.EntryPoints(
            each for each in points if not each.group.startswith('rt_robot_os.'))

    monkeypatch.setattr(metadata.Distribution, 'entry_points', property(entry_points))
    plugins.installed.cache_clear()
    yield
    plugins.installed.cache_clear()


@pytest.fixture
def golden() -> Golden:
    """Give the files of this folder."""
    return Golden()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Test each program by itself."""
    if 'program' in metafunc.fixturenames:
        metafunc.parametrize('program', sorted(Golden.programs()))

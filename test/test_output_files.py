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

"""What a command line asks to be written is checked before any work is done."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.output_files import check_output
from rt_robot_os.base.output_files import check_picture
from rt_robot_os.base.requirements import Library
from rt_robot_os.features.mapping.cli.command import run as mapping
from rt_robot_os.tools.black_box.program import main as black_box

Check = Callable[[str, Path], None]
MISSING = '/never/there.log'


@pytest.mark.parametrize('check', [check_output, check_picture])
def test_what_cannot_be_written_is_named(tmp_path: Path, check: Check) -> None:
    (tmp_path / 'folder.png').mkdir()
    for name, wrong in (('none/a.png', f'there is no folder {tmp_path}/none'),
                        ('folder.png', 'is a folder: give the name of a file')):
        with pytest.raises(ConfigError) as caught:
            check('--picture', tmp_path / name)
        assert caught.value.problems == (f'--picture {tmp_path / name}: {wrong}',)


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
def test_a_folder_that_may_not_be_written_is_named(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(ConfigError, match='permission denied'):
        check_output('--report', tmp_path / 'a.json')
    tmp_path.chmod(0o700)


def test_what_can_be_written_passes_and_is_not_touched(tmp_path: Path) -> None:
    check_output('--report', None)
    check_output('--report', tmp_path / 'new.json')
    (tmp_path / 'old.json').write_text('old')
    check_output('--report', tmp_path / 'old.json')
    assert [each.name for each in tmp_path.iterdir()] == ['old.json']


def test_an_ending_that_nothing_draws_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r'a\.txt: the name must end with \.svg or \.png'):
        check_picture('plot', tmp_path / 'a.txt', ('.svg', '.png'))


def test_programs_without_matplotlib_say_so_before_they_read_anything(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(Library, 'found', lambda self: None if self.name == 'matplotlib' else '')
    picture = str(tmp_path / 'a.png')
    assert mapping(['--bag', MISSING, '--picture', picture]) == 2
    assert '--picture needs matplotlib' in capsys.readouterr().err
    assert black_box(['plot', MISSING, picture]) == 1
    assert 'plot needs matplotlib' in capsys.readouterr().err

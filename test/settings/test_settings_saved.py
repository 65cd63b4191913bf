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

"""Is what was changed while the robot ran written so that it counts when it is loaded again."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import load
from rt_robot_os.settings import RobotParameters
from rt_robot_os.settings.saved import MARK
from rt_robot_os.settings.saved import save
from rt_robot_os.settings.saved import saved_path

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

BASE = """\
/**/robot:
  ros__parameters:
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 100.0, timeout_s: 0.5}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist}
    mirrors: [safe]
    safe: {topic: cmd_vel_safe}
"""


@pytest.fixture
def base(tmp_path: Path) -> Path:
    path = tmp_path / 'robot.yaml'
    path.write_text(BASE)
    return path


def live_values(settings: Any) -> dict[str, Any]:
    return RobotParameters(settings).live_values()


def save_with(path: Path, loaded: Any, robot: str = 'robot', **values: Any) -> dict[str, Any]:
    now = RobotParameters(loaded)
    for name, value in values.items():
        now.set(name.replace('__', '.'), value)
    return save(path, robot, live_values(loaded), now.live_values())


def test_what_was_changed_is_there_when_both_files_are_loaded(base: Path, tmp_path: Path) -> None:
    saved = tmp_path / 'saved.yaml'
    written = save_with(saved, load([base]), guard__rate_hz=30, guard__timeout_s=0.25,
                        safe__policy='latest')
    assert written == {'guard.rate_hz': 30.0, 'guard.timeout_s': 0.25, 'safe.policy': 'latest'}
    again = live_values(load([base, saved]))
    assert {name: again[name] for name in written} == written
    assert 'linear_max' not in saved.read_text()
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith('.')] == []


@given(st.floats(0.01, 60.0), st.sampled_from(['robot', 'arm.robot', 'left.arm.robot']))
def test_any_value_and_any_name_comes_back(tmp_path_factory: pytest.TempPathFactory,
                                           timeout_s: float, robot: str) -> None:
    folder = tmp_path_factory.mktemp('saved')
    (folder / 'robot.yaml').write_text(BASE)
    files = [folder / 'robot.yaml', folder / 'saved.yaml']
    *namespace, node = robot.split('.')
    names = (node, '/' + '/'.join(namespace))
    if save_with(files[1], load(files[:1], {}, *names), robot, guard__timeout_s=timeout_s):
        assert live_values(load(files, {}, *names))['guard.timeout_s'] == timeout_s


def test_nothing_is_written_when_nothing_differs(base: Path, tmp_path: Path) -> None:
    assert save_with(tmp_path / 'saved.yaml', load([base]), guard__rate_hz=100.0) == {}
    assert not (tmp_path / 'saved.yaml').exists()


def test_what_was_saved_before_and_loaded_is_not_lost_with_the_next_change(
        base: Path, tmp_path: Path) -> None:
    saved = tmp_path / 'saved.yaml'
    save_with(saved, load([base]), guard__rate_hz=30.0)
    save_with(saved, load([base, saved]), guard__timeout_s=0.25)
    again = live_values(load([base, saved]))
    assert (again['guard.rate_hz'], again['guard.timeout_s']) == (30.0, 0.25)
    save_with(saved, load([base, saved]), guard__rate_hz=100.0)
    assert live_values(load([base, saved]))['guard.rate_hz'] == 100.0


def test_who_does_not_know_the_mirrors_leaves_them(base: Path, tmp_path: Path) -> None:
    saved = tmp_path / 'saved.yaml'
    save_with(saved, load([base]), safe__policy='latest')
    loaded = {'guard.rate_hz': 100.0}
    save(saved, 'robot', loaded, {'guard.rate_hz': 30.0}, complete=False)
    again = live_values(load([base, saved]))
    assert (again['guard.rate_hz'], again['safe.policy']) == (30.0, 'latest')
    assert save(saved, 'robot', loaded, {'guard.rate_hz': 40.0}) == {'guard.rate_hz': 40.0}


def test_a_file_of_somebody_else_is_not_overwritten(base: Path) -> None:
    with pytest.raises(ConfigError, match=r'robot\.yaml is not a file of saved parameters, and is '
                                          'not overwritten: give another file'):
        save_with(base, load([base]), guard__rate_hz=30.0)
    assert base.read_text() == BASE


def test_what_cannot_be_written_is_told_and_leaves_nothing(base: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'folder'
    for path in (base / 'saved.yaml', folder):
        folder.mkdir(exist_ok=True)
        with pytest.raises(ConfigError, match=f'{path} cannot be written: .*: give a file in a '
                                              'writable folder'):
            save_with(path, load([base]), guard__rate_hz=30.0)
    assert sorted(p.name for p in tmp_path.iterdir()) == ['folder', 'robot.yaml']


def test_a_disk_that_is_full_leaves_the_file_as_it_was(
        base: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    saved = tmp_path / 'saved.yaml'
    save_with(saved, load([base]), guard__rate_hz=30.0)
    before = saved.read_text()

    def full(fd: int) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr('os.fsync', full)
    with pytest.raises(ConfigError, match='No space left'):
        save_with(saved, load([base]), guard__rate_hz=40.0)
    assert saved.read_text() == before
    assert len(list(tmp_path.iterdir())) == 2


def test_where_it_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_HOME', '/somewhere')
    monkeypatch.setenv('HOME', '/my')
    assert saved_path('', 'arm.robot') == Path('/somewhere/arm.robot.saved.yaml')
    assert saved_path('~/it.yaml', 'robot') == Path('/my/it.yaml')
    monkeypatch.delenv('ROS_HOME')
    assert saved_path('', 'robot') == Path('/my/.ros/robot.saved.yaml')


def test_the_file_says_what_it_is(base: Path, tmp_path: Path) -> None:
    save_with(tmp_path / 'saved.yaml', load([base]), guard__rate_hz=30.0)
    assert (tmp_path / 'saved.yaml').read_text() == f"""\
{MARK}
# It comes after the file that it was loaded with:
#   --params-file ... --params-file saved.yaml
/robot:
  ros__parameters:
    guard:
      rate_hz: 30.0
"""


def test_what_a_namesake_has_saved_is_not_overwritten(base: Path, tmp_path: Path) -> None:
    saved, other = tmp_path / 'robot.saved.yaml', tmp_path / 'other.yaml'
    other.write_text(BASE)
    now = {'guard.rate_hz': 30.0}
    assert save(saved, 'robot', {}, now, files=[str(base)]) == now
    text = saved.read_text()
    with pytest.raises(ConfigError, match=f'another robot of this name.* by {base}, and is not '
                       'overwritten: give this robot another name or a parameters_file'):
        save(saved, 'robot', {}, {'guard.rate_hz': 1.0}, files=[str(other)])
    assert saved.read_text() == text
    # The same robot, with what it has saved and one file more.
    assert save(saved, 'robot', {}, {'guard.rate_hz': 2.0},
                files=[str(base), str(other), str(saved)]) == {'guard.rate_hz': 2.0}
    base.unlink()  # that robot is no more
    other.rename(tmp_path / 'moved.yaml')
    assert save(saved, 'robot', {}, {'guard.rate_hz': 3.0}, files=[str(tmp_path / 'moved.yaml')])


def test_a_file_of_one_start_tells_no_robots_apart(tmp_path: Path) -> None:
    saved, temporary = tmp_path / 'robot.saved.yaml', tmp_path / 'launch_params_x1'
    temporary.write_text(BASE)
    save(saved, 'robot', {}, {'guard.rate_hz': 30.0}, files=[str(temporary)])
    save(saved, 'robot', {}, {'guard.rate_hz': 31.0}, files=[str(tmp_path / 'launch_params_y2')])
    assert 'rate_hz: 31.0' in saved.read_text()


def test_a_planted_link_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / 'victim'
    victim.write_text('mine')
    saved = tmp_path / 'robot.saved.yaml'
    (tmp_path / f'.robot.saved.yaml.{os.getpid()}').symlink_to(victim)
    save(saved, 'robot', {}, {'guard.rate_hz': 30.0})
    assert victim.read_text() == 'mine' and not saved.is_symlink()

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

"""Logs of lines: where the wheels were in each kind of CARMEN log; what is wrong with a file."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.base.errors import ConfigError  # noqa: E402
from rt_robot_os.features.mapping.cli.command import run  # noqa: E402
from rt_robot_os.features.mapping.slam.logs import read_log  # noqa: E402
from rt_robot_os.features.mapping.slam.logs import TextLog  # noqa: E402

HEAD = ('# t, odometry x y yaw, reference x y yaw, then 3 ranges in m, first beam at -90.0 deg, '
        'step 90.0 deg\n')


def flaser(x: float, laser_yaw: float = 0.0, robot: str = '') -> str:
    laser = f'{x:.3f} 0 {laser_yaw:g}'
    return f'FLASER 3 1 2 3 {laser} {robot or laser} {x:.2f} host {x:.2f}\n'


def robotlaser(x: float, glare: str = '0') -> str:
    return (f'ROBOTLASER1 0 -1.5 3.0 1.5 20 0.01 0 3 1 2 3 {glare} {x + 0.2:.3f} 0 0.1 {x:.3f} 0 '
            f'0.1 0.3 0 0.1 0.1 0.1 {x:.2f} host {x:.2f}\n')


def written(folder: Path, text: str) -> Path:
    path = folder / 'log.clf'
    path.write_text(text)
    return path


def test_a_corrected_log_gives_the_steps_of_the_wheels_not_the_corrected_poses(
        tmp_path: Path) -> None:
    """Wheels say 1 m a step; the mapper who corrected it says 1.1 m."""
    text = ''
    for step in range(10):
        corrected = 1.1 * step
        text += flaser(corrected) + f'ODOM {corrected:.3f} 0 0 0 0 0 0 host 0\n'
        text += ''.join(f'ODOM {corrected + part:.3f} 0 0 0 0 0 9 host 9\n' for part in (0.5, 1.0))
    log = TextLog(written(tmp_path, text))
    scans = list(log.scans())
    assert [scan.odometry[0] for scan in scans] == pytest.approx(np.arange(10.0), abs=1e-6)
    assert log.reference is not None
    assert log.reference[:, 0] == pytest.approx(1.1 * np.arange(10))


def test_a_corrected_log_without_wheels_is_refused(tmp_path: Path) -> None:
    text = ''.join(flaser(step) + f'ODOM {step:.3f} 0 0 0 0 0 {step} host {step}\n'
                   for step in range(10))
    with pytest.raises(ConfigError, match='no odometry in it: its lines of odometry repeat'):
        read_log(written(tmp_path, text))


def test_a_raw_log_gives_the_pose_of_the_laser_also_where_it_is_not_in_the_middle(
        tmp_path: Path) -> None:
    text = ''.join(f'ODOM {step} 0 0 0 0 0 {step} host {step}\n'
                   + flaser(step + 0.3, robot=f'{step} 0 0') for step in range(10))
    log = read_log(written(tmp_path, text))
    assert [scan.odometry[0] for scan in log.scans] == pytest.approx(np.arange(10) + 0.3)
    assert log.reference is None


def test_a_log_with_both_poses_in_a_line_gives_the_second(tmp_path: Path) -> None:
    text = ''.join(flaser(1.1 * step, robot=f'{step} 0 0') for step in range(10))
    log = read_log(written(tmp_path, text))
    assert [scan.odometry[0] for scan in log.scans] == pytest.approx(np.arange(10.0))
    assert log.reference is not None and log.reference[-1, 0] == pytest.approx(9.9)


def test_lines_of_newer_logs_say_their_angles_and_may_say_how_bright_ranges_were(
        tmp_path: Path) -> None:
    text = robotlaser(0.0) + robotlaser(1.0, '3 7 8 9') + flaser(2.0) + 'ROBOTLASER1 0 1\n'
    log = TextLog(written(tmp_path, text))
    scans = list(log.scans())
    assert [scan.odometry.tolist() for scan in scans] == [[0.2, 0, 0.1], [1.2, 0, 0.1]]
    assert scans[1].ranges.tolist() == [1, 2, 3] and scans[1].stamp_ns == 10 ** 9
    assert (scans[0].angle_min, scans[0].angle_increment) == (-1.5, 1.5)
    assert log.bad == 1
    assert log.problems[0].startswith('1 scans of a second kind of line were skipped')


@pytest.mark.parametrize('text, code, says', [
    ('Dear diary, today I drove.\n', 2, 'no scan in it: neither rows of a CSV with ranges nor'),
    (HEAD, 2, 'no scan in it that could be read'),
    ('0,0,0,0,0,0,0,1,1,1\n', 2, ':1: the first line of a CSV must say what its columns are'),
    (HEAD + '0,0,0,0,0,0,0,1,1\n', 2, 'line 2: 9 values instead of'),
    (HEAD + '0,0,nan,0,0,0,0,1,1,1\n', 2, 'line 2: time and poses must be finite: 0, 0, nan'),
    (HEAD + '1,0,0,0,0,0,0,1,,1\n1,x,0,0,0,0,0,1,1,1\n', 0,
     'skipped: 1; the first is line 3: could not convert'),
    (HEAD + '0,0,0,0,0,0,0,inf,inf,nan\n' * 3, 2, 'none of its 3 scans has a range between'),
    (HEAD + '1,0,0,0,0,0,0,1,1,1\n', 0, '1 scans over 0 m, 1 kept'),
    (HEAD + '1,0,0,0,0,0,0,1,1,1\n0,0,0,0,0,0,0,1,1,1\nx\n', 0,
     '1 scans are stamped earlier than those before them'),
])
def test_logs_of_nothing_are_told(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, code: int, says: str
        ) -> None:
    report = tmp_path / 'report.json'
    assert run(['--bag', str(written(tmp_path, text)), '--report', str(report)]) == code
    said = capsys.readouterr()
    assert says in said.out + said.err
    if not code:
        found = json.loads(report.read_text())
        assert found['scans'] == len(found['poses']) == len(found['stamps_ns'])


@pytest.mark.parametrize('option, name, says', [
    ('--report', 'nowhere/report.json', 'there is no folder'),
    ('--picture', 'nowhere/map.png', 'there is no folder'),
    ('--map', 'map.png', 'name the YAML file, such as'),
])
def test_what_cannot_be_written_is_told_before_the_log_is_mapped(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, name: str, says: str
        ) -> None:
    log = written(tmp_path, HEAD + '1,0,0,0,0,0,0,1,1,1\n')
    assert run(['--bag', str(log), option, str(tmp_path / name)]) == 2
    said = capsys.readouterr()
    assert f'{option} {tmp_path / name}' in said.err and says in said.err and not said.out
    assert list(tmp_path.iterdir()) == [log]


def test_relations_of_a_log_with_lines_left_out_are_not_trusted(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    row = '1,0,0,0,0,0,0,1,1,1\n'
    log = written(tmp_path, HEAD + row + 'x\n' + row)
    relations = tmp_path / 'relations.csv'
    relations.write_text('i,j,dx,dy,dyaw\n0,1,0,0,0\n')
    assert run(['--bag', str(log), '--relations', str(relations)]) == 0
    assert 'they may refer to other scans' in capsys.readouterr().out


def test_a_log_that_is_cut_off_is_read_up_to_there(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(1)
    rows = ''.join(f'{n},{n / 100},0,0,0,0,0,' + ','.join(
        f'{each:.3f}' for each in rng.uniform(1, 2, 3)) + '\n' for n in range(2000))
    packed = gzip.compress((HEAD + rows).encode())
    path = tmp_path / 'log.csv.gz'
    path.write_bytes(packed[:len(packed) // 2])
    log = TextLog(path)
    assert 500 < len(list(log.scans())) < 2000
    assert 'is truncated or damaged: it was read up to that point' in log.problems[0]


def test_a_carmen_log_that_is_cut_off_before_it_could_be_judged_is_read_up_to_there(
        tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    text = ''.join(flaser(step, robot=f'{step} 0 {rng.random():.6f}') for step in range(150))
    packed = gzip.compress(text.encode())
    path = tmp_path / 'log.clf.gz'
    path.write_bytes(packed[:len(packed) // 2])
    log = TextLog(path)
    assert 20 < len(list(log.scans())) < 150
    assert 'is truncated or damaged: it was read up to that point' in log.problems[0]


def test_options_of_bags_are_refused_for_a_log(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, HEAD + '1,0,0,0,0,0,0,1,1,1\n')
    assert run(['--bag', str(path), '--scan-topic', '/scan']) == 2
    assert '--scan-topic: ' in capsys.readouterr().err

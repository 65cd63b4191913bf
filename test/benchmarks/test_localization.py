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

"""The case localization: recordings that a user brings, and what is made of them."""

from __future__ import annotations

import gzip
import json
import math
from pathlib import Path

from benchmarks.localization import subjects as subject
from benchmarks.localization.case import CASE
from benchmarks.localization.plant import DT_S
from benchmarks.localization.plant import eight
from benchmarks.localization.plant import Robot
from benchmarks.localization.recording import expected
from benchmarks.localization.recording import read
from benchmarks.localization.recording import RecordingError
from benchmarks.localization.replay import replay
from benchmarks.localization.simulation import rms
import numpy as np
import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.command import run
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.options import parse
from rt_robot_os.tools.bench.registry import CASES
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

ODOM = '0.0,odom,0,0,0,1,0,0,0,0.001,0.01\n'


@pytest.fixture
def jackal(data_dir: Path) -> Path:
    path = data_dir / 'localization' / 'jackal.csv.gz'
    if not path.is_file():
        pytest.skip(f'no recording {path}')
    return path


def test_the_mounting_of_the_sensor_is_taken_from_the_command_line(
        capsys: pytest.CaptureFixture[str]) -> None:
    given = parse(['localization', '--data', __file__, '--imu-mounting', '3.14,0,-0.5'], CASES)
    assert given.options.imu_mounting == (3.14, 0.0, -0.5)
    for wrong in ('3.14', '3.14,0', 'a,b,c', 'nan,0,0', '0,0,7'):
        with pytest.raises(SystemExit):
            parse(['localization', '--data', __file__, '--imu-mounting', wrong], CASES)
        assert f"'{wrong}' is not three angles in rad" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        parse(['localization', '--imu-mounting', '0,0,0'], CASES)
    assert 'name it with --data FILE' in capsys.readouterr().err


def test_gravity_that_is_not_where_it_should_be_misses_an_aim(tmp_path: Path) -> None:
    path = tmp_path / 'drive.csv'
    path.write_text(''.join(
        f'{step / 50},odom,0,0,0,1,0,0,0,0.001,0.01\n{step / 50},imu,0,0,0,0,0,0,0,0,0,-9.81\n'
        for step in range(200)))
    for mounting, off_deg in (((0.0, 0.0, 0.0), 180.0), ((math.pi, 0.0, 0.0), 0.0)):
        found = subject.recorded(Harness({'data': str(path), 'expected': '',
                                          'imu_mounting': mounting}, -2, 0, tmp_path))
        assert found.figures['gyro_gravity_off_deg'] == pytest.approx(off_deg, abs=0.1)


def test_the_drive_of_a_jackal_ends_where_robot_localization_does(jackal: Path) -> None:
    drive = replay(read(jackal))
    x, y, _ = drive.poses[-1]
    ends = expected(jackal, None)
    assert math.dist((x, y), ends['ekf']) < 0.10
    assert math.dist((x, y), ends['ukf']) < 0.10
    # The wheels alone do not: it is the filter that does.
    assert math.dist(drive.odometry[-1][:2], ends['ekf']) > 10.0
    assert len(drive.poses) == 3060
    for counter in ('odom_jumps', 'odom_not_finite', 'odom_backwards', 'odom_restarts'):
        assert drive.statistics[counter] == 0


@pytest.mark.parametrize('shift_s', [-1e4, 1.8e9])
def test_the_numbers_of_the_lines_may_be_those_of_any_clock(jackal: Path, shift_s: float) -> None:
    lines = read(jackal)[:2000]
    ends = [replay([type(line)(line.time_s + by, line.kind, line.values) for line in lines])
            .poses[-1] for by in (0.0, shift_s)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-3)


def own_recording(path: Path, seconds: float = 20.0) -> Path:
    """Write a drive with false marks and the truth, as a user would, without a gyroscope."""
    robot = Robot(eight, pose=(2.0, 1.0, 0.5), right_error=0.01)
    lines = ['# made by a test', '']
    wheels = Robot(eight, right_error=0.0)
    for index in range(round(seconds / DT_S)):
        robot.step()
        wheels.step()
        x, y, heading = wheels.pose
        time_s = index * DT_S
        lines.append(f'{time_s},odom,{x},{y},{math.sin(heading / 2)},{math.cos(heading / 2)},'
                     '0.3,0,0.1,0.0001,0.0001')
        if index % 5 == 0:
            x, y, heading = robot.misled() if robot.chance(0.1) else robot.seen(0.01, 0.02)
            lines.append(f'{time_s - 0.005},fix,{x},{y},{heading},0.0001,0.0001,0.0004')
        x, y, heading = robot.pose
        lines.append(f'{time_s},truth,{x},{y},{heading}')
    path.write_text('\n'.join(lines) + '\n')
    return path


def test_a_recording_of_ones_own_with_marks_and_truth(tmp_path: Path) -> None:
    path = own_recording(tmp_path / 'drive.csv')
    drive = replay(read(path))
    away, turned = drive.errors()
    assert len(away) > 900
    assert rms(away) < 0.02
    assert math.degrees(rms(turned)) < 2.0
    assert drive.statistics['rejected'] > 5
    assert expected(path, None) == {}


@pytest.mark.parametrize(('text', 'says'), [
    ('', 'has no two lines of odom'),
    (ODOM, 'has no two lines of odom'),
    (ODOM + '0.1,sonar,1\n', r":2: kind 'sonar'; there are odom, imu, fix, truth"),
    (ODOM + '0.1\n', r":2: kind ''"),
    (ODOM + '0.1,odom,1,2\n', ':2: odom has 2 numbers, not 9'),
    (ODOM + 'now,truth,1,2,3\n', ':2: could not convert'),
    (ODOM + '0.1,truth,1,two,3\n', ':2: could not convert'),
    (ODOM + 'nan,truth,1,2,3\n', ':2: the time'),
    (ODOM + '1e300,truth,1,2,3\n', ':2: the time')])
def test_a_recording_that_is_none_is_told_with_its_line(text: str, says: str, tmp_path: Path
                                                        ) -> None:
    path = tmp_path / 'drive.csv'
    path.write_text(text)
    with pytest.raises(RecordingError, match=says):
        read(path)


@pytest.mark.parametrize('content', [bytes(range(256)), gzip.compress(b'x' * 1000, mtime=0)[:-9],
                                     gzip.compress(bytes(range(256)))])
def test_a_file_that_is_no_text_is_told(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / 'drive.csv.gz'
    path.write_bytes(content)
    with pytest.raises(RecordingError):
        read(path)


def test_a_file_of_another_system_is_read(tmp_path: Path) -> None:
    path = tmp_path / 'drive.csv'
    path.write_bytes(b'\xef\xbb\xbf# made elsewhere\r\n'
                     + 2 * b' 0.5, odom, 1,0,0,1,0,0,0,0,0\r\n')
    assert [line.kind for line in read(path)] == ['odom', 'odom']


def test_numbers_of_a_recording_that_are_none_harm_nothing(tmp_path: Path) -> None:
    path = own_recording(tmp_path / 'drive.csv', 5.0)
    lines = path.read_text().splitlines()
    for index in range(500, 520):
        time, kind, *values = lines[index].split(',')
        if kind != 'truth':
            lines[index] = ','.join((time, kind, *('nan' for _ in values)))
    path.write_text('\n'.join(lines))
    drive = replay(read(path))
    assert drive.statistics['odom_not_finite'] > 5
    assert rms(drive.errors()[0]) < 0.05


@pytest.mark.parametrize('content', ['', '[]', '{}', '{"ekf_final": 3}', '{"ekf_final": [1]}',
                                     '{"ekf_final": ["a", "b"]}'])
def test_expectations_that_are_none_are_told(content: str, tmp_path: Path) -> None:
    path = tmp_path / 'drive.expected.json'
    path.write_text(content)
    with pytest.raises(RecordingError, match='drive.expected.json'):
        expected(tmp_path / 'drive.csv.gz', None)


# ---- the case --------------------------------------------------------------------------------


def measured(key: str, options: BenchOptions, tmp_path: Path, **changes: int
             ) -> tuple[Outcomes, RunOutcome]:
    runs = CASE.plan(options)
    one = next(each for each in runs if each.key == key)
    harness = Harness({**one.arguments, **changes}, -2, 0, tmp_path)
    found = getattr(subject, one.subject.partition(':')[2])(harness)
    outcomes = Outcomes(runs)
    outcome = RunOutcome(RunStatus.OK, '', found.samples, found.figures)
    outcomes.add(key, outcome)
    return outcomes, outcome


def test_a_recording_beside_its_expectation_is_a_verdict(tmp_path: Path) -> None:
    path = own_recording(tmp_path / 'drive.csv', 5.0)
    options = BenchOptions(0.1, 1, quick=True, data=str(path))
    x, y, _ = replay(read(path)).poses[-1]
    for off, verdict in ((0.05, TargetVerdict.REACHED), (0.5, TargetVerdict.MISSED)):
        (tmp_path / 'drive.expected.json').write_text(json.dumps({'ekf_final': [x + off, y]}))
        outcomes, _ = measured('recording', options, tmp_path)
        result = CASE.evaluate(options, outcomes)
        target = result.targets[-1]
        assert target.verdict is verdict
        assert target.measured is not None
        assert target.measured.median == pytest.approx(off)
        table = result.tables[0]
        assert [row.label for row in table.rows] == [
            'rt_robot_os, module localization', 'wheel odometry alone', 'expected: ekf']
        rms_m = table.rows[0].metrics['rms']
        assert rms_m is not None and rms_m.median < 0.05
        assert [plot.name for plot in result.plots] == ['recording']
    json.dumps(result.as_json(), allow_nan=False)


def test_the_aims_of_a_simulated_drive_are_reached(tmp_path: Path) -> None:
    options = BenchOptions(0.1, 1, quick=True)
    outcomes, outcome = measured('simulation', options, tmp_path, seeds=1)
    assert np.all(outcome.samples['kidnapped found_ms'] < 5000)
    result = CASE.evaluate(options, outcomes)
    known = {each.text: each.verdict for each in result.targets
             if each.verdict is not TargetVerdict.UNKNOWN}
    assert len(known) == 9
    assert set(known.values()) == {TargetVerdict.REACHED}
    assert [plot.name for plot in result.plots] == ['way', 'errors']


def test_without_a_recording_the_case_says_nothing_of_one() -> None:
    options = BenchOptions(0.1, 1)
    result = CASE.evaluate(options, Outcomes(CASE.plan(options)))
    assert [table.title for table in result.tables] == ['simulation', 'time of a step']
    assert all(target.verdict is TargetVerdict.UNKNOWN for target in result.targets)


@pytest.mark.parametrize(('arguments', 'says'), [
    (['--data', 'FILE'], 'name the case that reads it'),
    (['micro', '--data', 'FILE'], 'name the case that reads it'),
    (['localization', '--data', 'missing.csv'], 'cannot be read: No such file'),
    (['localization', '--data', '.'], 'cannot be read: Is a directory'),
    (['localization', '--expected', 'FILE'], 'of which recording'),
    (['localization', '--data', 'FILE', '--expected', 'missing.json'], 'cannot be read'),
    (['--page', '.', '--data', 'FILE'], 'cannot go with --data')])
def test_a_recording_that_nobody_reads_is_refused(
        arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
        ) -> None:
    (tmp_path / 'drive.csv').write_text(ODOM)
    given = [str(tmp_path / 'drive.csv') if each == 'FILE' else each for each in arguments]
    with pytest.raises(SystemExit) as ended:
        run(given)
    assert ended.value.code == 2
    assert says in capsys.readouterr().err

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

"""Real measurements, as short as can be, in real child processes; no figure is judged."""

from __future__ import annotations

from dataclasses import replace
import importlib.util
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import numpy as np
from processes import has_ended
from processes import wait_until
import pytest

from rt_robot_os.tools.bench import processes
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.helper import load_function
from rt_robot_os.tools.bench.processes import alone
from rt_robot_os.tools.bench.processes import free_domain
from rt_robot_os.tools.bench.processes import measure
from rt_robot_os.tools.bench.registry import CASES
from rt_robot_os.tools.bench.result import RunStatus

ROOT = Path(__file__).resolve().parents[3]
HAS_ROS = importlib.util.find_spec('rclpy') is not None
needs_ros = pytest.mark.skipif(not HAS_ROS, reason='ROS 2 (rclpy) is not installed')


@pytest.fixture(autouse=True)
def own_surroundings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Let children find the package where the tests do, and wait for no other bench."""
    monkeypatch.setattr(processes, 'lock_path', lambda: tmp_path / 'lock')
    paths = [str(ROOT), str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')]
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(path for path in paths if path))


def _gentle(one: Run, **arguments: object) -> Run:
    """Measure without real time, so that a test disturbs nobody."""
    return replace(one, cpu=UNPINNED, priority=0, arguments={**one.arguments, **arguments})


def _first(name: str, key: str) -> Run:
    return next(one for one in CASES[name].plan(BenchOptions(0.1, 1)) if one.key == key)


@pytest.mark.parametrize('name', sorted(CASES))
def test_every_worker_that_a_case_names_exists(name: str) -> None:
    for one in CASES[name].plan(BenchOptions(1.0, 1, full=True)):
        if HAS_ROS or '.peers.' not in one.subject:
            assert callable(load_function(one.subject))


@pytest.mark.parametrize('key', ['kernel', 'floor none', 'floor same'])
def test_the_samples_of_the_preemption_case_can_be_evaluated(key: str) -> None:
    outcome = measure(_gentle(_first('preemption', key), warmup_ns=20_000_000))
    assert outcome.status is RunStatus.OK, outcome.reason
    assert outcome.figures['measure_ns'] == 100_000_000
    starts = outcome.samples['starts']
    assert len(starts) > 1
    assert np.all(np.diff(starts) > 0)


@needs_ros
def test_rclpy_is_measured_in_a_domain_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', '0')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    environment = processes.environment(Path('folder'))
    assert 1 <= int(environment['ROS_DOMAIN_ID']) <= 101
    assert environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    outcome = measure(_gentle(_first('preemption', 'events'), warmup_ns=20_000_000))
    assert outcome.status is RunStatus.OK, outcome.reason
    assert len(outcome.samples['starts']) > 1


def test_a_peer_that_is_not_installed_is_missing_and_no_failure(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'rclpy.py').write_text('raise ModuleNotFoundError("no rclpy", name="rclpy")\n')
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}{os.pathsep}{os.environ["PYTHONPATH"]}')
    outcome = measure(_gentle(_first('preemption', 'single')))
    assert outcome.status is RunStatus.MISSING
    assert 'rclpy is not installed' in outcome.reason


def test_a_program_that_is_not_installed_is_missing_with_its_remedy(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'without.py').write_text(
        'from rt_robot_os.tools.bench.cases.wakeup import subjects as wakeup\n\n\n'
        'def work(harness):\n'
        '    wakeup._PATH = "/nowhere"\n    return wakeup.cyclictest(harness)\n')
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}{os.pathsep}{os.environ["PYTHONPATH"]}')
    outcome = measure(replace(_gentle(_first('wakeup', 'cyclictest')), subject='without:work'))
    assert outcome.status is RunStatus.MISSING
    assert outcome.reason == 'cyclictest is not installed (remedy: apt-get install rt-tests)'


def test_an_older_peer_is_missing_and_told_apart_from_one_that_is_not_installed(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'horus.py').write_text('')
    (tmp_path / 'older.py').write_text('def work(harness):\n    from horus import Node\n')
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}{os.pathsep}{os.environ["PYTHONPATH"]}')
    outcome = measure(Run('x', 'x', 'older:work', {}, 1.0))
    assert outcome.status is RunStatus.MISSING
    assert outcome.reason.startswith('this version of horus has not got it')


@pytest.mark.parametrize('name, key', [
    ('frequency', 'monotonic'), ('frequency', 'threads'), ('wakeup', 'floor'),
    ('kernel', 'abort'), ('kernel', 'own'), ('throughput', 'rings'),
    ('overload', 'kernel'), ('overload', 'threads')])
def test_short_real_runs_can_be_evaluated(name: str, key: str) -> None:
    options = BenchOptions(0.1, 1, quick=True)
    runs = CASES[name].plan(options)
    outcomes = Outcomes(runs)
    for one in runs:
        outcomes.add(one.key, measure(_gentle(one, warmup_ns=20_000_000)) if one.key == key
                     else RunOutcome(RunStatus.MISSING, 'left out'))
    assert outcomes.all(key)[0].status is RunStatus.OK, outcomes.all(key)[0].reason
    result = CASES[name].evaluate(options, outcomes)
    measured = [row for table in result.tables for row in table.rows
                if row.status is RunStatus.OK and not row.published]
    assert measured
    assert any(metric is not None for row in measured for metric in row.metrics.values())


def test_a_worker_that_does_not_exist_has_failed_and_says_so() -> None:
    outcome = measure(Run('x', 'x', 'rt_robot_os.tools.bench.cases.none:nothing', {}, 1.0))
    assert outcome.status is RunStatus.FAILED
    assert 'rt_robot_os.tools.bench.cases.none' in outcome.reason


def test_a_child_that_crashes_gives_its_code_and_its_last_words(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'crashing.py').write_text(
        'import os\n\ndef work(harness):\n    print("last words", flush=True)\n    os.abort()\n')
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}{os.pathsep}{os.environ["PYTHONPATH"]}')
    outcome = measure(Run('x', 'x', 'crashing:work', {}, 1.0))
    assert outcome == RunOutcome(RunStatus.FAILED, 'ended with code -6: last words')


def test_a_child_that_hangs_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'hanging.py').write_text(
        'import signal\nimport time\n\ndef work(harness):\n'
        '    signal.signal(signal.SIGTERM, signal.SIG_IGN)\n'
        '    while True:\n        time.sleep(1)\n')
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}{os.pathsep}{os.environ["PYTHONPATH"]}')
    monkeypatch.setattr(processes, '_PATIENCE_S', 0.5)
    monkeypatch.setattr(processes, '_LOOK_S', 0.1)
    monkeypatch.setattr(processes, '_END_S', 0.1)
    outcome = measure(Run('x', 'x', 'hanging:work', {}, 0.5))
    assert outcome.status is RunStatus.FAILED
    assert 'did not end within 1 s' in outcome.reason


def test_a_domain_with_files_of_others_is_avoided(tmp_path: Path) -> None:
    for domain in range(1, 102):
        if domain != 77:
            (tmp_path / f'fastrtps_port{7400 + 250 * domain + 11}').touch()
    (tmp_path / 'sem.fastrtps_port7002_mutex').touch()
    assert {free_domain(tmp_path) for _ in range(5)} == {77}
    (tmp_path / f'fastrtps_port{7400 + 250 * 77 + 13}_el').touch()
    assert 1 <= free_domain(tmp_path) <= 101


def _descendants(pid: int) -> list[int]:
    children = Path(f'/proc/{pid}/task/{pid}/children')
    try:
        own = [int(word) for word in children.read_text().split()]
    except OSError:
        return []
    return own + [below for child in own for below in _descendants(child)]


def test_two_that_measure_take_turns(tmp_path: Path) -> None:
    path = tmp_path / 'lock'
    with alone(path):
        with alone(path, wait=False) as others:
            assert others
    with alone(path, wait=False) as others:
        assert not others


def test_without_the_lock_file_nobody_waits(tmp_path: Path) -> None:
    (tmp_path / 'link').symlink_to(tmp_path / 'elsewhere')
    with alone(tmp_path / 'link') as others:
        assert not others
    assert not (tmp_path / 'elsewhere').exists()


def test_ctrl_c_leaves_no_process(tmp_path: Path) -> None:
    program = subprocess.Popen(
        [sys.executable, '-c', 'import sys; from rt_robot_os.tools.bench.program import main; '
         'sys.exit(main())', 'preemption', '--seconds', '60', '--repeats', '1'],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env={**os.environ, 'TMPDIR': str(tmp_path)})
    assert program.stdout is not None
    with program.stdout:
        for line in program.stdout:
            if line.startswith(('In force', 'SCHED_FIFO')):
                break
        below: list[int] = []
        while not below and program.poll() is None:
            below = _descendants(program.pid)
            time.sleep(0.01)
        program.send_signal(signal.SIGINT)
        said = program.stdout.read()
        assert program.wait(60) == 130, said
    assert 'interrupted' in said
    assert below
    for pid in below:  # whose parent ended may live for a moment longer
        wait_until(lambda: has_ended(pid), f'the end of process {pid}')

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

"""Isolate the tests from other ROS graphs, find the recorded data, tell what was skipped."""

from __future__ import annotations

from collections import Counter
import os
from pathlib import Path
import random
import shutil
import signal
import sys
import tempfile
from typing import Iterator

import pytest

from rt_robot_os.base.compiled import PACKAGE
from rt_robot_os.base.compiled import state

ROOT = Path(__file__).resolve().parents[1]
# What tests of several folders use.
sys.path.insert(0, str(ROOT / 'test' / 'shared'))

import background  # noqa: E402, I100

# So many tests take longer than all linters.
MANY = 2000
# What the C core holds and what is made of it, and how it looks from outside.
BOTH_BUILDS = tuple(ROOT / 'test' / name for name in (
    'core', 'e2e', 'golden/test_golden_names.py', 'golden/test_golden_recordings.py', 'kernel',
    'link', 'linux/test_timer.py', 'settings/test_settings_against_kernel.py', 'topics'))

# Read when rclpy makes its first context, so it is set before any test module is imported.
# Processes of one run (pytest-xdist) have neighbouring domains, so that no two have the same.
if 'PYTEST_XDIST_WORKER' in os.environ:
    number = int(os.environ['PYTEST_XDIST_WORKER'].removeprefix('gw')) + 1
    os.environ['ROS_DOMAIN_ID'] = str((int(os.environ['ROS_DOMAIN_ID']) + number) % 101 + 1)
else:
    os.environ['ROS_DOMAIN_ID'] = str(random.SystemRandom().randint(1, 101))
# Over loopback alone, which the profile says. LOCALHOST would add shared memory, whatever Fast DDS
# is told: who shares it with a process that was killed crashes at times in its own end (once in
# 150 rounds with rclpy alone, never in 600 over loopback), and killed processes leave files there.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'SYSTEM_DEFAULT'
os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(ROOT / 'test' / 'shared' / 'loopback.xml')
# Hundreds of processes are started here, and compiling the package anew is a third of their time.
COMPILED = ''
if sys.dont_write_bytecode and 'PYTHONPYCACHEPREFIX' not in os.environ:
    os.environ.pop('PYTHONDONTWRITEBYTECODE', None)
    os.environ['PYTHONPYCACHEPREFIX'] = COMPILED = tempfile.mkdtemp(prefix='rt_robot_os_pyc_')
# A shell that starts the tests in the background has Ctrl-C ignored, which children inherit: those
# that are to be interrupted would run on.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

try:
    from hypothesis import HealthCheck
    from hypothesis import settings as hypothesis_settings
except ImportError:
    pass
else:
    # No deadline: no test may fail because the machine was busy. CI takes the same examples each
    # time; who develops takes others, and more.
    in_ci = 'CI' in os.environ
    hypothesis_settings.register_profile(
        'package', deadline=None, print_blob=True, derandomize=in_ci, database=None,
        max_examples=30 if in_ci else 50,
        suppress_health_check=[HealthCheck.too_slow])
    hypothesis_settings.load_profile('package')


def pytest_configure(config: pytest.Config) -> None:
    """Let processes of one run take the files in the order of the collection, see below."""
    if hasattr(config.option, 'loadscopereorder'):
        config.option.loadscopereorder = False


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Read nothing else for the tests of both builds: it takes each process long."""
    if config.option.markexpr != 'both_builds' or any(
            place == collection_path or place in collection_path.parents
            or collection_path in place.parents for place in BOTH_BUILDS):
        return None
    return True


def pytest_report_header() -> str:
    """Say which build is tested."""
    return f'{PACKAGE}: {state().text}'


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is tested on both builds, and let what reads the whole package begin."""
    for item in items:
        if not {item.path, *item.path.parents}.isdisjoint(BOTH_BUILDS):
            item.add_marker('both_builds')
        if state().compiled and item.get_closest_marker('interpreted'):
            item.add_marker(pytest.mark.skip(
                reason='only the interpreter shows it, and this is the compiled build'))
    items.sort(key=lambda item: item.get_closest_marker('linter') is None)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Let what reads the whole package begin, where other tests take longer than that."""
    alone = 'PYTEST_XDIST_WORKER' not in os.environ
    if alone and len(session.items) > MANY and any(
            item.get_closest_marker('linter') for item in session.items):
        background.begin()


def pytest_unconfigure() -> None:
    """End what runs beside the tests, and remove what the children have compiled."""
    background.end()
    if COMPILED:
        shutil.rmtree(COMPILED, ignore_errors=True)


@pytest.fixture(scope='session', autouse=True)
def ros_log_directory() -> Iterator[Path]:
    """Keep the log files of ROS nodes out of the user's home."""
    path = Path(tempfile.mkdtemp(prefix='rt_robot_os_log_'))
    before = os.environ.get('ROS_LOG_DIR')
    os.environ['ROS_LOG_DIR'] = str(path)
    yield path
    if before is None:
        del os.environ['ROS_LOG_DIR']
    else:
        os.environ['ROS_LOG_DIR'] = before
    shutil.rmtree(path, ignore_errors=True)


@pytest.fixture(autouse=True)
def ctrl_c() -> Iterator[None]:
    """Give Ctrl-C back its meaning: a program that has run here left it to end the process."""
    yield
    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope='session')
def data_dir() -> Path:
    """Return the folder of recorded device data, or skip the test."""
    path = Path(os.environ.get('RT_ROBOT_OS_DATA') or ROOT.parent / 'shared' / 'data')
    if not path.is_dir():
        pytest.skip(f'no recorded data at {path} (set RT_ROBOT_OS_DATA)')
    return path


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Tell, in a line for each reason, what was skipped."""
    reasons: Counter[str] = Counter()
    for report in terminalreporter.stats.get('skipped', []):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        reasons[str(reason).removeprefix('Skipped: ')] += 1
    if not reasons:
        terminalreporter.write_line('skipped: nothing')
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f'skipped: {count} x {reason}')


@pytest.fixture
def untraced() -> Iterator[None]:
    """Give a debugger or a coverage tool its trace function back."""
    before = sys.gettrace()
    yield
    sys.settrace(before)

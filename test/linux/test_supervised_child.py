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

"""A child that ends is started again after a pause that grows, and that is reported."""

import subprocess

import pytest

from rt_robot_os.linux.supervised_child import SupervisedChild


class Process:
    """A process that ends on request."""

    code: int | None = None

    def poll(self) -> int | None:
        return self.code


class Bench:
    """A supervised child with a clock, and what it reported."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.error: OSError | None = None
        self.made: list[Process] = []
        self.child = SupervisedChild('the helper', self.start, lambda: self.now_s)

    def start(self) -> subprocess.Popen[bytes]:
        if self.error is not None:
            raise self.error
        self.made.append(Process())
        return self.made[-1]  # type: ignore[return-value]

    def after(self, duration_s: float) -> str:
        self.now_s += duration_s
        return self.child.check()


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    made.child.start()
    return made


def test_a_child_that_runs_is_left_alone(bench: Bench) -> None:
    assert [bench.after(1.0) for _ in range(3)] == ['', '', '']
    assert (len(bench.made), bench.child.restarts) == (1, 0)


def test_a_child_that_is_killed_is_started_again_after_a_pause(bench: Bench) -> None:
    bench.made[-1].code = -9
    assert bench.after(1.0) == 'the helper was ended by SIGKILL; it is started again in 0.2 s'
    assert bench.after(0.1) == ''
    assert len(bench.made) == 1
    assert bench.after(0.2) == 'the helper was started again (restart 1)'
    assert len(bench.made) == 2
    assert bench.after(1.0) == ''


def test_the_pause_grows_to_a_limit_and_shrinks_after_a_long_life(bench: Bench) -> None:
    pauses = []
    for _ in range(7):
        bench.made[-1].code = 1
        pauses.append(float(bench.after(1.0).split()[-2]))
        assert 'restart ' in bench.after(pauses[-1] + 0.01)
    assert pauses == [0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]
    bench.made[-1].code = 1
    assert bench.after(11.0) == 'the helper ended with code 1; it is started again in 0.2 s'


def test_a_child_that_cannot_be_started_is_tried_again(bench: Bench) -> None:
    bench.made[-1].code = 0
    bench.after(0.0)
    bench.error = OSError(24, 'Too many open files')
    assert bench.after(0.3) == ('the helper cannot be started: Too many open files; it is started '
                                'again in 0.4 s')
    bench.error = None
    assert bench.after(0.5) == 'the helper was started again (restart 1)'

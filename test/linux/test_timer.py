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


"""
The timer signals the thread that made it; signals that are held are not lost.

All of it holds with ctypes and with the extension in C, where there is one.
"""

from __future__ import annotations

from collections.abc import Iterator
import signal
import threading
import time

import pytest

from rt_robot_os.linux import timer as timer_module
from rt_robot_os.linux.timer import SignalGate
from rt_robot_os.linux.timer import SignalTimer
from rt_robot_os.linux.timer import Sleeper

SIGNAL = signal.SIGRTMIN + 7
MS = 1_000_000
PATIENCE_NS = 20_000 * MS


@pytest.fixture(autouse=True, params=['ctypes', 'C'])
def build(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == 'ctypes':
        monkeypatch.setattr(timer_module, 'NATIVE', None)
    elif timer_module.NATIVE is None:
        pytest.skip('this is the pure build')


@pytest.fixture
def seen() -> Iterator[list[int]]:
    came: list[int] = []
    before = signal.signal(SIGNAL, lambda signo, frame: came.append(time.monotonic_ns()))
    yield came
    signal.signal(SIGNAL, before)


@pytest.fixture
def timer(seen: list[int]) -> Iterator[SignalTimer]:
    made = SignalTimer(SIGNAL)
    yield made
    made.disarm()
    made.close()
    made.close()


def wait_for(count: int, seen: list[int]) -> None:
    end_ns = time.monotonic_ns() + PATIENCE_NS
    while len(seen) < count and time.monotonic_ns() < end_ns:
        pass
    assert len(seen) >= count


def test_the_signal_comes_at_the_deadline_and_not_before(
        timer: SignalTimer, seen: list[int]) -> None:
    deadline_ns = time.monotonic_ns() + 2 * MS
    timer.arm(deadline_ns)
    wait_for(1, seen)
    assert seen[0] >= deadline_ns


def test_a_deadline_that_has_passed_comes_at_once(timer: SignalTimer, seen: list[int]) -> None:
    timer.arm(1)
    wait_for(1, seen)


def test_a_new_deadline_replaces_the_old_one(timer: SignalTimer, seen: list[int]) -> None:
    timer.arm(time.monotonic_ns() + 5 * MS)
    deadline_ns = time.monotonic_ns() + 30 * MS
    timer.arm(deadline_ns)
    before = len(seen)  # none, unless the machine let the old one pass first
    wait_for(before + 1, seen)
    assert seen[before] >= deadline_ns


def test_the_signal_repeats_until_the_timer_is_armed_again_or_disarmed(
        timer: SignalTimer, seen: list[int]) -> None:
    timer.arm(time.monotonic_ns() + MS)
    wait_for(3, seen)
    timer.disarm()
    count = len(seen)
    time.sleep(0.025)
    assert len(seen) == count


def test_a_deadline_in_146_years_is_no_problem(timer: SignalTimer, seen: list[int]) -> None:
    timer.arm(1 << 62)
    timer.arm(1 << 63)
    assert not seen


def test_masked_signals_stay_pending_and_can_be_awaited(
        timer: SignalTimer, seen: list[int]) -> None:
    gate = SignalGate([SIGNAL])
    gate.mask_signals()
    try:
        timer.arm(time.monotonic_ns() + MS)
        assert gate.wait_masked() == SIGNAL
        assert not seen, 'removed, so the handler is not called'
        timer.arm(1)
        while SIGNAL not in signal.sigpending():
            pass
        assert not seen
    finally:
        gate.unmask_signals()
    wait_for(1, seen)


def test_another_signal_ends_the_waiting(timer: SignalTimer, seen: list[int]) -> None:
    gate = SignalGate([signal.SIGRTMIN + 8])
    gate.mask_signals()
    try:
        timer.arm(time.monotonic_ns() + MS)
        assert gate.wait_masked() == -1
    finally:
        gate.unmask_signals()
    wait_for(1, seen)


class Owner:
    """The owner of a wait."""

    def __init__(self, pending: bool = False) -> None:
        self.pending = pending


class Woken:
    """An owner that receives a signal between the masking and the wait."""

    def __init__(self) -> None:
        self.masks: list[set[int]] = []
        self.returned = threading.Event()
        self.sender = threading.Thread(target=self.send, args=(threading.get_ident(),))

    @property
    def pending(self) -> bool:
        self.masks.append(set(signal.pthread_sigmask(signal.SIG_BLOCK, ())))
        self.sender.start()
        return False

    def send(self, thread: int) -> None:
        signal.pthread_kill(thread, SIGNAL)
        if not self.returned.wait(PATIENCE_NS / 1e9):
            signal.pthread_kill(thread, SIGNAL)  # ends a wait that lost the first one


def test_a_signal_after_the_masking_ends_the_wait_and_signals_are_unmasked(
        seen: list[int]) -> None:
    owner = Woken()
    assert SignalGate([SIGNAL]).wait(owner) == SIGNAL
    owner.returned.set()
    owner.sender.join()
    assert owner.masks == [{SIGNAL}] and not seen
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())
    signal.raise_signal(SIGNAL)
    wait_for(1, seen)


def test_a_wait_with_something_pending_returns_immediately(seen: list[int]) -> None:
    assert SignalGate([SIGNAL]).wait(Owner(pending=True)) == 0
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_handler_that_has_not_run_yet_runs_before_the_wait(seen: list[int]) -> None:
    owner = Owner()

    def note(signo: int, frame: object) -> None:
        owner.pending = True

    signal.signal(SIGNAL, note)
    wait = SignalGate([SIGNAL]).wait
    for _ in range(100):  # signals that arrive as late as possible
        owner.pending = False
        assert [signal.raise_signal(SIGNAL), wait(owner)] == [None, 0]


def test_an_owner_that_fails_leaves_no_signals_masked() -> None:
    gate = SignalGate([SIGNAL])
    with pytest.raises(AttributeError):
        gate.wait(object())  # type: ignore[arg-type]
    gate.unmask_signals()  # what the clock does when it is detached
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_deadline_that_is_none_is_refused(timer: SignalTimer) -> None:
    with pytest.raises(TypeError):
        timer.arm('soon')  # type: ignore[arg-type]


def test_the_sleeper_sleeps_until_its_deadline() -> None:
    deadline_ns = time.monotonic_ns() + 2 * MS
    Sleeper().sleep_until_ns(deadline_ns)
    assert time.monotonic_ns() >= deadline_ns

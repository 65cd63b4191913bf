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

"""Who tells lines waits for nobody, drops what is too much, counts it and says so."""

from __future__ import annotations

from collections.abc import Callable
import os
import threading
import time
from typing import Any

import pytest

from rt_robot_os.ros.console import Pump
from rt_robot_os.ros.console_writer import ConsoleLine
from rt_robot_os.ros.console_writer import ConsoleWriter
from rt_robot_os.ros.console_writer import WAITING_MAXIMUM

TIMEOUT_S = 60.0


def wait_for(condition: Callable[[], Any], what: str) -> None:
    deadline_s = time.monotonic() + TIMEOUT_S
    while not condition():
        if time.monotonic() > deadline_s:
            pytest.fail(f'{what} did not happen')
        time.sleep(0.002)


def line(number: int) -> ConsoleLine:
    return ConsoleLine(20, 0, 'test', f'{number}')


def test_lines_that_nobody_can_tell_are_counted_and_the_rest_comes_in_order() -> None:
    gate = threading.Event()
    told: list[str] = []

    def tell(each: ConsoleLine) -> None:
        gate.wait(TIMEOUT_S)
        told.append(each.text)

    writer = ConsoleWriter(tell, lambda count: ConsoleLine(30, 0, '', f'{count} missing'))
    for number in range(WAITING_MAXIMUM + 500):
        writer.put(line(number))  # does not wait, although nothing is told
    assert not told and writer.untold >= 499
    untold = writer.untold
    gate.set()
    # What is missing may be told in parts: the thread looks before each line.
    wait_for(lambda: missing_of(told) == untold
             and len(numbers_of(told)) == WAITING_MAXIMUM + 500 - untold, 'all lines')
    assert numbers_of(told) == sorted(numbers_of(told))
    assert writer.close()
    assert len(numbers_of(told)) + missing_of(told) == WAITING_MAXIMUM + 500


def numbers_of(told: list[str]) -> list[int]:
    return [int(text) for text in told if text.isdigit()]


def missing_of(told: list[str]) -> int:
    return sum(int(text.split()[0]) for text in told if text.endswith(' missing'))


def test_the_end_does_not_wait_for_a_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('rt_robot_os.ros.console_writer._END_PATIENCE_S', 0.05)
    gate = threading.Event()
    writer = ConsoleWriter(lambda each: gate.wait(TIMEOUT_S), line)
    writer.put(line(1))
    assert not writer.close()
    gate.set()


def test_what_goes_to_a_pipe_that_nobody_reads_makes_nobody_wait() -> None:
    read, write = os.pipe()
    output = os.dup(write)
    pump = Pump([output])
    try:
        written = 0
        text = b'x' * 999 + b'\n'
        while not pump.dropped:  # far more than the pipe and what is kept
            try:
                written += os.write(output, text)
            except BlockingIOError:
                time.sleep(0.001)
        assert written > 1 << 20
        pump.close(time.monotonic())  # in no time, although nobody reads
        os.write(output, text)  # and nothing later waits either
    finally:
        os.set_blocking(read, False)
        while True:  # let its thread go
            try:
                if not os.read(read, 1 << 16):
                    break
            except BlockingIOError:
                if pump._empty():
                    break
                time.sleep(0.001)
        for fd in (read, write, output):
            os.close(fd)


def test_what_is_read_comes_whole_and_the_end_waits_for_it() -> None:
    read, write = os.pipe()
    output = os.dup(write)
    pump = Pump([output])
    found: list[bytes] = []
    reader = threading.Thread(target=lambda: [found.append(d) for d in iter(
        lambda: os.read(read, 4096), b'')], daemon=True)
    for number in range(100):
        os.write(output, b'line %d\n' % number)
    reader.start()
    pump.close(time.monotonic() + TIMEOUT_S)
    os.write(output, b'directly\n')
    for fd in (output, write, pump.real):
        os.close(fd)
    reader.join(TIMEOUT_S)
    os.close(read)
    assert b''.join(found) == b''.join(b'line %d\n' % n for n in range(100)) + b'directly\n'
    assert pump.dropped == 0


def test_what_is_on_its_way_at_the_end_is_written_before_what_comes_directly(
        monkeypatch: pytest.MonkeyPatch) -> None:
    original = os.read
    sources: list[int] = []

    def slow(fd: int, count: int) -> bytes:
        data = original(fd, count)
        if fd in sources:
            time.sleep(0.05)  # between the pipe and what waits
        return data

    monkeypatch.setattr(os, 'read', slow)
    read, write = os.pipe()
    output = os.dup(write)
    pump = Pump([output])
    sources.append(pump._source)
    os.write(output, b'line\n')
    pump.close(time.monotonic() + TIMEOUT_S)
    os.write(output, b'directly\n')
    found = b''
    while found.count(b'\n') < 2:
        found += original(read, 4096)
    for fd in (output, write, pump.real, read):
        os.close(fd)
    assert found == b'line\ndirectly\n'

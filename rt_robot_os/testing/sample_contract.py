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

"""The contract of a serial driver for valid and unusual frames; a part of DriverContract."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import random
import select
import sys
import time
from types import FrameType
from typing import Any
from typing import ClassVar
from typing import Final

import numpy as np
import pytest
from rt_robot_os.testing.decoder_contract import DecoderContract
from rt_robot_os.testing.fakes import bind
from rt_robot_os.testing.fakes import opened
from rt_robot_os.testing.fakes import read_all
from rt_robot_os.testing.fakes import RecordingPublisher
from rt_robot_os.testing.fakes import scripted_settings
from rt_robot_os.testing.fakes import ScriptedPort
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.not_finite import not_finite

# Fields whose sign must be tested.
_AXES: Final = ('x', 'y', 'z', 'latitude', 'longitude')
_FLOATS: Final[dict[str, Any]] = {'float': np.dtype('<f4'), 'double': np.dtype('<f8')}
_SLEEPING: Final = (time.sleep, select.select)
_SLEEPING_NAMES: Final = {'poll': 'select', 'acquire': '_thread', 'wait': '_thread'}
_START_NS: Final = 1_000_000_000
_STEP_NS: Final = 1_000_000_000
_MOST_CUTS: Final = 200

Numbers = dict[str, 'np.ndarray[Any, Any]']


class SampleContract(DecoderContract):
    """
    The part of :class:`DriverContract` about the samples of a frame.

    :cvar driver: the class under test.
    :cvar changes: settings other than the defaults.
    :cvar vectors: the direction of each axis: bytes, and the expected fields of the last sample
        after them, such as ``{'linear_acceleration.z': 9.81}``. There must be one for each
        published axis (x, y, z, latitude, longitude).
    :cvar unknown: fields in which NaN or infinity has a meaning, such as ``ranges``.
    :cvar not_finite: frames with NaN or infinity, for formats with an uncommon checksum. For
        common ones such frames are made from the stream.
    """

    driver: ClassVar[type[Any]]
    changes: ClassVar[dict[str, Any]] = {}
    vectors: ClassVar[tuple[tuple[bytes, dict[str, float]], ...]] = ()
    unknown: ClassVar[tuple[str, ...]] = ()
    not_finite: ClassVar[tuple[bytes, ...]] = ()

    def device(self) -> tuple[Any, list[RecordingPublisher]]:
        """Make the device, and publishers with the fields of its messages."""
        device = self.driver('dut', settings_of(self.driver, **scripted_settings(self.changes)))
        return device, bind(device)

    def samples_of(self, *chunks: bytes) -> list[RecordingPublisher]:
        """Return the samples of the bytes."""
        device, publishers = self.device()
        with opened(device, chunks):
            read_all(device, len(chunks), _START_NS, _STEP_NS)
        return publishers

    def test_the_sense_of_each_axis(self) -> None:
        for data, expected in self.vectors:
            publishers = self.samples_of(data)
            for name, value in expected.items():
                found = [last[name] for p in publishers if p.values
                         for last in (numbers(p)[-1],) if name in last]
                assert found, f'{data!r} publishes nothing with a field {name}'
                assert found[0] == pytest.approx(value, rel=0.02, abs=1e-9), (
                    f'{name} after {data!r}')

    def test_every_axis_has_a_vector(self) -> None:
        shown = {name for _, expected in self.vectors for name, value in expected.items() if value}
        axes = {name for publisher in self.samples_of(self.stream)
                for sample in numbers(publisher) for name, value in sample.items()
                if name.rpartition('.')[2] in _AXES and value.size == 1
                and np.isfinite(value).all() and value.any()}
        assert sorted(axes - shown) == [], (
            'no test would detect a wrong sign of these: add bytes and their meaning to `vectors`')

    def test_what_is_not_finite_is_no_data(self) -> None:
        good = self.samples_of(self.stream)
        always = [_always_finite(p, self.unknown) for p in good]
        chunks = [self.stream, *self.not_finite, *self._frames_without_numbers()]
        for publisher, names in zip(self.samples_of(*chunks, self.stream), always):
            for sample, stamp_ns in zip(numbers(publisher), publisher.stamps):
                bad = [name for name in names if not np.isfinite(sample[name]).all()]
                assert not bad, (
                    f'{bad[0]} is {sample[bad[0]]} after '
                    f'{chunks[(stamp_ns - _START_NS) // _STEP_NS]!r}: publish nothing, or add the '
                    'field to `unknown` if its message defines the meaning')

    def test_what_came_before_opening_again_changes_nothing(self) -> None:
        fresh = self._published_after(b'')
        for cut in range(1, len(self.stream), len(self.stream) // _MOST_CUTS + 1):
            assert self._published_after(self.stream[:cut]) == fresh, (
                f'after {self.stream[:cut]!r} and reopening the stream gives other samples: reset '
                'the state of the stream in restart()')

    def test_nothing_in_the_loop_sleeps(self) -> None:
        noise = random.Random(4).randbytes(300)
        chunks = [self.stream, b'', noise, self.stream[:-1], self.stream, b'']
        device, _ = self.device()
        with opened(device, chunks), _noting_sleep() as slept:
            for number in range(len(chunks)):
                device.write(_START_NS + number * _STEP_NS)
                device.read(_START_NS + number * _STEP_NS)
        assert slept == [], ('the loop must not block: return, and check the time in the next '
                             'write, read or idle')

    def _frames_without_numbers(self) -> Iterator[bytes]:
        """Yield the changed frames that the decoder accepts."""
        for frame in self.frames()[:4]:
            for candidate in not_finite(frame):
                if self.decode([candidate]).places == [(0, len(candidate))]:
                    yield candidate

    def _published_after(self, before: bytes) -> Any:
        """Open on some bytes, reopen on the stream; return its samples and counters."""
        device, publishers = self.device()
        with opened(device, [before]):
            read_all(device, 1, _START_NS)
            begin = device.statistics()
            counts = [len(p.values) for p in publishers]
            device.make_port = type('Port', (ScriptedPort,), {'chunks': [self.stream]})
            device.open()
            read_all(device, 1, _START_NS + _STEP_NS)
            end = device.statistics()
        return ([(p.values[n:], p.stamps[n:]) for p, n in zip(publishers, counts)],
                end.lost_samples - begin.lost_samples,
                end.contradicted_samples - begin.contradicted_samples)


def numbers(publisher: RecordingPublisher) -> list[Numbers]:
    """Return the floating point fields of each sample, by name."""
    return [{field.name: np.frombuffer(value, _FLOATS[field.type_name], field.count, field.offset)
             for field in publisher.layout.fields()
             if field.type_name in _FLOATS and field.nbytes and not field.tail}
            for value in publisher.values]


def _always_finite(publisher: RecordingPublisher, unknown: tuple[str, ...]) -> list[str]:
    samples = numbers(publisher)
    names = samples[0] if samples else {}
    return [name for name in names if name not in unknown
            and all(np.isfinite(sample[name]).all() for sample in samples)]


@contextmanager
def _noting_sleep() -> Iterator[list[str]]:
    """Record the callers of blocking functions, which are called nevertheless."""
    slept: list[str] = []

    def note(frame: FrameType, event: str, function: Any) -> None:
        if event != 'c_call':
            return
        name = getattr(function, '__name__', '')
        owner = type(getattr(function, '__self__', None)).__module__
        if any(function is each for each in _SLEEPING) or (
                name in _SLEEPING_NAMES and owner == _SLEEPING_NAMES[name]):
            slept.append(f'{name} in {frame.f_code.co_filename}:{frame.f_lineno}')

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        yield slept
    finally:
        sys.setprofile(before)

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

"""The frames of the simulated sensor node."""

from __future__ import annotations

from benchmarks.shared.sine import CYCLE
from benchmarks.shared.sine import Decoder
from benchmarks.shared.sine import frame
from benchmarks.shared.sine import MAGNITUDE
from hypothesis import given
from hypothesis import strategies as st


def test_a_cycle_is_a_sine_of_magnitude_four() -> None:
    found = list(Decoder().feed(b''.join(frame(i) for i in range(CYCLE))))
    assert [number for number, _ in found] == list(range(CYCLE))
    values = [value for _, value in found]
    assert max(values) == MAGNITUDE
    assert min(values) == -MAGNITUDE
    assert abs(sum(values)) < 1e-3


def test_frames_are_found_at_every_split() -> None:
    data = frame(7) + frame(170)
    for split in range(len(data) + 1):
        decoder = Decoder()
        found = [*decoder.feed(data[:split]), *decoder.feed(data[split:])]
        assert [number for number, _ in found] == [7, 170]


@given(st.binary(max_size=60))
def test_garbage_before_a_frame_hides_at_most_what_it_touches(garbage: bytes) -> None:
    decoder = Decoder()
    found = list(decoder.feed(garbage + b''.join(frame(i) for i in range(12))))
    # The start of a frame in the garbage may swallow a frame's length of what follows.
    assert [number for number, _ in found][-8:] == list(range(4, 12))

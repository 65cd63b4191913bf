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

"""What the case devices measures: the time of a frame, and what real devices said."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.devices import sentences
from benchmarks.devices import transcript
from benchmarks.devices.files import text_of
from rt_robot_os.devices.arduino_bridge.wire import ReplyDecoder
from rt_robot_os.devices.stargazer import wire as stargazer
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.operation_cost import block_means_ps

_MARKS = (stargazer.CeilingMark(24706, -96.28, -48.9, -21.13, 220.5),
          stargazer.CeilingMark(24594, -94.27, 101.58, -17.8, 230.71))


def frames() -> Mapping[str, Callable[[], object]]:
    """Give for each form what decodes one frame of it."""
    def feed(decoder: Any, data: bytes) -> Callable[[], object]:
        return lambda: decoder.feed(data)

    return {
        'stargazer old': feed(stargazer.StarGazerDecoder(), stargazer.old(_MARKS[0])),
        'stargazer single': feed(stargazer.StarGazerDecoder(), stargazer.single(_MARKS[0])),
        'stargazer multi': feed(stargazer.StarGazerDecoder(), stargazer.multi(_MARKS)),
        'arduino_bridge': feed(ReplyDecoder(), b'12345 -67890\r\n')}


def steps(harness: Harness) -> Measurement:
    """Measure what a frame costs to decode, in picoseconds."""
    tested = frames()
    harness.prepare(freeze=True)
    share_ns = harness.arguments['measure_ns'] // len(tested)
    return Measurement({name: block_means_ps(operation, share_ns)
                        for name, operation in tested.items()})


def recorded(harness: Harness) -> Measurement:
    """Compare with a file: sentences as JSON, or the transcript of a board."""
    path = Path(harness.arguments['data'])
    text = text_of(path)
    if text.lstrip()[:1] in ('[', '{'):
        found = sentences.compare(text, str(path))
        return Measurement({}, {
            'sentences': found.count, 'marks': found.marks, 'wrong': len(found.wrong),
            'wrong in noise': len(found.wrong_in_noise)})
    board = transcript.compare(transcript.read(text, str(path)))
    off = sorted(board.voltage_off)
    figures: dict[str, float] = {
        'orders': board.orders, 'answers': board.answers, 'unread': board.unread_bytes,
        'unlike': board.unlike, 'counts': board.counts, 'counts off': board.counts_off}
    if off:
        figures['voltage off'] = 100 * off[len(off) // 2]
    return Measurement({}, figures)

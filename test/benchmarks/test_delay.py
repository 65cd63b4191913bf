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

"""What the case `delay` measures: each message reaches its subscribers, whatever its size."""

from __future__ import annotations

from typing import Any

from benchmarks.delay.subjects import due
from benchmarks.delay.subjects import Variant
import pytest

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000


def delays_of(size: int, subscribers: int, before: int = 0) -> Any:
    """Measure until there is something to look at: a busy machine misses releases."""
    for longer in (1, 10, 100):
        arguments = {'period_ns': 2 * MS, 'warmup_ns': 10 * MS, 'measure_ns': longer * 80 * MS}
        variant = Variant(arguments, size, subscribers, before)
        delays = variant.run()
        if variant.counted > 3:
            break
    # Some releases may be missed, but what is published arrives.
    assert len(delays) == variant.counted > 3
    assert variant.counted <= due(arguments) + 1
    return delays


@pytest.mark.parametrize('size', [64, 2048, 64 * 1024, 1024 * 1024])
@pytest.mark.parametrize('subscribers', [1, 3])
def test_messages_arrive(size: int, subscribers: int) -> None:
    assert (delays_of(size, subscribers) > 0).all()


def test_messages_that_warm_the_caches_are_not_counted() -> None:
    assert (delays_of(64, 1, before=4) > 0).all()

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

"""Tasks end, even if a cancellation is lost on its way."""

from __future__ import annotations

import asyncio

from rt_robot_os.messages.uplink.tasks import end


def test_a_task_that_misses_a_cancellation_ends_all_the_same() -> None:
    missed: list[int] = []

    async def deaf(times: int) -> None:
        while True:
            try:
                await asyncio.sleep(3600.0)
            except asyncio.CancelledError:
                if len(missed) >= times:
                    raise
                missed.append(times)

    async def fails() -> None:
        raise ZeroDivisionError

    async def run() -> None:
        tasks = [asyncio.ensure_future(each) for each in (deaf(2), deaf(0), fails())]
        await asyncio.sleep(0.0)
        await end(tasks)
        assert [each.cancelled() for each in tasks] == [True, True, False]
        await end([])

    asyncio.run(asyncio.wait_for(run(), 60.0))
    assert missed == [2, 2]


def test_a_waiter_that_is_woken_as_it_is_cancelled_ends() -> None:
    async def wait(wake: asyncio.Event) -> None:
        while True:
            try:
                await asyncio.wait_for(wake.wait(), 60.0)
            except asyncio.TimeoutError:
                pass
            wake.clear()

    async def run() -> None:
        for _ in range(2):
            wake = asyncio.Event()
            task = asyncio.ensure_future(wait(wake))
            await asyncio.sleep(0.0)
            await asyncio.sleep(0.0)
            wake.set()
            await asyncio.sleep(0.0)
            await end([task])

    asyncio.run(asyncio.wait_for(run(), 60.0))

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

"""The end of tasks of asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any
from typing import Final

_AGAIN_S: Final = 0.1


async def end(tasks: Sequence[asyncio.Task[Any]]) -> None:
    """
    Cancel tasks, and wait until they have ended.

    Before Python 3.12 a cancellation is lost in ``asyncio.wait_for`` when what that waits for
    comes at the same moment: a single cancellation may wait for ever.
    """
    waiting = set(tasks)
    while waiting:
        for each in waiting:
            each.cancel()
        _, waiting = await asyncio.wait(waiting, timeout=_AGAIN_S)
    await asyncio.gather(*tasks, return_exceptions=True)  # their results are read

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

"""A module for the tests of parameters."""

from __future__ import annotations

from rt_robot_os.modules import Input
from rt_robot_os.modules import Module


class Woken(Module):
    """Released by its input alone: it has no rate to change."""

    command = Input('cmd_vel', wake=True)

    def step(self) -> None:
        """Do nothing."""


class Walker(Module):
    """A coroutine, which awaits what releases it."""

    command = Input('cmd_vel')

    async def run(self) -> None:
        """Take what comes."""
        while True:
            await self.command.next()

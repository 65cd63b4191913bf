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

"""Modules that give a robot trouble, for a picture of it."""

from __future__ import annotations

import random

from rt_robot_os.modules import Field
from rt_robot_os.modules import Module


class Planner(Module):
    """Sort many numbers in one native call, which nothing preempts."""

    SETTINGS = (Field('numbers', int, 400_000, 'how many', '', 1, 10_000_000),)

    def configure(self) -> None:
        """Prepare the numbers."""
        self._numbers = [random.random() for _ in range(self.settings['numbers'])]

    def step(self) -> None:
        """Sort them, and forget it."""
        sorted(self._numbers)


class Failing(Module):
    """Raise in each tenth job."""

    _steps = 0

    def step(self) -> None:
        """Do nothing, or fail."""
        self._steps += 1
        if self._steps % 10 == 0:
            raise ValueError('a wheel that is not there')

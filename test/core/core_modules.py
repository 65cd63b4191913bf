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


"""Modules that fail, run away and note what happens to them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rt_robot_os.modules import Field
from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output


class Noted(Module):
    """Note each call; raise or compute when told to."""

    SETTINGS = (Field('raises', int, 0, 'steps from this on raise; 0: none', '', 0, 10 ** 6),
                Field('heals', int, 10 ** 6, 'steps from this on do not', '', 0, 10 ** 6),
                Field('work_us', float, 0.0, 'computing time', 'us', 0.0, 1e9, live=True),
                Field('asks', str, '', 'a resource'))

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        super().__init__(name, settings)
        self.calls: list[str] = []
        self.steps = 0

    def configure(self) -> None:
        self.calls.append('configure')
        if self.settings['asks']:
            self.shared = self.resource(self.settings['asks'])

    def activate(self) -> None:
        self.calls.append('activate')

    def deactivate(self) -> None:
        self.calls.append('deactivate')

    def step(self) -> None:
        self.steps += 1
        if self.settings['raises'] and (
                self.settings['raises'] <= self.steps < self.settings['heals']):
            raise ValueError(f'step {self.steps}')
        if self.settings['asks']:
            with self.shared:
                self.work()
        else:
            self.work()

    def work(self) -> None:
        assert self.kernel is not None
        self.kernel.clock.spend(round(self.settings['work_us'] * 1000))


class Safe(Noted):
    """Have a safe state as well."""

    def safe_state(self) -> None:
        self.calls.append('safe_state')


class Relay(Module):
    """Hand on what comes, by each publication."""

    into = Input('a', wake=True)
    out = Output('b', 'geometry_msgs/msg/Twist')

    def step(self) -> None:
        while self.into.take():
            self.out.publish()


class SeldomRelay(Relay):
    """Be released by every second publication only."""

    into = Input('a', wake=2)


class Woken(Module):
    """Be released by an input."""

    command = Input('cmd_vel', wake=True)

    def step(self) -> None:
        while self.command.take():
            pass


class Hanging(Module):
    """Call something native that never returns, or compute in Python without end."""

    SETTINGS = (Field('native', bool, True, 'where it hangs'),)
    steps = 0

    def step(self) -> None:
        self.steps += 1
        if self.steps == 20:
            self.hang()

    def hang(self) -> None:
        if self.settings['native']:
            sum(range(10 ** 12))
        while True:
            pass

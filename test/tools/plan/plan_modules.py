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

"""Modules that are released in every way there is."""

from __future__ import annotations

from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output


class Third(Module):
    """Wake on every third sample of the IMU."""

    imu = Input('imu/data', wake=3)
    third = Output('third', 'std_msgs/msg/Float64')

    def step(self) -> None:
        self.third.publish()


class Both(Module):
    """Wake when the GPS and the third sample have something new."""

    fix = Input('gps/fix', wake='all')
    third = Input('third', wake='all')

    def step(self) -> None:
        pass


class Second(Module):
    """Wake on every second publication of another module."""

    third = Input('third', wake=2)

    def step(self) -> None:
        pass


class Waiter(Module):
    """Say itself when it goes on."""

    fix = Input('gps/fix')

    async def run(self) -> None:
        await self.fix.next()


class Woken(Waiter):
    """Say what it goes on with: what it awaits, and rounds of its own."""

    third = Input('third')

    def awaits(self) -> tuple[str, ...]:
        return ('third',)

    def own_rounds_hz(self) -> float:
        return 20.0


class Asking(Module):
    """Answer an answer; both promise to do so seldom."""

    heard = Input('answers', message='std_msgs/msg/Bool')
    asks = Output('questions', 'std_msgs/msg/Bool', most_hz=2.0)

    async def run(self) -> None:
        await self.heard.next()

    def awaits(self) -> tuple[str, ...]:
        return ('heard',)

    def own_rounds_hz(self) -> float:
        return 20.0


class Answering(Module):
    """Answer a question."""

    heard = Input('questions', wake=True, message='std_msgs/msg/Bool')
    answers = Output('answers', 'std_msgs/msg/Bool', most_hz=4.0)

    def step(self) -> None:
        self.answers.publish()

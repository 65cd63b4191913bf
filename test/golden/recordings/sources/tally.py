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

"""Modules of a user, in the recordings of this folder."""

from __future__ import annotations

from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output


class Length(Module):
    """Say how long what came is; wakes with it."""

    cloud = Input('cloud', message='std_msgs/msg/UInt8MultiArray', wake=True)
    length = Output('length', 'std_msgs/msg/Float64')

    def step(self) -> None:
        """Take what came."""
        while self.cloud.take():
            self.length.msg.data = float(len(self.cloud.msg.data))
            self.length.publish(self.cloud.stamp_ns)


class Stumbling(Module):
    """Count, and fail now and then."""

    count = Output('count', 'std_msgs/msg/Float64')

    def step(self) -> None:
        """Fail with each fifth step."""
        self.count.msg.data += 1.0
        self.count.publish()
        if self.count.msg.data % 5 == 0:
            raise ValueError('it stumbled, on purpose')

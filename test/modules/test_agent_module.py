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

"""The agent on the virtual clock: what a person, an operator and a robot would notice."""

from __future__ import annotations

import math

from agent_rig import AgentRig
import pytest

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

S, MS = 1_000_000_000, 1_000_000


def test_it_turns_to_an_emergency_at_once_and_drives_there() -> None:
    rig = AgentRig()
    rig.place(1.0, 5.0)
    rig.in_order((1.0, lambda: rig.alarm('raised')))
    rates = []

    def note() -> None:
        while rig.spins.take():
            rates.append((rig.spins.stamp_ns, rig.kernel.now_ns(), rig.spins.msg.angular.z))

    rig.kernel.add_task('note', note, priority=1, rate_hz=1000.0)
    rig.run(9.0)
    # In the chain of releases of the event itself, to the left, and smoothly.
    assert rates[0][:2] == (S, S)
    turned = [0.0, *(rate for _, _, rate in rates)]
    assert turned[1] > 0.0 == turned[-1]
    assert all(abs(after - before) < 0.0751 for before, after in zip(turned, turned[1:]))
    assert max(turned) <= 0.8
    assert rig.path() == ['approach', 'observe']
    (goal,) = rig.goals
    assert math.dist(goal[:2], (1.0, 5.0)) == pytest.approx(1.0)
    assert abs(math.remainder(goal[2] - math.atan2(5.0 - goal[1], 1.0 - goal[0]), math.tau)) < 1e-9

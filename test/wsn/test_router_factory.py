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


"""Which rules of a protocol a scenario asks for."""

from __future__ import annotations

from fake_node import FakeNode
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.simulator.router_factory import router_factory
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.scenario import settled


def test_a_scenario_says_how_long_ctp_is_silent() -> None:
    node = FakeNode(1)
    scenario = settled(Scenario(name='flat', protocol='ctp', longest_interval_binary_ms=256))
    router = router_factory(scenario)(node, False)
    assert isinstance(router, Ctp)
    router.start()
    for _ in range(100):
        node.run_binary_ms(256)
        node.through()
    assert 95 <= router.beacons <= 105

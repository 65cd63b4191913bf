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


"""Creates the routing protocol of a scenario."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rt_robot_os.features.wsn.routing.beacon_timing import BeaconTiming
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.routing.ctp_rules import CtpRules
from rt_robot_os.features.wsn.routing.ctp_rules import TOSSIM
from rt_robot_os.features.wsn.routing.least_cost import LeastCost
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi1
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi2
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.simulator.network import RouterFactory
from rt_robot_os.features.wsn.simulator.scenario import Scenario

_SHORTEST_ROUND_NS: Final = 1_000_000_000


def router_factory(scenario: Scenario, speed: Callable[[], float] | None = None
                   ) -> RouterFactory:
    """
    Return the factory of the protocol of a node.

    :param scenario: with all defaults set.
    :param speed: returns the current speed of the sink in m/s.
    """
    period_ns = scenario.beacon_period_ns
    wrap = bool(scenario.u16_wrap)
    if scenario.protocol == 'ctp':
        rules = TOSSIM if scenario.radio.mac == 'tossim' else CtpRules()
        if scenario.longest_interval_binary_ms is not None:
            rules = rules._replace(longest_interval_ms=scenario.longest_interval_binary_ms)
        return lambda node, root: Ctp(node, root, rules)
    if scenario.protocol == 'paper':
        timing = None if scenario.renew_m is None else BeaconTiming(
            scenario.renew_m, min(_SHORTEST_ROUND_NS, period_ns), period_ns)
        return lambda node, root: LeastCost(
            node, root, period_ns, timing=timing if root else None,
            speed=speed if root else None)

    def lqi(node: Node, root: bool) -> Router:
        kind = MultiHopLqi1 if scenario.tinyos == 1 else MultiHopLqi2
        return kind(node, root, period_ns, u16_wrap=wrap)

    return lqi

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


"""A scenario made into a network that runs, and what it found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from random import Random
from time import perf_counter
from typing import Final

from rt_robot_os.errors import ConfigError
from rt_robot_os.units import NS_PER_S
from rt_robot_os.wsn.packets import ctp as ctp_packets
from rt_robot_os.wsn.packets import multihop_lqi
from rt_robot_os.wsn.radio.cc2420 import TURNAROUND_NS
from rt_robot_os.wsn.radio.mac import MAC_PROFILES
from rt_robot_os.wsn.radio.mac import MacProfile
from rt_robot_os.wsn.radio.mac import TINYOS2
from rt_robot_os.wsn.radio.noise import closest_pattern
from rt_robot_os.wsn.radio.noise import heavy
from rt_robot_os.wsn.radio.noise import quiet
from rt_robot_os.wsn.radio.noise import read_trace
from rt_robot_os.wsn.radio.path_loss import PathLoss
from rt_robot_os.wsn.routing.protocol import Router
from rt_robot_os.wsn.simulator.energy import PowerModel
from rt_robot_os.wsn.simulator.faults import Fault
from rt_robot_os.wsn.simulator.faults import fault
from rt_robot_os.wsn.simulator.faults import nodes_of
from rt_robot_os.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.wsn.simulator.ledger import Ledger
from rt_robot_os.wsn.simulator.link_medium import Link
from rt_robot_os.wsn.simulator.link_medium import LinkMedium
from rt_robot_os.wsn.simulator.medium import Medium
from rt_robot_os.wsn.simulator.medium import OUTCOMES
from rt_robot_os.wsn.simulator.mote import Mote
from rt_robot_os.wsn.simulator.mote import Traffic
from rt_robot_os.wsn.simulator.network import Network
from rt_robot_os.wsn.simulator.path_loss_medium import PathLossMedium
from rt_robot_os.wsn.simulator.results import GAP_PACKETS
from rt_robot_os.wsn.simulator.results import latencies_in_ms
from rt_robot_os.wsn.simulator.results import Results
from rt_robot_os.wsn.simulator.routers import router_factory
from rt_robot_os.wsn.simulator.scenario import Scenario
from rt_robot_os.wsn.simulator.topology import Topology
from rt_robot_os.wsn.simulator.topology import WallCount
from rt_robot_os.wsn.simulator.traffic import application
from rt_robot_os.wsn.simulator.transmission import ACK
from rt_robot_os.wsn.simulator.transmission import Transmission


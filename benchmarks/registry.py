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

"""The cases of this folder; a new one is a folder here and a name in this list."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from benchmarks.capture import case as capture
from benchmarks.control import case as control
from benchmarks.delay import case as delay
from benchmarks.devices import case as devices
from benchmarks.emergency import case as emergency
from benchmarks.frequency import case as frequency
from benchmarks.gateway import case as gateway
from benchmarks.load import case as load
from benchmarks.localization import case as localization
from benchmarks.micro import case as micro
from benchmarks.network import case as network
from benchmarks.reaction import case as reaction
from benchmarks.routing import case as routing
from benchmarks.serial import case as serial
from benchmarks.sink import case as sink
from benchmarks.slam import case as slam
from benchmarks.start import case as start
from benchmarks.throughput import case as throughput
from benchmarks.trajectory import case as trajectory
from rt_robot_os.tools.bench.case import Case

CASES: Mapping[str, Case] = MappingProxyType({case.name: case for case in (
    frequency.CASE, delay.CASE, load.CASE, serial.CASE, sink.CASE, reaction.CASE, emergency.CASE,
    trajectory.CASE, capture.CASE, gateway.CASE, throughput.CASE, micro.CASE, localization.CASE,
    control.CASE, devices.CASE, routing.CASE, network.CASE, slam.CASE, start.START,
    start.MEMORY)})

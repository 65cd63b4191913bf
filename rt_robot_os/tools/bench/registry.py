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

"""All cases, in the order in which they run; a new one is a file in ``cases`` and a name here."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.cases import capture
from rt_robot_os.tools.bench.cases import control
from rt_robot_os.tools.bench.cases import delay
from rt_robot_os.tools.bench.cases import devices
from rt_robot_os.tools.bench.cases import emergency
from rt_robot_os.tools.bench.cases import frequency
from rt_robot_os.tools.bench.cases import gateway
from rt_robot_os.tools.bench.cases import kernel
from rt_robot_os.tools.bench.cases import load
from rt_robot_os.tools.bench.cases import localization
from rt_robot_os.tools.bench.cases import micro
from rt_robot_os.tools.bench.cases import mirror
from rt_robot_os.tools.bench.cases import network
from rt_robot_os.tools.bench.cases import overload
from rt_robot_os.tools.bench.cases import preemption
from rt_robot_os.tools.bench.cases import reaction
from rt_robot_os.tools.bench.cases import routing
from rt_robot_os.tools.bench.cases import serial
from rt_robot_os.tools.bench.cases import sink
from rt_robot_os.tools.bench.cases import slam
from rt_robot_os.tools.bench.cases import spacing
from rt_robot_os.tools.bench.cases import stability
from rt_robot_os.tools.bench.cases import start
from rt_robot_os.tools.bench.cases import throughput
from rt_robot_os.tools.bench.cases import trajectory
from rt_robot_os.tools.bench.cases import wakeup

CASES: Mapping[str, Case] = MappingProxyType({case.name: case for case in (
    frequency.CASE, delay.CASE, load.CASE, stability.CASE, preemption.CASE, overload.CASE,
    serial.CASE, sink.CASE, reaction.CASE, emergency.CASE, trajectory.CASE, mirror.CASE,
    capture.CASE, gateway.CASE, wakeup.CASE, throughput.CASE, kernel.CASE, micro.CASE,
    spacing.CASE, localization.CASE, control.CASE, devices.CASE, routing.CASE, network.CASE,
    slam.CASE, start.START, start.MEMORY)})

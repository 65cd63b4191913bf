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


"""Drive a simulated device and a real driver over a real pty, with time in the test's hand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from driver_fakes import bind
from rt_robot_os import testing
from rt_robot_os.devices.device import Device
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.testing.rig import Rig
from rt_robot_os.testing.rig import START_NS  # noqa: F401

MS = 1_000_000


@contextmanager
def rig(folder: Path, simulated: type[SimulatedDevice], driver: type[Device], **settings: Any,
        ) -> Iterator[Rig]:
    """Connect a simulated device with its driver; the publishers forget what they published."""
    with testing.rig(folder, simulated, driver, publishers=bind, **settings) as made:
        yield made

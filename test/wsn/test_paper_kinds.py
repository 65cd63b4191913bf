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

"""Every quantity that the paper's packets know is sent, read and simulated alike."""

from __future__ import annotations

import pytest
from rt_robot_os.features.wsn.packets.contents import READINGS
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.simulator.live_readings import _SENSORS
from rt_robot_os.features.wsn.simulator.traffic import KINDS
from rt_robot_os.messages.quantities import QUANTITIES


@pytest.mark.parametrize('kind', [kind for kind in Kind if kind is not Kind.NONE])
def test_a_kind_means_the_same_everywhere(kind: Kind) -> None:
    name, convert = READINGS[kind]
    assert name in QUANTITIES
    assert KINDS[name][0] is kind
    sent, raw = _SENSORS[name]
    assert sent is kind
    value = {'temperature': 21.0, 'humidity': 0.5, 'light': 300.0, 'battery': 2.9,
             'body_temperature': 37.2, 'oxygen_l_per_min': 2.5}.get(name, 3.0)
    assert convert(raw(value)) == pytest.approx(value, rel=0.02)

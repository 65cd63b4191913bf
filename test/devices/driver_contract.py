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

"""The contract of :mod:`rt_robot_os.testing`, with publishers that forget what they published."""

from __future__ import annotations

from typing import Any

from driver_fakes import bind
from rt_robot_os import testing
from rt_robot_os.devices.device import Device


class DriverContract(testing.DriverContract):
    """Our drivers fill in every field of every sample, so that a forgotten one is noticed."""

    def publishers(self, device: Device) -> list[Any]:
        return [*bind(device)]

    def test_settings_are_described_by_sentences(self) -> None:
        assert all(f.description.endswith('.') for f in self.driver.SETTINGS)

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


"""Wheels that exist in tests only: a motor board that does not stop by itself."""

from __future__ import annotations

from pathlib import Path

from rt_robot_os.devices import DeviceParts

PARTS = DeviceParts(driver='.driver:Wheels', simulated='.simulated:SimulatedWheels')


def install(folder: Path) -> None:
    """Make a folder one in which the wheels are installed, once Python imports from it."""
    facts = folder / 'wheels-0.1.dist-info'
    facts.mkdir()
    (facts / 'METADATA').write_text('Metadata-Version: 2.1\nName: wheels\nVersion: 0.1\n')
    (facts / 'entry_points.txt').write_text(
        '[rt_robot_os.devices]\nwheels = wheels\n'
        '[rt_robot_os.modules]\ndrive = wheels.drive:Drive\n')

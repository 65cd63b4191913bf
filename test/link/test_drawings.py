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


"""The table of drawings: features are named there, and imported only to draw."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rt_robot_os.link import drawings
from rt_robot_os.link.conversions import find
from rt_robot_os.messages.marker_array import MARKERS

# What the real-time core and a check of settings import and ask.
_ASK = """
import sys
from rt_robot_os.link.conversions import find, possible
assert find('std_msgs/msg/Float64MultiArray', 'visualization_msgs/msg/MarkerArray').outward
assert possible('out')
print([name for name in sys.modules if name.startswith('rt_robot_os.features')])
"""


def test_features_are_not_imported_before_something_is_drawn() -> None:
    found = subprocess.run([sys.executable, '-c', _ASK], capture_output=True, text=True,
                           check=True, timeout=60)
    assert found.stdout.strip() == '[]'


def test_a_drawing_that_does_not_exist_is_an_error_when_the_mirror_is_made(
        monkeypatch: pytest.MonkeyPatch) -> None:
    conversion = find('std_msgs/msg/Float64MultiArray', MARKERS)
    assert conversion is not None and conversion.outward is not None
    monkeypatch.setattr(drawings, 'DRAWINGS', ('rt_robot_os.features.wsn.network_markers:none',))
    with pytest.raises(AttributeError, match='none'):
        conversion.outward('map')

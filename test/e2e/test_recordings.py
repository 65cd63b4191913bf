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

"""Recorded bytes go through a pty, the core and DDS, and arrive complete and unchanged."""

from __future__ import annotations

from collections.abc import Callable
import csv
import math
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from sensor_msgs.msg import Imu  # noqa: E402, I100
from sensor_msgs.msg import MagneticField  # noqa: E402
from sensor_msgs.msg import NavSatFix  # noqa: E402
from sensor_msgs.msg import NavSatStatus  # noqa: E402

from rt_robot_os.drivers.encoders.witmotion import encode  # noqa: E402

Until = Callable[..., Any]
G = 9.80665
HALF = 0.51  # of a least significant bit, with room for the rounding of floats

STATUS = {0: NavSatStatus.STATUS_NO_FIX, 1: NavSatStatus.STATUS_FIX,
          2: NavSatStatus.STATUS_SBAS_FIX, 3: NavSatStatus.STATUS_FIX,
          4: NavSatStatus.STATUS_GBAS_FIX, 5: NavSatStatus.STATUS_GBAS_FIX,
          9: NavSatStatus.STATUS_SBAS_FIX}

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

"""The frames of the devices, for clients without the configuration."""

from __future__ import annotations

from rt_robot_os.core.part import Host
from rt_robot_os.link.requests import Arguments
from rt_robot_os.link.session import ClientSession
from rt_robot_os.settings import RobotSettings


class FrameRequests:
    """Answer the request for the mountings of a robot."""

    def __init__(self, settings: RobotSettings) -> None:
        self._settings = settings

    def attach(self, host: Host) -> None:
        """Register the request."""
        host.requests.add('frames', self._frames)

    def _frames(self, session: ClientSession, arguments: Arguments) -> Arguments:
        """
        Return all mountings.

        By frame: its parent, its position in m, its roll, pitch and yaw in rad, and whether the
        configuration has them (``stated``); otherwise the frame is at the origin of its parent.
        """
        return {'frames': {each.frame_id: {
            'parent': each.mounting.parent, 'position_m': each.mounting.position_m,
            'rotation_rad': each.mounting.rotation_rad, 'stated': each.stated}
            for each in self._settings.frames}}

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

"""The table of commands; separate from their folder, whose import takes long."""

from __future__ import annotations

from typing import Final

from rt_robot_os.monitor.security.commands import audit
from rt_robot_os.monitor.security.commands import certificate
from rt_robot_os.monitor.security.commands import robot
from rt_robot_os.monitor.security.commands import user
from rt_robot_os.monitor.store import commands as database

COMMANDS: Final = (user, robot, certificate, audit, database)

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

"""
The link: how other processes see the core, over a Unix socket of sequenced packets.

The core never waits for a client. A sample for which a client has no room is lost to that client
alone, and counted (docs/architecture.md).
"""

from __future__ import annotations

from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from rt_robot_os.link.client import LinkClient
    from rt_robot_os.link.client import TopicInfo
    from rt_robot_os.link.server import LinkServer
    from rt_robot_os.linux.paths import socket_path

# Where each of them is, from this package.
_PLACES: Final = {
    'LinkClient': 'client',
    'LinkServer': 'server',
    'TopicInfo': 'client',
    'socket_path': '.linux.paths',
}
__all__ = ['LinkClient', 'LinkServer', 'socket_path', 'TopicInfo']

lazy_names(__name__, _PLACES)

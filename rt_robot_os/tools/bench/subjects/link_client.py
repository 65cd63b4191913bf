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

"""A client of a core, as a helper process of a measurement."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import time
from typing import NoReturn

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link import LinkClient

_BEAT_NS = NS_PER_S // 3


def connect(path: Path) -> LinkClient:
    """
    Connect as soon as the core has its socket.

    :raises LinkError: no server listens there.
    """
    while not path.exists():
        time.sleep(0.01)
    return LinkClient(path, 'bench', timeout_s=10.0)


def stay(link: LinkClient, after: Callable[[], object] = bool) -> NoReturn:
    """
    Take what comes, with a heartbeat now and then, until the process is ended.

    :param after: called each time after something was read.
    :raises LinkError: the core is gone.
    """
    beat_ns = 0
    while True:
        link.pump(0.1)
        after()
        now_ns = time.monotonic_ns()
        if now_ns >= beat_ns:
            link.beat()
            beat_ns = now_ns + _BEAT_NS

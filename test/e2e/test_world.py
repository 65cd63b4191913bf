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

"""The node that listens to the robots of the tests: no other hears it, and none harms it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.one_build


def dds_threads() -> set[str]:
    """Name what receives in this process: dds.udp.7000 is port 7000 of UDP."""
    return {name for thread in Path('/proc/self/task').iterdir()
            if (name := (thread / 'comm').read_text().strip()).startswith('dds.')}


def udp_addresses() -> set[str]:
    """Give the local addresses of the UDP sockets of this process, as /proc/net/udp has them."""
    own = {os.readlink(link) for link in Path('/proc/self/fd').iterdir() if link.is_symlink()}
    rows = [row.split() for row in Path('/proc/net/udp').read_text().splitlines()[1:]]
    return {row[1].partition(':')[0] for row in rows if f'socket:[{row[9]}]' in own}


@pytest.mark.skipif(os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp') != 'rmw_fastrtps_cpp',
                    reason='the profile is for Fast DDS')
def test_what_listens_uses_loopback_alone_and_shares_no_memory(world: Any) -> None:
    assert world.node.get_name() == 'listener'
    kinds = {name.split('.')[1] for name in dds_threads()}
    assert 'udp' in kinds and 'shm' not in kinds
    assert udp_addresses() == {'0100007F'}

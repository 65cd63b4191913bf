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

"""Announce the node frequently, because discovery may have to wait for the next announcement."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import ExitStack
import os
from pathlib import Path
from tempfile import NamedTemporaryFile

PERIOD_NS = 500_000_000
FILE_VARIABLE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
# Other variables with which the user configures Fast DDS.
_OTHER_VARIABLES = ('FASTDDS_DEFAULT_PROFILES_FILE', 'SKIP_DEFAULT_XML', 'SKIP_DEFAULT_XML_FILE',
                    'RMW_FASTRTPS_USE_QOS_FROM_XML', 'ROS_DISCOVERY_SERVER')
_OTHER_FILES = ('DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml')

PROFILE = f"""<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com">
  <participant profile_name="rt_robot_os" is_default_profile="true">
    <rtps><builtin><discovery_config>
      <leaseAnnouncement><sec>0</sec><nanosec>{PERIOD_NS}</nanosec></leaseAnnouncement>
    </discovery_config></builtin></rtps>
  </participant>
</profiles>
"""


def user_has_settings() -> bool:
    """Return whether the user configures Fast DDS, or uses another middleware."""
    rmw = os.environ.get('RMW_IMPLEMENTATION') or 'rmw_fastrtps_cpp'
    return (not rmw.startswith('rmw_fastrtps')
            or any(os.environ.get(name) for name in (FILE_VARIABLE, *_OTHER_VARIABLES))
            or any(Path(name).exists() for name in _OTHER_FILES))


@contextmanager
def frequent_announcements() -> Iterator[None]:
    """
    Let the first node created in this context announce itself every 0.5 s instead of every 3 s.

    Without effect if the user configures Fast DDS. Not for the real-time loop.
    """
    if user_has_settings():
        yield
        return
    with ExitStack() as stack:
        try:
            # Fast DDS resolves the path, so a file in memory is not sufficient.
            file = stack.enter_context(NamedTemporaryFile(
                'w', prefix='rt_robot_os_', suffix='.xml', encoding='utf-8'))
            file.write(PROFILE)
            file.flush()
        except OSError:
            pass  # announced less often; the robot runs anyway
        else:
            # Removed afterwards: children must not inherit a setting of this process.
            stack.callback(os.environ.pop, FILE_VARIABLE, None)
            os.environ[FILE_VARIABLE] = file.name
        yield

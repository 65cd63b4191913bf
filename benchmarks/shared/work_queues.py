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

"""Where Linux runs its unbound work queues, by which serial bytes are handed on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rt_robot_os.tools.bench.harness import Unavailable

_MASK = Path('/sys/devices/virtual/workqueue/cpumask')


def mask() -> int:
    """Read on which CPUs Linux may run them; -1 when it does not say."""
    try:
        return int(_MASK.read_text().strip().replace(',', ''), 16)
    except (OSError, ValueError):
        return -1


@contextmanager
def kept_off(cpu: int) -> Iterator[None]:
    """
    Keep them off a CPU for a while, as the administrator can for good.

    :raises Unavailable: there is no other CPU, or not the right to do so.
    """
    before = mask()
    if before < 0 or not before & ~(1 << cpu):
        raise Unavailable(f'the work queues have no CPU but {cpu}')
    try:
        _MASK.write_text(f'{before & ~(1 << cpu):x}')
    except OSError as error:
        raise Unavailable(f'{_MASK}: {error.strerror} (remedy: run as root)') from error
    try:
        yield
    finally:
        _MASK.write_text(f'{before:x}')

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

"""The common interface of bag storages: topics, messages in order, problems."""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
from pathlib import Path
from typing import Final
from typing import NamedTuple
from typing import Protocol

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.needs import require

SCAN: Final = 'sensor_msgs/msg/LaserScan'
ODOMETRY: Final = 'nav_msgs/msg/Odometry'
TRANSFORMS: Final = 'tf2_msgs/msg/TFMessage'
#: Largest message that is read.
MESSAGE_BYTES_MOST: Final = 16 << 20
#: Packed by `ros2 bag record --compression-mode message`.
ZSTD: Final = b'\x28\xb5\x2f\xfd'
CDR: Final = 'cdr'


class BagMessage(NamedTuple):
    """
    A message of a bag.

    :ivar log_ns: when it was recorded.
    """

    topic: str
    log_ns: int
    cdr: bytes


@dataclass
class Findings:
    """
    Topics and problems of a bag.

    :ivar types: of all topics, by name.
    :ivar problems: a sentence for each part that could not be read.
    :ivar lost: damaged messages.
    :ivar read_bytes: so far.
    """

    types: dict[str, str] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    lost: int = 0
    read_bytes: int = 0


class StorageFile(Protocol):
    """One file of a bag."""

    def __init__(self, path: Path, findings: Findings) -> None:
        """Open it and find its topics."""

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Yield the messages of some topics in the order in which they were recorded."""


def whole_message(data: bytes) -> bytes:
    """
    Return a message, decompressed if it is compressed by itself.

    :raises ValueError: it cannot be decompressed, or is too long.
    """
    if not data.startswith(ZSTD):
        if len(data) > MESSAGE_BYTES_MOST:
            raise ValueError(f'a message of {len(data)} bytes')
        return data
    zstandard = need_zstandard('its messages are compressed')
    try:
        if zstandard.frame_content_size(data) > MESSAGE_BYTES_MOST:
            raise ValueError('a message that is too long')
        return bytes(zstandard.ZstdDecompressor().decompress(
            data, max_output_size=MESSAGE_BYTES_MOST))
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from error


def need_zstandard(why: str):  # type: ignore[no-untyped-def]  # a module without types
    """
    Import the decompressor.

    :raises ConfigError: it is missing or too old.
    """
    require(f'{why} with zstd, which', 'zstandard', error=ConfigError)
    import zstandard
    return zstandard

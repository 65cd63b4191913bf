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

"""Strings on topics, received and published by the participants of a scenario."""

from __future__ import annotations

from collections.abc import Iterator
import json
from typing import Any

from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription


def received(reader: Subscription | None) -> Iterator[str]:
    """Yield the strings received on a topic."""
    while reader is not None and reader.take():
        yield str(reader.msg.data)


def received_json(reader: Subscription | None) -> Iterator[Any]:
    """Yield the JSON values received on a topic."""
    return map(json.loads, received(reader))


def publish_text(publisher: Publisher | None, text: str, now_ns: int) -> None:
    """Publish a string on a topic, if the topic exists."""
    if publisher is not None:
        publisher.msg.data = text
        publisher.publish(now_ns)

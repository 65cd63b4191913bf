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

"""The topics of the readings, and the writers of their messages."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.battery import BatteryFiller
from rt_robot_os.devices.battery import DISCHARGING
from rt_robot_os.features.wsn.battery_life import Curve
from rt_robot_os.messages.quantities import BATTERY
from rt_robot_os.messages.quantities import FLOAT
from rt_robot_os.messages.quantities import HUMIDITY
from rt_robot_os.messages.quantities import Quantity
from rt_robot_os.messages.quantities import quantity
from rt_robot_os.messages.survey import SurveyedNode
from rt_robot_os.topics import Publisher

_DEPTH: Final = 4


def topics_of(survey: Iterable[SurveyedNode], prefix: str, wanted: Iterable[str]
              ) -> Iterator[tuple[int, Quantity, TopicSpec]]:
    """
    Return the topics: for each node the quantities that it has and that are wanted.

    :param prefix: first part of their names.
    :param wanted: names of quantities; empty for all.
    :return: the id of the node, its quantity, the topic.
    """
    chosen = frozenset(wanted)
    for node in survey:
        for name in node.quantities:
            if chosen and name not in chosen:
                continue
            each = quantity(name)
            fixed = {} if each.message == FLOAT else {'header.frame_id': node.name}
            yield node.id, each, TopicSpec(f'{prefix}/{node.token}/{name}', each.message, fixed,
                                           _DEPTH)


class ReadingOutput:
    """
    The output of one quantity of a node.

    :ivar quantity: the quantity.
    :ivar write: publishes a reading with its time of arrival in ns; safe in the loop.
    """

    __slots__ = ('quantity', 'write')

    def __init__(self, each: Quantity, publisher: Publisher) -> None:
        self.quantity = each
        self.write = _writer(each, publisher)


def _writer(each: Quantity, publisher: Publisher) -> Callable[[float, int], None]:
    message, publish = publisher.msg, publisher.publish
    if each.message == BATTERY:
        return _battery_writer(message, publish)
    field = each.field
    if each.message == HUMIDITY:
        def write_humidity(value: float, stamp_ns: int) -> None:
            # A wet sensor reports slightly more than 1.0.
            message.relative_humidity = min(value, 1.0)
            publish(stamp_ns)
        return write_humidity

    def write(value: float, stamp_ns: int) -> None:
        setattr(message, field, value)
        publish(stamp_ns)
    return write


def _battery_writer(message: Any, publish: Callable[[int], None]) -> Callable[[float, int], None]:
    BatteryFiller({'battery_empty_v': 0.0, 'battery_full_v': 0.0}).fill(
        message, math.nan, status=DISCHARGING)
    share = Curve().share

    def write(volts: float, stamp_ns: int) -> None:
        message.voltage = volts
        message.percentage = share(volts)
        publish(stamp_ns)
    return write

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

"""The robot's settings as parameters of its node."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from typing import Any

from rcl_interfaces.msg import FloatingPointRange
from rcl_interfaces.msg import IntegerRange
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.settings import ParameterDescription

_LISTS = {str: Parameter.Type.STRING_ARRAY, int: Parameter.Type.INTEGER_ARRAY,
          float: Parameter.Type.DOUBLE_ARRAY, bool: Parameter.Type.BOOL_ARRAY}
_ARRAYS = {*_LISTS.values(), Parameter.Type.BYTE_ARRAY}


def _descriptor(entry: ParameterDescription) -> ParameterDescriptor:
    field = entry.field
    unit = f' [{field.unit}]' if field.unit else ''
    descriptor = ParameterDescriptor(
        name=entry.name, description=f'{field.description}{unit}', read_only=entry.read_only)
    if field.choices:
        descriptor.additional_constraints = 'one of ' + ', '.join(map(str, field.choices))
    if field.minimum is not None and field.maximum is not None:
        if field.kind is int:
            descriptor.integer_range = [IntegerRange(
                from_value=int(field.minimum), to_value=int(field.maximum), step=0)]
        elif field.kind is float:
            descriptor.floating_point_range = [FloatingPointRange(
                from_value=float(field.minimum), to_value=float(field.maximum), step=0.0)]
    return descriptor


class NodeParameters:
    """
    Declare the settings on a node and forward changes.

    :param change: applies changes, by name: all of them, or it raises and applies none.
    """

    def __init__(self, node: Node, entries: Iterable[ParameterDescription],
                 change: Callable[[Mapping[str, Any]], None]) -> None:
        self._node = node
        self._change = change
        self._kinds: dict[str, type] = {}
        self._lists: dict[str, Parameter.Type] = {}
        for entry in entries:
            self._kinds[entry.name] = entry.field.kind
            if entry.field.kind is list:
                self._lists[entry.name] = _LISTS[entry.field.item]
            self._declare(entry)
        node.add_pre_set_parameters_callback(self._widen)
        node.add_on_set_parameters_callback(self._set)

    def _declare(self, entry: ParameterDescription) -> None:
        # The values were read and checked before, with file and line of every problem.
        if entry.value != []:
            self._node.declare_parameter(
                entry.name, entry.value, _descriptor(entry), ignore_override=True)
            return
        # rclpy treats an empty list as a list of bytes, and a parameter that is declared by its
        # type alone has no value: a request for all values would then return none.
        kind = self._lists[entry.name]
        self._node.declare_parameter(entry.name, kind, ignore_override=True)
        self._node.set_parameters([Parameter(entry.name, kind, [])])
        descriptor = _descriptor(entry)
        descriptor.type = kind.value
        self._node.set_descriptor(entry.name, descriptor)

    def _widen(self, parameters: list[Parameter]) -> list[Parameter]:
        """Accept 100 for a float, and an empty list of any type."""
        return [self._widened(p) for p in parameters]

    def _widened(self, p: Parameter) -> Parameter:
        if self._kinds.get(p.name) is float and p.type_ is Parameter.Type.INTEGER:
            return Parameter(p.name, Parameter.Type.DOUBLE, float(p.value))
        kind = self._lists.get(p.name)
        if kind is None or p.type_ is kind or p.type_ not in _ARRAYS:
            return p
        if not len(p.value):
            return Parameter(p.name, kind, [])
        if kind is Parameter.Type.DOUBLE_ARRAY and p.type_ is Parameter.Type.INTEGER_ARRAY:
            return Parameter(p.name, kind, [float(each) for each in p.value])
        return p

    def _set(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._change({p.name: p.value for p in parameters if p.name in self._kinds})
        except RtRobotError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

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


"""Settings of simulated devices: check what was given and fill in the defaults."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

from rt_robot_os.errors import ConfigError
from rt_robot_os.schema import Field


def complete(fields: Sequence[Field], given: Mapping[str, Any], name: str) -> dict[str, Any]:
    """
    Check settings and fill in what is absent.

    :param name: name of the device, for the errors.
    :return: a value of the declared type for each field.
    :raises ConfigError: with every problem found.
    """
    known = {field.name: field for field in fields}
    problems = [
        f'{name}: there is no setting {key!r} of a simulated device: use one of '
        f'{", ".join(known)}' for key in given if key not in known
    ]
    values = {}
    for field in fields:
        value = given.get(field.name, field.default)
        wanted = field.problem(value)
        if wanted is None:
            values[field.name] = field.coerce(value)
        else:
            problems.append(f'{name}: {field.name} is {value!r}: it must be {wanted}')
    if problems:
        raise ConfigError(problems)
    return values

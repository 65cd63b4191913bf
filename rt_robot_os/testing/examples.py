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
Many examples for the tests of a contract, made by hypothesis.

It is imported only when such a test runs: the rest of this package works without it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.needs import lacking


def strategies() -> Any:
    """
    Import the strategies of hypothesis.

    :raises RtRobotError: it is missing; the message contains the command to install it.
    """
    text = lacking('this test of the contract', 'hypothesis')
    if text:
        raise RtRobotError(text)
    from hypothesis import strategies as found
    return found


def check_with_examples(strategy: Any, check: Callable[[Any], None], count: int) -> None:
    """
    Run a check on many examples.

    :param strategy: of :func:`strategies`.
    :param count: of examples.
    """
    from hypothesis import given
    from hypothesis import HealthCheck
    from hypothesis import settings

    # Made here, because hypothesis needs a separate function for each subclass.
    @settings(max_examples=count, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(example=strategy)
    def run(example: Any) -> None:
        check(example)

    run()

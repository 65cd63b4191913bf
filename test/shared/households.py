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

"""Who lives with the robots of a test: confirmed in the database, as an administrator does."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from rt_robot_os.monitor.security.residents import Residents
from rt_robot_os.monitor.security.robots import Robots
from rt_robot_os.monitor.security.tables import robot_accounts
from rt_robot_os.monitor.security.users import AccountError


def confirm(store: Any, robot: str, *people: str) -> None:
    """Confirm who lives with a robot, whose id is its name; it gets an account if needed."""
    with suppress(AccountError):
        Robots(store.engine, store.now_ns).add(robot)
        with store.writing() as connection:
            connection.execute(robot_accounts.update().where(
                robot_accounts.c.name == robot).values(id=robot))
    Residents(store.engine, store.now_ns).confirm(robot, people, 'test')

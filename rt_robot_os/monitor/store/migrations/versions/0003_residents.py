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
Who lives with which robot is confirmed by an administrator, and no longer said by the robot.

What robots have said so far is carried over as confirmed: an upgrade must not hide the alarms of
people from their carers. ``monitor robot people`` shows it for review.
"""

from __future__ import annotations

from typing import Final

from alembic import op
from sqlalchemy import BigInteger
from sqlalchemy import Boolean
from sqlalchemy import Column
from sqlalchemy import false
from sqlalchemy import String
from sqlalchemy import text

revision: Final = '0003'
down_revision: Final = '0002'


def upgrade() -> None:
    """Add the columns, and confirm what there is."""
    op.add_column('robots', Column('residents', String(16), nullable=False, server_default=''))
    op.add_column('robot_people', Column('lives', Boolean, nullable=False,
                                         server_default=false()))
    op.add_column('robot_people', Column('set_ns', BigInteger, nullable=False,
                                         server_default='0'))
    op.add_column('robot_people', Column('set_by', String(64), nullable=False, server_default=''))
    connection = op.get_bind()
    connection.execute(text("UPDATE robot_people SET lives = true, set_by = 'upgrade'"))
    connection.execute(text("UPDATE robots SET residents = 'confirmed' WHERE id IN "
                            '(SELECT robot_id FROM robot_people)'))


def downgrade() -> None:
    """Drop the columns."""
    for name in ('set_by', 'set_ns', 'lives'):
        op.drop_column('robot_people', name)
    op.drop_column('robots', 'residents')

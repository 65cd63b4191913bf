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

"""Databases of both kinds."""

from __future__ import annotations

from collections.abc import Iterator

import databases
import pytest

pytest.importorskip('sqlalchemy', reason='needs sqlalchemy')
pytest.importorskip('alembic', reason='needs alembic')

from rt_robot_os.monitor.store.store import Store  # noqa: E402

NOW_NS = 1_800_000_000_000_000_000


@pytest.fixture(scope='session')
def all_databases(tmp_path_factory: pytest.TempPathFactory) -> Iterator[databases.Databases]:
    """Give fresh databases; PostgreSQL is started by who asks first."""
    with databases.lazily() as server:
        yield databases.Databases(tmp_path_factory.mktemp('databases'), server)


@pytest.fixture(params=['sqlite', 'postgresql'])
def url(request: pytest.FixtureRequest, all_databases: databases.Databases) -> Iterator[str]:
    """Give the URL of a database with the tables of this release."""
    made = all_databases.fresh(request.param)
    yield made
    all_databases.drop(made)


@pytest.fixture
def store(url: str) -> Iterator[Store]:
    """Give a store whose clock stands."""
    found = Store.open(url, lambda: NOW_NS)
    yield found
    found.close()

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

"""One server on a database, and one key for its audit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import databases
from monitor_server import quick_services
import pytest
from rt_robot_os.base.errors import StartError
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.audit import CONSOLE
from rt_robot_os.monitor.server import make_services
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.settings import MonitorSettings
from rt_robot_os.monitor.store import sole_server
from rt_robot_os.monitor.store.sole_server import SoleServer
from rt_robot_os.monitor.store.store import Store


@pytest.fixture(scope='module')
def all_databases(tmp_path_factory: pytest.TempPathFactory) -> Iterator[databases.Databases]:
    with databases.lazily() as server:
        yield databases.Databases(tmp_path_factory.mktemp('databases'), server)


def end(services: Services) -> None:
    services.writer.close()
    services.accounts.close()
    services.store.close()


@pytest.mark.parametrize('kind', ['sqlite', 'postgresql'])
def test_a_second_server_on_a_database_is_refused_until_the_first_has_ended(
        kind: str, all_databases: databases.Databases, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sole_server, 'WAIT_S', 0.0)
    url = all_databases.fresh(kind)
    (tmp_path / '1').mkdir()
    first = quick_services(tmp_path / '1', database=url)
    first.audit.note(CONSOLE, 'test', 'first')
    for folder in ('1', '2'):
        settings = MonitorSettings(port=0, where=tmp_path / folder, database=url)
        with pytest.raises(StartError, match='another server uses it.*(process|this machine)'):
            make_services(settings)
    other = Store.open(url)  # as a command does, which may
    assert other.robots() == first.store.robots()
    other.close()
    assert first.audit.verify().is_whole
    end(first)
    end(make_services(MonitorSettings(port=0, where=tmp_path / '1', database=url)))


def test_a_lost_connection_is_made_again_and_another_server_is_noticed(
        all_databases: databases.Databases) -> None:
    url = all_databases.fresh('postgresql')
    first, second = Store.open(url), Store.open(url)
    first.serve_alone()
    with all_databases.away(url):
        assert first.other_server() == ''
    assert first.other_server() == ''
    with pytest.raises(StartError, match='another server'):
        SoleServer(second.engine).acquire(0.0)
    with all_databases.away(url):
        pass
    second.serve_alone()
    assert 'another server has taken the database' in first.other_server()
    second.close()
    assert first.other_server() == ''
    first.close()


def test_an_audit_of_another_key_is_not_gone_on_with(tmp_path: Path) -> None:
    store = Store.open(str(tmp_path / 'monitor.db'))
    mine = Accounts.open(store.engine, tmp_path / 'mine')
    Accounts.open(store.engine, tmp_path / 'early').close()  # there is nothing to break yet
    mine.audit.note(CONSOLE, 'test', 'first')
    with pytest.raises(StartError, match='audit.key, is not the one'):
        Accounts.open(store.engine, tmp_path / 'other')
    mine.audit.note(CONSOLE, 'test', 'second')
    assert mine.audit.verify().is_whole
    mine.close()
    Accounts.open(store.engine, tmp_path / 'mine').close()
    store.close()

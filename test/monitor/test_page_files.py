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


"""The files of the page: small, kept as long as they are the same, none but these."""

from __future__ import annotations

from collections.abc import Iterator
import gzip
from pathlib import Path
import re
from typing import Any

import pytest

pytest.importorskip('fastapi')
pytest.importorskip('httpx')

from fastapi import FastAPI  # noqa: E402, I100
from rt_robot_os import monitor  # noqa: E402
from rt_robot_os.monitor.page_files import PageFiles  # noqa: E402
from starlette.testclient import TestClient  # noqa: E402

PAGE = Path(monitor.__file__).parent / 'page'
MOST_BYTES = 300_000


@pytest.fixture
def client() -> Iterator[Any]:
    app = FastAPI()
    app.mount('/', PageFiles(PAGE))
    with TestClient(app) as found:
        yield found


def test_what_the_first_file_names_is_kept_for_ever(client: Any) -> None:
    index = client.get('/')
    assert index.headers['cache-control'] == 'no-cache'
    named = re.findall(r'(?:href|src)="([^"]+)"', index.text)
    assert len(named) > 5
    for each in named:
        answer = client.get(f'/{each}')
        assert answer.status_code == 200, each
        assert 'immutable' in answer.headers['cache-control']


def test_a_plain_name_is_answered_in_a_few_bytes_when_it_is_the_same(client: Any) -> None:
    first = client.get('/app.js')
    assert first.headers['cache-control'] == 'no-cache'
    again = client.get('/app.js', headers={'If-None-Match': first.headers['etag']})
    assert (again.status_code, again.content) == (304, b'')


def test_a_page_of_another_release_gets_what_there_is_and_keeps_it_not(client: Any) -> None:
    old = client.get('/v/0123456789abcdef/app.js')
    assert old.status_code == 200
    assert old.headers['cache-control'] == 'no-cache'


def test_it_is_packed_for_who_can_unpack_it(client: Any) -> None:
    with client.stream('GET', '/app.js', headers={'Accept-Encoding': 'gzip'}) as answer:
        packed = b''.join(answer.iter_raw())
    plain = client.get('/app.js', headers={'Accept-Encoding': 'identity'})
    assert 'content-encoding' not in plain.headers
    assert gzip.decompress(packed) == plain.content
    assert len(packed) < len(plain.content) / 2


@pytest.mark.parametrize('path', ['../app.py', '..%2fapp.py', 'v/../../app.py', 'lib', 'lib/',
                                  'no.js', 'v/', 'v//app.py', '%2e%2e/settings.py'])
def test_nothing_else_is_served(client: Any, path: str) -> None:
    assert client.get(f'/{path}').status_code == 404


def test_the_whole_page_is_light() -> None:
    files = [each for each in PAGE.rglob('*.*')
             if each.is_file() and not each.name.endswith('.d.ts')]
    assert sum(len(gzip.compress(each.read_bytes(), 9)) for each in files) < MOST_BYTES

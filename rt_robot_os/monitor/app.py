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

"""The server as an ASGI application: endpoints, the page, errors, background tasks."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from collections.abc import Mapping
from contextlib import asynccontextmanager
import logging
from pathlib import Path
from typing import Any
from typing import Final

from fastapi import FastAPI
from fastapi import Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from rt_robot_os.base.errors import StoreError
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.monitor.api import alarms
from rt_robot_os.monitor.api import audit
from rt_robot_os.monitor.api import browser_sockets
from rt_robot_os.monitor.api import charts
from rt_robot_os.monitor.api import commands
from rt_robot_os.monitor.api import drive
from rt_robot_os.monitor.api import export
from rt_robot_os.monitor.api import maps
from rt_robot_os.monitor.api import media
from rt_robot_os.monitor.api import observations
from rt_robot_os.monitor.api import residents as residents_api
from rt_robot_os.monitor.api import robot_sockets
from rt_robot_os.monitor.api import robots
from rt_robot_os.monitor.api import session
from rt_robot_os.monitor.api import status
from rt_robot_os.monitor.api import users
from rt_robot_os.monitor.api import voice
from rt_robot_os.monitor.api.answers import away
from rt_robot_os.monitor.api.models import ErrorAnswer
from rt_robot_os.monitor.live import residents
from rt_robot_os.monitor.page_files import PageFiles
from rt_robot_os.monitor.security.protection import protect
from rt_robot_os.monitor.services import Services
from starlette.exceptions import HTTPException

_LOG: Final = logging.getLogger('monitor')
_REFUSED: Final[dict[str, Any]] = {'model': ErrorAnswer, 'description': 'It was refused.'}
#: Period of the check that no other server has taken the database.
ALONE_S: Final = 5.0
PAGE: Final = Path(__file__).parent / 'page'
#: Modules with a ``router(services)``.
API: Final = (
    alarms,
    audit,
    browser_sockets,
    charts,
    commands,
    drive,
    export,
    maps,
    media,
    observations,
    residents_api,
    robot_sockets,
    robots,
    session,
    status,
    users,
    voice,
)


def create_app(services: Services) -> FastAPI:
    """Make the application of a server."""
    app = FastAPI(title='rt_robot_os monitor', lifespan=_lifespan(services), docs_url=None,
                  redoc_url=None, openapi_url='/api/openapi.json',
                  responses={422: _REFUSED, 'default': _REFUSED})
    app.state.services = services
    for each in API:
        app.include_router(each.router(services))
    app.exception_handler(HTTPException)(_problem)
    app.exception_handler(RequestValidationError)(_wrong_request)
    app.exception_handler(StoreError)(_no_database)
    app.exception_handler(Exception)(_defect)
    app.mount('/', PageFiles(PAGE))
    protect(app)
    return app


def _lifespan(services: Services) -> Any:
    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        services.accounts.on_revoked(services.hub.revoked)
        tasks = [asyncio.create_task(_look(services)),
                 asyncio.create_task(residents.watch(services)),
                 asyncio.create_task(services.accounts.watch()),
                 asyncio.create_task(_stay_alone(services))]
        if services.media is not None:
            tasks.append(asyncio.create_task(services.media.run_cleanup()))
        if services.story is not None:
            tasks.append(asyncio.create_task(services.story.run()))
        if services.connections is not None:
            tasks.append(asyncio.create_task(services.connections.check_timeouts()))
        try:
            yield
        finally:
            for each in tasks:
                each.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await asyncio.to_thread(services.writer.close)
            services.accounts.close()
            services.store.close()

    return lifespan


async def _look(services: Services) -> None:
    while True:
        await asyncio.sleep(services.settings.heartbeat_s / 2)
        services.hub.check_timeouts()
        services.hub.storing(services.other_server or services.writer.fault)


async def _stay_alone(services: Services) -> None:
    while True:
        await asyncio.sleep(ALONE_S)
        found = await asyncio.to_thread(services.store.other_server)
        if found and not services.other_server:
            _LOG.error('%s', found)
        services.other_server = found


def _answer(status: int, text: str, remedy: str, headers: Mapping[str, str] | None = None,
            **more: object) -> JSONResponse:
    detail = {'text': text, 'remedy': remedy, **more}
    detail['codes'] = codes_of(detail, ('text', 'remedy'))
    return JSONResponse({'detail': detail}, status, headers)


async def _problem(request: Request, error: HTTPException) -> JSONResponse:
    detail: object = error.detail
    found = detail if isinstance(detail, dict) and 'text' in detail else {'text': str(detail)}
    remedy = found.get('remedy') or 'see docs/monitor.md for what there is'
    return _answer(error.status_code, **{**found, 'remedy': remedy}, headers=error.headers)


async def _wrong_request(request: Request, error: RequestValidationError) -> JSONResponse:
    lines = [f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in error.errors()[:8]]
    return _answer(422, '; '.join(lines), 'see /api/openapi.json for what it takes')


async def _no_database(request: Request, error: StoreError) -> JSONResponse:
    return await _problem(request, away(error))


async def _defect(request: Request, error: Exception) -> JSONResponse:
    return _answer(500, 'a defect of the server', 'its log says more; please report it')

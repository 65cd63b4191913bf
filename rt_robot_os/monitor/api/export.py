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

"""Export of observations as CSV and as a FHIR R4 bundle; each export is in the audit."""

from __future__ import annotations

from collections.abc import Iterator
import re
import threading
from typing import Annotated
from typing import Final

from fastapi import APIRouter
from fastapi import Depends
from fastapi import Query
from fastapi.responses import StreamingResponse
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.api.alarms import Time
from rt_robot_os.monitor.api.alarms import TIME_MOST
from rt_robot_os.monitor.api.answers import away
from rt_robot_os.monitor.api.answers import refusal
from rt_robot_os.monitor.api.answers import unknown
from rt_robot_os.monitor.live.rights import names_of
from rt_robot_os.monitor.live.rights import SOMEBODY
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.store.export import as_csv
from rt_robot_os.monitor.store.export import as_fhir
from rt_robot_os.monitor.store.export import Clean
from rt_robot_os.monitor.store.export import rows

#: Most concurrent exports: each takes a thread and a part of a CPU.
EXPORTS_MOST: Final = 2
Sign = Annotated[str | None, Query(max_length=100)]


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter(prefix='/api/people', tags=['export'])
    free = threading.BoundedSemaphore(EXPORTS_MOST)

    def begin(actor: Actor, person: str, how: str, sign: str | None, start: int, end: int
              ) -> Clean:
        """Write it to the audit, and return a function that hides other people's names."""
        if not actor.may_see(person):
            raise unknown('person')
        try:
            # Without the row in the audit the data must not be read.
            services.audit.read(actor, 'health.read', person, sign=sign or 'all')
            everybody = frozenset(each['person'] for each in services.store.people())
        except StoreError as error:
            raise away(error) from error
        if not free.acquire(blocking=False):
            raise refusal(503, f'{EXPORTS_MOST} exports are being written already',
                          'try again in a minute')
        services.audit.note(actor, 'health.export', person, format=how, sign=sign or 'all',
                            start_ns=start, end_ns=end)
        hidden = services.hub.rights_of(actor).hidden(everybody)
        return (lambda text: names_of(hidden).sub(SOMEBODY, text)) if hidden else str

    def answer(parts: Iterator[str], kind: str, person: str, ending: str) -> StreamingResponse:
        name = re.sub(r'[^\w.-]+', '_', person, flags=re.ASCII)[:60] or 'person'
        return StreamingResponse(_Export(parts, free), media_type=kind, headers={
            'Content-Disposition': f'attachment; filename="{name}.{ending}"',
            'Cache-Control': 'no-store', 'X-Content-Type-Options': 'nosniff'})

    @found.get('/{person:path}/export.csv')
    def export_csv(person: str, sign: Sign = None, start: Time = 0, end: Time = TIME_MOST,
                   actor: Actor = Depends(allowed(Permission.HEALTH))) -> StreamingResponse:
        """Return observations as CSV; ``start`` and ``end`` are UTC in ns."""
        clean = begin(actor, person, 'csv', sign, start, end)
        return answer(as_csv(rows(services.store, person, sign, start, end), clean),
                      'text/csv; charset=utf-8', person, 'csv')

    @found.get('/{person:path}/export.json')
    def export_fhir(person: str, sign: Sign = None, start: Time = 0, end: Time = TIME_MOST,
                    actor: Actor = Depends(allowed(Permission.HEALTH))) -> StreamingResponse:
        """Return observations as a FHIR R4 bundle; ``start`` and ``end`` are UTC in ns."""
        clean = begin(actor, person, 'fhir', sign, start, end)
        found_rows = rows(services.store, person, sign, start, end)
        return answer(as_fhir(person, found_rows, services.store.now_ns(), clean),
                      'application/fhir+json', person, 'fhir.json')

    return found


class _Export(Iterator[str]):
    """Parts of an export; it releases its slot when it ends or is discarded."""

    def __init__(self, parts: Iterator[str], free: threading.BoundedSemaphore) -> None:
        self._parts = parts
        self._free: threading.BoundedSemaphore | None = free

    def __next__(self) -> str:
        try:
            return next(self._parts)
        except BaseException:
            self._end()
            raise

    def __del__(self) -> None:
        # Not in a generator's finally, which does not run if the generator was never started.
        self._end()

    def _end(self) -> None:
        free, self._free = self._free, None
        if free is not None:
            free.release()

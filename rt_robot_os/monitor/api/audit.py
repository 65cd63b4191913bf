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

"""The audit: reading it, checking its chain, and exporting it."""

from __future__ import annotations

from collections.abc import Iterator
import json
from typing import Any
from typing import Final

from fastapi import APIRouter
from fastapi import Depends
from fastapi import Query
from fastapi.responses import StreamingResponse
from rt_robot_os.messages.texts.coded import coded
from rt_robot_os.monitor.api.models import AuditRows
from rt_robot_os.monitor.api.models import AuditVerdict
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission

_AUDIT: Final = Depends(allowed(Permission.AUDIT))
_SEQ: Final = (1 << 62)


def router(services: Any) -> APIRouter:
    """Make the endpoints."""
    audit = services.audit
    found = APIRouter(prefix='/api/audit', tags=['audit'])

    @found.get('', response_model=AuditRows)
    def rows(before: int = Query(_SEQ, ge=1, le=_SEQ), limit: int = Query(100, ge=1, le=1000),
             name: str = Query('', max_length=64), action: str = Query('', max_length=64),
             actor: Actor = _AUDIT) -> dict[str, Any]:
        return {'rows': audit.rows(before=before, limit=limit, newest_first=True,
                                   name=name.replace('\0', ''),
                                   action=action.replace('\0', '')),
                'waiting': audit.waiting, 'lost': audit.lost}

    @found.get('/verify', response_model=AuditVerdict)
    def verify(actor: Actor = _AUDIT) -> dict[str, Any]:
        verdict = audit.verify()
        audit.note(actor, 'audit.verify', 'audit', rows=verdict.rows, problems=verdict.problems)
        return {'rows': verdict.rows, 'head': verdict.head, 'whole': verdict.is_whole,
                'problems': verdict.problems, 'codes': [coded(each) for each in verdict.problems]}

    @found.get('/export')
    def export(actor: Actor = _AUDIT) -> StreamingResponse:
        audit.note(actor, 'audit.export', 'audit')
        return StreamingResponse(lines(audit), media_type='application/jsonl', headers={
            'Content-Disposition': 'attachment; filename="audit.jsonl"'})

    return found


def lines(audit: Any) -> Iterator[str]:
    """Write the audit as lines of JSON."""
    for row in audit.all_rows():
        yield json.dumps(row, ensure_ascii=False) + '\n'

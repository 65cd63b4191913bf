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

"""The status of the server: queues, drops, failures, and all other counters."""

from __future__ import annotations

from collections.abc import Iterator
import time
from typing import Any

from fastapi import APIRouter
from fastapi import Depends
from fastapi.responses import PlainTextResponse
from rt_robot_os.monitor.api.models import ServerHealth
from rt_robot_os.monitor.api.models import ServerStatus
from rt_robot_os.monitor.connections import Connections
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter(tags=['status'])
    started_ns = time.time_ns()

    @found.get('/healthz', response_model=ServerHealth)
    async def healthz() -> dict[str, bool]:
        """Report that the server runs, and whether it can store records, for monitoring."""
        return {'ok': True, 'storing': not services.writer.fault}

    @found.get('/api/status', response_model=ServerStatus)
    async def status(actor: Actor = Depends(allowed(Permission.SEE))) -> dict[str, Any]:
        """Return the status of the server, and counters of the robots that the user may see."""
        hub = services.hub
        writer = services.writer
        connections = services.connections or Connections(0)
        robots = [{'id': each.id, 'name': each.name, 'connected': each.connected,
                   'lost': each.lost, 'counts': each.counts}
                  for each in hub.seen(hub.rights_of(actor))]
        return {'utc_ns': time.time_ns(), 'started_ns': started_ns,
                'connections': {'open': connections.open, **connections.counts},
                'clients': {'connected': len(hub.clients), **hub.counts},
                'storing': {'ok': not writer.fault, 'text': writer.fault,
                            'waiting': writer.waiting, 'commits': writer.commits,
                            'failures': writer.failures, 'records': dict(services.store.counts)},
                'media': services.media.status() if services.media is not None else {},
                'robots': robots}

    @found.get('/metrics', response_class=PlainTextResponse)
    async def metrics(actor: Actor = Depends(allowed(Permission.ADMIN))) -> str:
        """Return the same as text for a monitoring program such as Prometheus."""
        return '\n'.join(_metrics(services)) + '\n'

    return found


def _metrics(services: Services) -> Iterator[str]:
    hub, writer = services.hub, services.writer
    connections = services.connections or Connections(0)
    yield f'monitor_connections {connections.open}'
    for key, value in connections.counts.items():
        yield f'monitor_connections_{key}_total {value}'
    yield f'monitor_clients {len(hub.clients)}'
    for key, value in hub.counts.items():
        yield f'monitor_clients_{key}_total {value}'
    yield f'monitor_storing {int(not writer.fault)}'
    for key in ('waiting', 'commits', 'failures'):
        yield f'monitor_writer_{key} {getattr(writer, key)}'
    for key, value in services.store.counts.items():
        yield f'monitor_records_{key}_total {value}'
    for each in hub.robots.values():
        label = each.id.replace('\\', r'\\').replace('"', r'\"').replace('\n', r'\n')
        yield f'monitor_robot_connected{{robot="{label}"}} {int(each.connected)}'
        for key, value in each.counts.items():
            yield f'monitor_robot_{key}_total{{robot="{label}"}} {value}'

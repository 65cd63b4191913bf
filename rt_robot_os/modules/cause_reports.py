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

"""The active causes of a module: published when they change, and again while they are active."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import CAUSE_BYTES
from rt_robot_os.messages.cause import CAUSES_DEPTH
from rt_robot_os.messages.cause import CAUSES_MESSAGE
from rt_robot_os.messages.cause import CAUSES_TOPIC
from rt_robot_os.topics import Publisher
from rt_robot_os.topics.ports import Output

#: The output of a module that reports causes: ``causes = CAUSES_OUTPUT`` in its class.
CAUSES_OUTPUT: Final = Output(
    CAUSES_TOPIC, CAUSES_MESSAGE, tail=CAUSE_BYTES, depth=CAUSES_DEPTH, most_hz=1.0)
#: Period at which an active cause is published again, for receivers that start later.
REFRESH_NS: Final = 10 * NS_PER_S


class CauseReports:
    """
    Keeps the active causes of a module, and publishes them.

    A cause is identified by its kind and its subject. It is published when it begins, when its
    level changes, when it clears, and every ten seconds while it is active; a new text or value is
    part of the next of these. Safe in the real-time loop.

    :ivar reports: publications.
    :ivar refused: reports that were dropped, for want of room.
    """

    def __init__(self, publisher: Publisher, source: str, most: int = 64) -> None:
        """
        Begin without a cause.

        :param publisher: of :data:`CAUSES_OUTPUT`.
        :param source: name of the module, for the causes.
        :param most: active causes. A worse cause then replaces the least severe one, which is
            published as cleared; another one is refused. Both are counted.
        """
        self._publisher = publisher
        self._source = source
        self._most = most
        self._active: dict[tuple[str, str], Cause] = {}
        self._due_ns: dict[tuple[str, str], int] = {}
        self.reports = self.refused = 0

    def report(self, cause: Cause, stamp_ns: int) -> bool:
        """
        Update a cause; publish it if that is news.

        :param cause: active or cleared; its ``source`` is filled in.
        :param stamp_ns: since when: of the sample, or the deadline that has passed.
        :return: whether it was published.
        """
        key = cause.kind, cause.subject
        before = self._active.get(key)
        cause = cause.of_source(self._source)
        if not cause.active:
            if before is None:
                return False
            del self._active[key], self._due_ns[key]
            self._publish(cause, stamp_ns)
            return True
        if before is None and not self._has_room(cause, stamp_ns):
            self.refused += 1
            return False
        self._active[key] = cause
        if before is not None and before.level == cause.level:
            return False
        self._due_ns[key] = stamp_ns + REFRESH_NS
        self._publish(cause, stamp_ns)
        return True

    def end(self, kind: str, subject: str, stamp_ns: int, text: str = '') -> bool:
        """
        Clear a cause, whatever its level.

        :param text: the reason; by default the text of the cause.
        :return: whether it was active until now.
        """
        before = self._active.get((kind, subject))
        if before is None:
            return False
        return self.report(replace(before, active=False, text=text or before.text), stamp_ns)

    def active(self, kind: str, subject: str) -> Cause | None:
        """Return a cause that is active."""
        return self._active.get((kind, subject))

    def refresh(self, now_ns: int) -> None:
        """Publish causes again that were not published for ten seconds; call it in every step."""
        for key, due_ns in list(self._due_ns.items()):
            if due_ns <= now_ns:
                # On the grid of its first report, whenever the module comes to run: so the stamps
                # are the same in a replay.
                stamp_ns = now_ns - (now_ns - due_ns) % REFRESH_NS
                self._due_ns[key] = stamp_ns + REFRESH_NS
                self._publish(self._active[key], stamp_ns)

    @property
    def due_ns(self) -> float:
        """When :meth:`refresh` has something to publish; infinite without a cause."""
        return min(self._due_ns.values(), default=math.inf)

    def statistics(self) -> Mapping[str, Any]:
        """Return counters for ``/diagnostics``."""
        return {'causes': len(self._active), 'cause_reports': self.reports,
                'causes_refused': self.refused}

    def _has_room(self, cause: Cause, stamp_ns: int) -> bool:
        if len(self._active) < self._most:
            return True
        mildest = min(self._active.values(), key=lambda each: each.level)
        if mildest.level >= cause.level:
            return False
        self.refused += 1
        return self.end(mildest.kind, mildest.subject, stamp_ns, 'given up for a worse cause')

    def _publish(self, cause: Cause, stamp_ns: int) -> None:
        self._publisher.msg.data = cause.to_json()
        self._publisher.publish(stamp_ns)
        self.reports += 1

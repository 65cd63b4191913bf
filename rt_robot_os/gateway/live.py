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
The present signals: only the newest value of each counts, and only changes are sent.

The server acknowledges the last message with ``taken``; until then newer values replace older
ones. So a poor network makes signals less frequent, but never outdated.
"""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from functools import partial
import threading
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.base.schema import star_match
from rt_robot_os.gateway.convert import value_of
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.reading import Sample
from rt_robot_os.gateway.robot_link import utc_of
from rt_robot_os.messages.texts.signals import codes_of_signals
from rt_robot_os.messages.uplink.live import LiveReceived
from rt_robot_os.messages.uplink.live import LiveSignals
from rt_robot_os.messages.uplink.live import WantedSignals
from rt_robot_os.messages.uplink.messages import MESSAGE_BYTES
from rt_robot_os.messages.uplink.messages import UplinkMessage

#: Most messages in flight.
CREDIT: Final = 2
#: Without ``taken`` for this long one more is sent: the server may have lost one.
PATIENCE_S: Final = 5.0
FASTEST_HZ: Final = 30.0
_SIGNALS_MOST: Final = 1024
_BYTES_MOST: Final = MESSAGE_BYTES // 4
#: Signals whose topic has another name.
_NAMES: Final = {'odom': 'speed'}
#: Large signals, which are sent only while a page shows them.
_ON_DEMAND: Final = frozenset({'scan'})


class Live(Part):
    """
    The table of signals, thinned to the capacity of the network.

    :ivar sent: sent messages.
    :ivar passed_over: samples that a newer one replaced before they were sent.
    """

    receives = (LiveReceived, WantedSignals)

    def __init__(self, context: GatewayContext) -> None:
        super().__init__(context)
        self.sent = self.passed_over = self.faulty = 0
        self._rates = context.settings.live_rates()
        self._hz = context.settings.idle_hz
        self._wanted: tuple[str, ...] | None = None
        self._lock = threading.Lock()
        self._new: dict[str, tuple[str, str, int, bytes]] = {}
        self._known: dict[str, tuple[str, str, int, bytes]] = {}
        self._n = self._taken = 0
        self._sent_s = 0.0
        context.robot.limit_hz = self._hz

    # ---- from the robot ----------------------------------------------------------------------

    def reads(self) -> Sequence[Reads]:
        """Read the shown topics; the first matching line determines the rate."""
        return [Reads(topic, partial(self._take, at), rate_hz=rate, shown=True)
                for at, (topic, rate) in enumerate(self._rates) if rate]

    def _take(self, at: int, sample: Sample) -> None:
        if any(star_match(topic, sample.topic) is not None for topic, _ in self._rates[:at]):
            return  # an earlier line determines the rate
        name = _NAMES.get(sample.topic, sample.topic)
        with self._lock:
            self.passed_over += name in self._new
            if name in self._known or len(self._known) < _SIGNALS_MOST:
                self._new[name] = self._known[name] = (
                    sample.topic, sample.type, utc_of(sample.stamp_ns), bytes(sample.cdr))

    # ---- to the server -----------------------------------------------------------------------

    def met_server(self) -> None:
        """Begin with all known signals."""
        self._taken = self._n
        with self._lock:
            self._new = dict(self._known)
        self._set_rate(self.context.settings.idle_hz, None)

    def lost_server(self) -> None:
        """Limit the rate to that of a robot that no page shows."""
        self._set_rate(self.context.settings.idle_hz, None)

    def receive(self, message: UplinkMessage) -> None:
        """Receive a credit, or the watched signals and their rate."""
        if isinstance(message, LiveReceived):
            if not self._taken <= message.n <= self._n:
                raise ValueError(f'n = {message.n}, but {self._n} was the last')
            self._taken = message.n
        elif isinstance(message, WantedSignals):
            self._set_rate(max(self.context.settings.idle_hz, min(message.signals_hz, FASTEST_HZ)),
                           message.signals)

    def _set_rate(self, hz: float, wanted: tuple[str, ...] | None) -> None:
        self._hz, self._wanted = hz, wanted
        self.context.robot.limit_hz = hz  # the core need not send what no page shows

    def next_text(self) -> str | None:
        """Make the next message when one is due and there is credit; for the sender."""
        message = self.next_message()
        return None if message is None else message.to_json()

    def next_message(self) -> LiveSignals | None:
        """Make the next message; None when there is nothing."""
        now_s = time.monotonic()
        if now_s - self._sent_s < 1.0 / self._hz:
            return None
        if self._n - self._taken >= CREDIT and now_s - self._sent_s < PATIENCE_S:
            return None
        with self._lock:
            found = {name: each for name, each in self._new.items() if self._is_wanted(name)}
            room = _BYTES_MOST
            for name, each in found.items():
                room -= len(each[3])
                if room >= 0 or len(each[3]) > _BYTES_MOST:
                    del self._new[name]
        signals = {name: made for name, each in found.items()
                   if name not in self._new and (made := self._signal(each)) is not None}
        if not signals:
            return None
        signals.update(codes_of_signals(signals))
        self._n += 1
        self.sent += 1
        self._sent_s = now_s
        return LiveSignals(self._n, time.time_ns(), signals)

    def _is_wanted(self, name: str) -> bool:
        if name not in _ON_DEMAND:
            return True
        if self._wanted is None:
            return self._hz > self.context.settings.idle_hz
        return any(fnmatchcase(name, each) for each in self._wanted)

    def _signal(self, new: tuple[str, str, int, bytes]) -> list[Any] | None:
        topic, type_name, utc_ns, cdr = new
        try:
            return [utc_ns, value_of(topic, type_name, cdr)]
        except (ValueError, LayoutError, LookupError, TypeError) as error:
            self.faulty += 1
            if self.faulty == 1:
                self.context.tell(f'{topic}: {error}')
            return None

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        return {'live_sent': self.sent, 'live_passed_over': self.passed_over,
                'live_hz': self._hz, 'live_faulty': self.faulty}

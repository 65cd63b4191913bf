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
The application of a live mote: it measures, sends, and executes commands of the host.

Commands are Surge's. Surge's version for telos does not define how they reach nodes out of the
sink's range. Here the sink floods them: each node forwards each command twice, because broadcasts
are not acknowledged.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from struct import calcsize
from struct import Struct
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.conversions import battery_raw
from rt_robot_os.features.wsn.packets.conversions import CONVERSIONS
from rt_robot_os.features.wsn.packets.message import Message
from rt_robot_os.features.wsn.packets.oscilloscope import MULTIHOP_READINGS
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.payload import PayloadField
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.surge import SurgeCmdT2
from rt_robot_os.features.wsn.packets.surge import SurgeMsg
from rt_robot_os.features.wsn.packets.surge import SurgeType
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Received
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.simulator.live_readings import NodeReadings
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.mote import Traffic
from rt_robot_os.messages.quantities import ALARMS

_NS_PER_S: Final = 1_000_000_000
_NS_PER_MS: Final = 1_000_000
_U16: Final = 0xFFFF
_NO_PARENT: Final = 0xFFFF
_FULL_V: Final = 3.0
# Factor by which a node in focus sends more often, and the others less often.
_FOCUS: Final = 4
_COMMANDS_KEPT: Final = 8
_REPEATS: Final = 3
_RELAYS: Final = 2
_REPEAT_NS: Final = 200 * _NS_PER_MS
_SPREAD_NS: Final = 80 * _NS_PER_MS
# Delay before an alarm is sent again after a full queue.
_AGAIN_NS: Final = 50 * _NS_PER_MS
_FASTEST_NS: Final = 10 * _NS_PER_MS


class _FloodedFields(NamedTuple):
    number: int
    target: int
    command: int
    value: int


class Flooded(Message, _FloodedFields):
    """
    A command that is flooded through the network.

    :ivar number: of the command; a node uses it to detect duplicates.
    :ivar target: its destination; 0xFFFF: all nodes.
    :ivar command: a :class:`.SurgeType`.
    :ivar value: of the command.
    """

    __slots__ = ()
    AM_TYPE = 19
    LAYOUT = Struct('<HHHI')


class CommandRouter(Router):
    """
    Wraps a routing protocol, and passes commands to a callable instead.

    :param router: the protocol.
    :ivar command: called with frames that contain commands.
    """

    def __init__(self, router: Router) -> None:
        self._router = router
        self.command: Callable[[Received], None] = lambda frame: None

    @property
    def root(self) -> bool:  # type: ignore[override]
        """Return whether it is on the sink."""
        return self._router.root

    @property
    def parent(self) -> int | None:  # type: ignore[override]
        """Return the next hop towards the sink."""
        return self._router.parent

    @property
    def cost(self) -> int:  # type: ignore[override]
        """Return the cost of the whole path."""
        return self._router.cost

    @property
    def hops(self) -> int:  # type: ignore[override]
        """Return the number of hops to the sink."""
        return self._router.hops

    @property
    def counters(self) -> dict[str, int]:  # type: ignore[override]
        """Return the counters of the protocol."""
        return self._router.counters

    def start(self) -> None:
        """Begin."""
        self._router.start()

    def stop(self) -> None:
        """End."""
        self._router.stop()

    def receive(self, frame: Received) -> None:
        """Receive a frame for this node, or a broadcast."""
        if frame.am_type in (Flooded.AM_TYPE, SurgeCmd.AM_TYPE):
            self.command(frame)
        else:
            self._router.receive(frame)

    def originate(self, application: bytes) -> bool:
        """Send a packet of the application to the sink."""
        return self._router.originate(application)


class SnoopingCommandRouter(CommandRouter):
    """The same for a protocol that snoops frames for other nodes."""

    def snoop(self, frame: Received) -> None:
        """Receive a frame for another node."""
        self._router.snoop(frame)


def command_router(router: Router) -> CommandRouter:
    """Wrap a protocol so that it does not receive commands."""
    return (CommandRouter if type(router).snoop is Router.snoop else SnoopingCommandRouter)(router)


class Flood:
    """
    Floods commands through the network; the part of one mote.

    :param mote: its mote, whose router is a :class:`CommandRouter`.
    :param big_endian: byte order of unmodified commands: that of TinyOS 2.x.
    :param obey: called with commands for this mote.
    """

    def __init__(self, mote: Mote, big_endian: bool,
                 obey: Callable[[int, int], None] | None = None) -> None:
        self._mote = mote
        self._command = SurgeCmdT2 if big_endian else SurgeCmd
        self._obey = obey
        self._known: deque[int] = deque(maxlen=_COMMANDS_KEPT)
        self._waiting: deque[bytes] = deque(maxlen=_COMMANDS_KEPT * _REPEATS)
        self._number = 0
        self._sender = mote.sender(lambda acknowledged: None)
        self._timer = mote.timer(self._send)
        if isinstance(mote.router, CommandRouter):
            mote.router.command = self.take

    def begin(self, target: int, payload: bytes) -> bool:
        """
        Broadcast a command of the host a few times.

        :return: False if it is not a command.
        """
        try:
            command = self._command.unpack(payload)
        except ValueError:
            return False
        self._number = (self._number + 1) & _U16
        flooded = Flooded(self._number, target, command.command, command.value)
        self._waiting.extend([flooded.pack()] * _REPEATS)
        self._timer.start(1)
        return True

    def take(self, frame: Received) -> None:
        """Execute a command if it is for this mote, and forward it."""
        if self._mote.is_root:
            return
        try:
            if frame.am_type == SurgeCmd.AM_TYPE:
                direct = self._command.unpack(frame.payload)
                self._do(direct.command, direct.value)
                return
            flooded = Flooded.unpack(frame.payload)
        except ValueError:
            return
        if flooded.number in self._known:
            return
        self._known.append(flooded.number)
        if flooded.target in (BROADCAST, self._mote.address):
            self._do(flooded.command, flooded.value)
        self._waiting.extend([flooded.pack()] * _RELAYS)
        self._timer.start(1 + int(self._mote.random.random() * _SPREAD_NS))

    def _do(self, command: int, value: int) -> None:
        if self._obey is not None:
            self._obey(command, value)

    def _send(self) -> None:
        if not self._waiting:
            return
        if self._sender.send(BROADCAST, Flooded.AM_TYPE, self._waiting[0], False):
            self._waiting.popleft()
        if self._waiting:
            self._timer.start(_REPEAT_NS + int(self._mote.random.random() * _SPREAD_NS))


def field_value(field: PayloadField, reading: float) -> Any:
    """Return the value of a field for a reading: limited to its range, repeated for an array."""
    count, code = int(field.code[:-1] or 1), field.code[-1]
    if field.conversion:
        raw: float = CONVERSIONS[field.conversion].raw(reading)
    else:
        raw = (reading - field.offset) / field.scale
    if code not in 'fd':
        bits = 8 * calcsize('<' + code)
        low = 0 if code.isupper() else -2 ** (bits - 1)
        raw = min(max(round(raw), low), low + 2 ** bits - 1)
        if code == '?':
            return bool(raw)
    return raw if count == 1 else (raw,) * count


class NodeApplication:
    """
    Measures and sends periodically, one quantity after the other.

    A node whose button is pressed sends an alarm immediately, then with every second packet; so
    does one that detects smoke or water.

    :param mote: its mote.
    :param readings: its sensors.
    :param payload: ``data`` (of the paper), ``surge``, ``oscilloscope`` or a user-defined one. A
        node that measures none of its fields sends no packets with a user-defined one.
    :param period_ns: between two packets.
    """

    def __init__(self, mote: Mote, quantities: tuple[str, ...], readings: NodeReadings,
                 payload: str | Payload, period_ns: int, big_endian: bool) -> None:
        self._mote = mote
        self._quantities = quantities
        self._alarms = tuple(each for each in quantities if each in ALARMS)
        self._readings = readings
        self._own = payload if isinstance(payload, Payload) else None
        self._big_endian = big_endian
        self._pack: Callable[[str, float], bytes] = {
            'data': self._data, 'surge': self._surge, 'oscilloscope': self._oscilloscope,
        }.get(str(payload), self._of_own)
        self._is_mute = self._own is not None and not {
            each.quantity for each in self._own.fields}.intersection(quantities)
        self._usual_ns = self._period_ns = period_ns
        self._sleeps = False
        self._seq_no = self._turn = self._boots = 0
        # Active alarms, and changes that were not sent yet.
        self._pressed: tuple[str, ...] = ()
        self._untold: list[str] = []
        self._urgent = mote.timer(self._send_alarm)
        self._set_traffic()
        self.flood = Flood(mote, big_endian, self.obey)

    def alarm(self, before: Mapping[str, int], now: Mapping[str, int]) -> None:
        """Send a change of its button or of its smoke and water sensors immediately."""
        self._pressed = tuple(each for each in self._alarms if each in now)
        if self._is_mute:
            return
        for each in self._alarms:
            if before.get(each) != now.get(each) and each not in self._untold:
                self._untold.append(each)
        if self._untold:
            self._urgent.start(1)

    def obey(self, command: int, value: int) -> None:
        """Execute a command; an invalid one has no effect."""
        if command == SurgeType.SET_RATE and value:
            self._period_ns = max(round(value * BINARY_MS_NS), _FASTEST_NS)
        elif command == SurgeType.SLEEP:
            self._sleeps = True
        elif command == SurgeType.WAKE_UP:
            self._sleeps, self._period_ns = False, self._usual_ns
        elif command == SurgeType.FOCUS:
            looked_at = value & _U16 == self._mote.address
            self._period_ns = self._usual_ns // _FOCUS if looked_at else self._usual_ns * _FOCUS
        elif command == SurgeType.UNFOCUS:
            self._period_ns = self._usual_ns
        else:
            return
        self._set_traffic()

    def _set_traffic(self) -> None:
        mute = self._sleeps or self._is_mute
        self._mote.traffic = None if mute else Traffic(self._period_ns, self._build)

    def _send_alarm(self) -> None:
        if self._mote.originate(self._packet(self._untold[0])):
            del self._untold[0]
        if self._untold:
            self._urgent.start(_AGAIN_NS)

    def _build(self, mote: Mote, number: int) -> bytes:
        """Create the packet of the next quantity."""
        if mote.boots != self._boots:
            # After a reboot the commands from before are lost.
            self._boots, self._seq_no, self._turn = mote.boots, 0, 0
            if self._period_ns != self._usual_ns:
                self._period_ns = self._usual_ns
                self._set_traffic()
        turn, self._turn = self._turn, self._turn + 1
        if self._pressed and turn % 2:
            return self._packet(self._pressed[turn // 2 % len(self._pressed)])
        return self._packet(self._quantities[turn % len(self._quantities)])

    def _packet(self, quantity: str) -> bytes:
        packet = self._pack(quantity, self._mote.queue.now_ns / _NS_PER_S)
        self._seq_no = (self._seq_no + 1) & 0xFFFFFFFF
        return packet

    def _battery_v(self) -> float:
        battery = self._mote.battery
        return battery.voltage_v if battery is not None else _FULL_V

    def _parent(self) -> int:
        parent = self._mote.router.parent
        return _NO_PARENT if parent is None else parent

    def _data(self, quantity: str, now_s: float) -> bytes:
        volts = self._battery_v()
        kind, raw = self._readings.raw(quantity, now_s, volts)
        return DataMsg(0, raw, self._parent(), self._seq_no, kind, battery_raw(volts)).pack()

    def _surge(self, quantity: str, now_s: float) -> bytes:
        """Send the reading of a converter, light if measured: Surge does not send the kind."""
        _, raw = self._readings.raw(self._plain(), now_s, self._battery_v())
        return SurgeMsg(0, raw, self._parent(), self._seq_no).pack()

    def _oscilloscope(self, quantity: str, now_s: float) -> bytes:
        raws = tuple(self._readings.raw(self._plain(), now_s, self._battery_v())[1]
                     for _ in range(MULTIHOP_READINGS))
        interval = min(round(self._period_ns / BINARY_MS_NS), _U16)
        return Oscilloscope.of(0, interval, self._mote.address, self._seq_no & _U16, raws).pack()

    def _of_own(self, quantity: str, now_s: float) -> bytes:
        """Send all fields of a user-defined payload; those it does not measure are 0."""
        own = self._own
        assert own is not None
        values: dict[str, Any] = {
            'origin': self._mote.address, 'seqno': self._seq_no & _U16, 'parent': self._parent(),
            'hops': self._mote.router.hops}
        volts = self._battery_v()
        for field in own.fields:
            if field.quantity in self._quantities or field.quantity == 'battery':
                values[field.name] = field_value(
                    field, self._readings.value(field.quantity, now_s, volts))
        try:
            return own.pack(values, self._big_endian)
        except ValueError:  # the field with this name has another type
            return bytes(own.size)

    def _plain(self) -> str:
        return 'light' if 'light' in self._quantities else 'battery'

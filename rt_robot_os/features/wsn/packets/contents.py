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
Parsers of the active messages of the built-in AM types.

A parser reads the payload into a :class:`Draft`; it raises ValueError with the problem, and the
draft keeps what was read until then.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.features.wsn.packets import paper
from rt_robot_os.features.wsn.packets.conversions import battery_volts
from rt_robot_os.features.wsn.packets.conversions import centikelvin
from rt_robot_os.features.wsn.packets.conversions import par_illuminance
from rt_robot_os.features.wsn.packets.conversions import same
from rt_robot_os.features.wsn.packets.conversions import sht1x_humidity
from rt_robot_os.features.wsn.packets.conversions import sht1x_temperature
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.debug import CollectionDebug
from rt_robot_os.features.wsn.packets.debug import LqiDebug
from rt_robot_os.features.wsn.packets.multihop_lqi import BeaconMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.multihop_lqi import MicaMultihopMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.neighbour_tables import DEBUG_PACKET_TYPE
from rt_robot_os.features.wsn.packets.neighbour_tables import DebugPacket
from rt_robot_os.features.wsn.packets.neighbour_tables import RoutePacket
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.oscilloscope import OscopeMsg
from rt_robot_os.features.wsn.packets.payload import COUNTING_FIELD
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.surge import MicaSurgeMsg
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.surge import SurgeCmdT2
from rt_robot_os.features.wsn.packets.surge import SurgeMsg
from rt_robot_os.features.wsn.packets.surge import SurgeType

DATA: Final = 'data'
BEACON: Final = 'beacon'
DEBUG: Final = 'debug'
COMMAND: Final = 'command'
ACK: Final = 'ack'
UNKNOWN: Final = 'unknown'

#: Kind of the paper's data packet -> quantity and conversion.
READINGS: Final[Mapping[int, tuple[str, Callable[[float], float]]]] = {
    paper.Kind.TEMPERATURE: ('temperature', sht1x_temperature),
    paper.Kind.HUMIDITY: ('humidity', sht1x_humidity),
    paper.Kind.LIGHT: ('light', par_illuminance),
    paper.Kind.BATTERY: ('battery', battery_volts),
    paper.Kind.PULSE: ('pulse_per_min', same),
    paper.Kind.RESPIRATION: ('respiration_per_min', same),
    paper.Kind.SPO2: ('spo2_percent', same),
    paper.Kind.BODY_TEMPERATURE: ('body_temperature', centikelvin),
    paper.Kind.ACCELERATION: ('acceleration_g', lambda raw: raw / 1000.0),
    paper.Kind.ALARM: ('alarm', same),
    paper.Kind.SMOKE: ('smoke', same),
    paper.Kind.WATER: ('water', same),
    paper.Kind.SYSTOLIC: ('systolic_mmhg', same),
    paper.Kind.DIASTOLIC: ('diastolic_mmhg', same),
    paper.Kind.OXYGEN: ('oxygen_l_per_min', lambda raw: raw / 10.0),
    paper.Kind.CONSCIOUSNESS: ('consciousness', same),
    paper.Kind.PRESENCE: ('presence', same),
    paper.Kind.NEAREST_NODE: ('nearest_node', same),
}


# Field of a custom payload -> attribute of the packet, where no header has it.
_OF_THE_PACKET: Final = (('origin', 'origin'), ('parent', 'parent'), ('hops', 'hops'),
                         ('seqno', 'origin_seqno'))


class Draft:
    """A packet while it is parsed; the attributes are those of a decoded packet."""

    __slots__ = ('source', 'origin', 'origin_seqno', 'count', 'count_bits', 'hops', 'parent',
                 'cost', 'kind', 'name', 'fields', 'readings', 'problem')

    def __init__(self, source: int) -> None:
        self.source = source
        self.origin = self.origin_seqno = self.count = self.hops = self.parent = self.cost = -1
        self.count_bits = 0
        self.kind = UNKNOWN
        self.name = self.problem = ''
        self.fields: dict[str, Any] = {}
        self.readings: dict[str, float] = {}


Reader = Callable[[bytes, Draft], None]


def multihop(payload: bytes, draft: Draft) -> bytes:
    """Parse the header of MultiHopLQI 1.x; return the bytes after it."""
    header = MultihopMsg.unpack(payload)
    draft.source, draft.origin, seqno, origin_seqno, draft.hops, data = header
    # Signed in the header; here it has 16 bits, and -1 means none.
    draft.origin_seqno = origin_seqno & 0xFFFF
    draft.fields = {'seqno': seqno, 'originseqno': origin_seqno}
    return data


def mica_multihop(payload: bytes, draft: Draft) -> bytes:
    """Parse the header of mica and mica2; return the bytes after it."""
    draft.source, draft.origin, seqno, draft.hops, data = MicaMultihopMsg.unpack(payload)
    draft.fields = {'seqno': seqno}
    return data


def read_payload(declared: Payload, data: bytes, big_endian: bool, draft: Draft) -> None:
    """Parse a custom payload."""
    draft.kind, draft.name = DATA, declared.name
    fields, draft.readings, draft.problem = declared.read(data, big_endian)
    draft.fields.update(fields)
    for name, attribute in _OF_THE_PACKET:
        value = fields.get(name)
        if isinstance(value, int) and getattr(draft, attribute) < 0:
            setattr(draft, attribute, value)
    if declared.count_bits and not draft.count_bits and COUNTING_FIELD in fields:
        draft.count, draft.count_bits = int(fields[COUNTING_FIELD]), declared.count_bits


def _t1_beacon(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = BEACON, 'multihop_lqi_beacon'
    data = multihop(payload, draft)
    if len(data) >= BeaconMsg.LAYOUT.size:
        draft.parent, draft.cost, draft.hops, stamp = BeaconMsg.unpack(data)
        draft.fields['timestamp'] = stamp
        return
    if len(data) == paper.BeaconMsg.LAYOUT.size:
        draft.name = 'least_cost_beacon'
        draft.fields['round'] = draft.origin_seqno
    else:
        draft.problem = f'truncated: {len(data)} bytes after the header, a beacon has 6 or 10'
    draft.parent, draft.cost, draft.hops = paper.BeaconMsg.unpack(data)


def _t1_surge(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = DATA, 'surge'
    data = multihop(payload, draft)
    if len(data) < paper.DataMsg.LAYOUT.size:
        surge = SurgeMsg.unpack(data)
        _surge(*surge[:3], draft)
        draft.count, draft.count_bits = surge.seq_no, 32
        draft.fields['seq_no'] = surge.seq_no
        if len(data) > SurgeMsg.LAYOUT.size:
            draft.problem = f'truncated: {len(data)} bytes after the header, SurgeMsg has 10 and' \
                            ' DataMsg 14'
        return
    draft.name = 'data_msg'
    message_type, reading, parent, seq_no, kind, voltage = paper.DataMsg.unpack(data)
    _surge(message_type, reading, parent, draft)
    draft.count, draft.count_bits = seq_no, 32
    draft.fields.update(seq_no=seq_no, kind=kind, voltage=voltage)
    found = READINGS.get(kind)
    if found is not None:
        draft.readings[found[0]] = found[1](reading)
    elif kind != paper.Kind.NONE:
        draft.problem = f'unknown kind {kind}'
    if voltage and kind != paper.Kind.BATTERY:
        draft.readings['battery'] = battery_volts(voltage)


def _surge(message_type: int, reading: int, parent: int, draft: Draft) -> None:
    draft.parent = parent
    draft.fields.update(type=message_type, reading=reading)
    if message_type == SurgeType.ROOT_BEACON:
        draft.kind = BEACON
    elif message_type > SurgeType.UNFOCUS:
        draft.problem = f'unknown message type {message_type} of Surge'
    elif message_type:
        draft.kind = COMMAND


def _mica_surge(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = DATA, 'surge'
    _surge(*MicaSurgeMsg.unpack(mica_multihop(payload, draft)), draft)


def _command(command: int, value: int, draft: Draft) -> None:
    draft.kind, draft.name = COMMAND, 'surge_command'
    draft.fields = {'command': command, 'value': value}
    if not SurgeType.SET_RATE <= command <= SurgeType.UNFOCUS:
        draft.problem = f'unknown command {command} of Surge'


def _t1_command(payload: bytes, draft: Draft) -> None:
    _command(*SurgeCmd.unpack(payload), draft)


def _mica_command(payload: bytes, draft: Draft) -> None:
    _t1_command(payload[:1] + b'\0' + payload[1:], draft)


def _t2_command(payload: bytes, draft: Draft) -> None:
    _command(*SurgeCmdT2.unpack(payload), draft)


def _t1_debug(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = DEBUG, 'estimates'
    _estimates(multihop(payload, draft), False, draft)


def _mica_debug(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = DEBUG, 'estimates'
    _estimates(mica_multihop(payload, draft), True, draft)


def _estimates(data: bytes, is_mica: bool, draft: Draft) -> None:
    draft.fields['estimates'] = [
        each._asdict() for each in DebugPacket.unpack(data, is_mica).estimates]


def _mica_beacon(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = BEACON, 'route_packet'
    beacon = RoutePacket.unpack(mica_multihop(payload, draft))
    draft.parent, draft.cost = beacon.parent, beacon.cost
    draft.fields['neighbours'] = [each._asdict() for each in beacon.neighbours()]


def _oscope(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = DATA, 'oscope'
    message = OscopeMsg.unpack(payload)
    draft.origin, draft.origin_seqno, channel, _ = message
    draft.fields = {'last_sample': message.last_sample, 'channel': channel,
                    'readings': list(message.readings)}


def _oscilloscope(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = DATA, 'oscilloscope'
    message = Oscilloscope.unpack(payload)
    version, interval, node, count, data = message
    if draft.origin < 0:
        draft.origin, draft.origin_seqno = node, count
    draft.fields.update(version=version, interval=interval, id=node, count=count,
                        readings=list(message.readings))
    if len(data) % 2:
        draft.problem = 'its last reading is truncated'


def _lqi_beacon(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name = BEACON, 'multihop_lqi_beacon'
    draft.origin, seqno, origin_seqno, draft.parent, draft.cost, draft.hops = (
        LqiBeacon.unpack(payload))
    draft.fields = {'seqno': seqno, 'originseqno': origin_seqno}


def _ctp_beacon(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name, draft.origin = BEACON, 'ctp_beacon', draft.source
    beacon = CtpBeacon.unpack(payload)
    draft.parent, draft.cost = beacon.parent, beacon.etx
    draft.fields = {'seqno': beacon.sequence, 'options': beacon.options,
                    'neighbours': [each._asdict() for each in beacon.neighbours]}


def _debug(payload: bytes, draft: Draft) -> None:
    draft.kind, draft.name, draft.origin = DEBUG, 'debug', draft.source
    found = CollectionDebug.unpack(payload)
    draft.name, draft.fields = found.name, found.fields
    if draft.name == 'new_parent':
        draft.parent, draft.cost = draft.fields['parent'], draft.fields['metric']
        draft.hops = draft.fields['hopcount']


def lqi_data(payload: bytes, draft: Draft) -> tuple[int, bytes]:
    """Parse the header of MultiHopLQI 2.x; return the application's identifier and bytes."""
    draft.kind, draft.name = DATA, 'multihop_lqi_data'
    draft.origin, seqno, draft.origin_seqno, draft.hops, collect_id, data = (
        LqiData.unpack(payload))
    draft.count, draft.count_bits = draft.origin_seqno, 16
    draft.fields = {'seqno': seqno, 'originseqno': draft.origin_seqno, 'collect_id': collect_id}
    return collect_id, data


def ctp_data(payload: bytes, draft: Draft) -> tuple[int, bytes]:
    """Parse the header of CTP; return the application's identifier and bytes."""
    draft.kind, draft.name = DATA, 'ctp_data'
    options, thl, etx, draft.origin, draft.origin_seqno, collect_id, data = (
        CtpData.unpack(payload))
    draft.count, draft.count_bits, draft.hops = draft.origin_seqno, 8, thl + 1
    if thl == 0:
        draft.cost = etx  # of the sender, which is the origin
    draft.fields = {'options': options, 'thl': thl, 'etx': etx, 'collect_id': collect_id}
    return collect_id, data


#: AM type -> parser, for motes of TinyOS 1.x with the radio CC2420.
TELOS_READERS: Final[Mapping[int, Reader]] = {
    BeaconMsg.AM_TYPE: _t1_beacon, SurgeMsg.AM_TYPE: _t1_surge, SurgeCmd.AM_TYPE: _t1_command,
    DEBUG_PACKET_TYPE: _t1_debug, OscopeMsg.AM_TYPE: _oscope}
#: For mica, mica2 and mica2dot.
MICA_READERS: Final[Mapping[int, Reader]] = {
    MicaSurgeMsg.AM_TYPE: _mica_surge, SurgeCmd.AM_TYPE: _mica_command,
    RoutePacket.AM_TYPE: _mica_beacon, DEBUG_PACKET_TYPE: _mica_debug,
    OscopeMsg.AM_TYPE: _oscope}
#: For TinyOS 2.x.
T2_READERS: Final[Mapping[int, Reader]] = {
    LqiBeacon.AM_TYPE: _lqi_beacon, CtpBeacon.AM_TYPE: _ctp_beacon,
    CollectionDebug.AM_TYPE: _debug, LqiDebug.AM_TYPE: _debug,
    Oscilloscope.AM_TYPE: _oscilloscope, SurgeCmdT2.AM_TYPE: _t2_command}
#: For TinyOS 2.x: headers of collection protocols, followed by an application's payload.
T2_COLLECTIONS: Final[Mapping[int, Callable[[bytes, Draft], tuple[int, bytes]]]] = {
    LqiData.AM_TYPE: lqi_data, CtpData.AM_TYPE: ctp_data}

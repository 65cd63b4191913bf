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
A simulated sink: the mote of a base station, and the whole network that it is the sink of.

The nodes are those of the world, where they are and as they are; the sink is where the robot is.
Without a world it is that of a little network of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.payload import installed_payloads
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.payload_text import parse_payloads
from rt_robot_os.features.wsn.packets.tos_msg import MICA
from rt_robot_os.features.wsn.packets.tos_msg import PLATFORMS
from rt_robot_os.features.wsn.packets.tos_msg import TELOS
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.routing.least_cost import LeastCost
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi1
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi2
from rt_robot_os.features.wsn.simulator.base_station import STATIONS
from rt_robot_os.features.wsn.simulator.live import LiveNetwork
from rt_robot_os.features.wsn.simulator.live import Obstacles
from rt_robot_os.features.wsn.simulator.network import RouterFactory
from rt_robot_os.features.wsn.simulator.router_factory import router_factory
from rt_robot_os.features.wsn.simulator.scenario import EnergySettings
from rt_robot_os.features.wsn.simulator.scenario import RadioSettings
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.scenario import settled
from rt_robot_os.features.wsn.simulator.scenario import TrafficSettings
from rt_robot_os.messages.survey import survey_of
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.faults import SINK_FAULTS
from rt_robot_os.sim.world.wireless import Wireless

PAPER: Final = 'paper'
MULTIHOP_LQI: Final = 'multihoplqi'
CTP: Final = 'ctp'
DATA: Final = 'data'
SURGE: Final = 'surge'
OSCILLOSCOPE: Final = 'oscilloscope'
_OF_STACK: Final = {TINYOS_1.name: (PAPER, MULTIHOP_LQI), TINYOS_2.name: (CTP, MULTIHOP_LQI)}
_SNIFFERS: Final = {TINYOS_1.name: 'tosbase', TINYOS_2.name: 'base_station'}
_ROOT: Final = 'root'
# What the simulated device knows from the section of its driver, if its own says nothing.
_OF_DRIVER: Final = ('stack', 'platform', 'mode', 'root', 'payloads')
_LONGEST_MS: Final = 3_600_000.0
_PERSON_DB: Final = 4.0
# Far apart for a radio of -25 dBm, so that some need others to reach the sink at 0, 0.
_LITTLE: Final = (
    'hall 3 0 2.2', 'kitchen 9 2 1.4', 'bed 5 -6 0.7 pulse_per_min spo2_percent alarm battery',
    'study 12 -4 1.2', 'cellar 17 1 0.5 temperature water battery')


class _Room:
    """What places are like without a world."""

    def temperature_c(self, x: float, y: float) -> float:
        """Return the temperature at a place."""
        return 21.0

    def light_lux(self, x: float, y: float) -> float:
        """Return the light at a place."""
        return 200.0

    def noticed(self, x: float, y: float) -> bool:
        """Return that nobody moves about."""
        return False


class SimulatedSink(SimulatedDevice):
    """
    A base station on a pty, and its network.

    :ivar live: the network.
    """

    SETTINGS = common_settings(100.0, 1000.0, SINK_FAULTS) + (
        Field('protocol', str, '', 'Routing of the simulated motes: paper (least cost with a '
              'moving sink) or multihoplqi under TinyOS 1.x, ctp or multihoplqi under 2.x; when '
              'absent the first.', choices=('', PAPER, MULTIHOP_LQI, CTP)),
        Field('stack', str, TINYOS_1.name, 'Generation of TinyOS, as the driver has it.',
              choices=tuple(_OF_STACK)),
        Field('mode', str, _ROOT, 'root or sniffer, as the driver has it.',
              choices=(_ROOT, 'sniffer')),
        Field('root', int, 0, 'Address of the sink, as the driver has it.', '', 0, 65533),
        Field('platform', str, TELOS, 'Family of the motes, as the driver has it.',
              choices=PLATFORMS),
        Field('group', int, -1, 'AM group of the network, as the driver has it; -1: the usual '
              'one.', '', -1, 255),
        Field('payload', str, DATA, f'What nodes send under TinyOS 1.x: {DATA} (any quantity, '
              f'with its kind and the battery) or {SURGE} (what one converter reads); under 2.x '
              f'{DATA} is MultihopOscilloscope. Or the name of one of your own payloads: nodes '
              'send it that measure something of it.'),
        Field('payloads', list, (), 'Payloads of your own, as the driver has them.'),
        Field('period_ms', float, 2000.0, 'Time between two packets of a node; it measures its '
              'quantities in turn.', 'ms', 20.0, _LONGEST_MS),
        Field('beacon_period_ms', float, 0.0, 'Time between two beacons; 0 is that of the '
              'protocol: 4 s, multihoplqi 32 s. ctp has its own.', 'ms', 0.0, _LONGEST_MS),
        Field('power_dbm', float, -25.0, 'Power of the radios: at -25 a house takes several hops.',
              'dBm', -25.0, 0.0),
        Field('height_m', float, 0.4, 'Height of the sink above the floor, in the middle of the '
              'robot.', 'm', 0.0, 10.0),
        Field('wall_db', float, 6.0, 'What each wall takes away.', 'dB', 0.0, 60.0),
        Field('person_db', float, _PERSON_DB, 'What each person takes away who stands between '
              'two nodes.', 'dB', 0.0, 60.0),
        Field('noise', str, 'quiet', 'Other radios: quiet, or heavy as beside busy Wi-Fi.',
              choices=('quiet', 'heavy')),
        Field('battery_times', float, 1.0, 'Batteries empty so many times faster.', '', 0.0, 1e6),
    )
    BAUD = 57600
    KNOWN_FAULTS = SINK_FAULTS

    @classmethod
    def made_for(
        cls, name: str, settings: Mapping[str, Any], place: RobotSite, device: Mapping[str, Any],
    ) -> SimulatedDevice:
        """
        Make the simulated counterpart of a device; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong, or does not go with another.
        """
        known = {key: device[key] for key in _OF_DRIVER if key in device}
        groups = [each for each in device.get('groups', ()) if each >= 0]
        if groups:
            known['group'] = groups[0]
        return super().made_for(name, {**known, **settings}, place, device)

    def prepare(self) -> None:
        """
        Make the network; it begins with the first bytes.

        :raises ConfigError: the protocol is none of the generation, or the platform not simulated.
        """
        s = self.settings
        scenario = self._scenario()
        payload = self._own_payload()
        world = self.world
        wireless = world.wireless if world is not None and world.wireless.nodes else Wireless(
            survey_of(_LITTLE), ())
        if s['platform'] == MICA and s['stack'] == TINYOS_1.name:
            raise ConfigError([f'{self.name}: platform = {MICA!r}: simulated motes are of the '
                               f'family {TELOS}: set that'])
        # A survey may say where the sink stands; here that is where the robot is.
        nodes = [node for node in wireless.nodes if node.surveyed.id != s['root']]
        walls = None
        if world is not None and world.map is not None:
            # Late: it needs NumPy, and most simulated devices do not.
            from rt_robot_os.features.wsn.simulator.topology import WallCount
            walls = WallCount(world.map).between
        self._frames: list[bytes] = []
        if s['mode'] != _ROOT:
            station = _SNIFFERS[s['stack']]
        elif s['stack'] == TINYOS_1.name:
            station = 'surge'
        else:
            station = 'multihop_oscilloscope' + ('_lqi' if scenario.protocol != CTP else '')
        self.live = LiveNetwork(
            nodes, scenario, _protocol(scenario, payload), STATIONS[station],
            environment=_Room() if world is None else world,
            obstacles=Obstacles(walls, s['wall_db'], self._people, s['person_db']),
            sink_position=self._position, to_host=self._to_host, baud=self._baud,
            group=s['group'], root=s['root'], times=s['battery_times'],
            payload=payload)

    def _scenario(self) -> Scenario:
        s = self.settings
        protocols = _OF_STACK[s['stack']]
        protocol = s['protocol'] or protocols[0]
        if protocol not in protocols:
            raise ConfigError([f'{self.name}: protocol = {protocol!r}: motes under {s["stack"]} '
                               f'have {" or ".join(protocols)}; or set stack'])
        usual = SURGE if s['payload'] == SURGE else DATA
        if s['stack'] != TINYOS_1.name:
            usual = OSCILLOSCOPE
        return settled(Scenario(
            protocol=protocol, tinyos=1 if s['stack'] == TINYOS_1.name else 2, seed=s['seed'],
            beacon_period_ms=(s['beacon_period_ms'] or None) if protocol != CTP else None,
            radio=RadioSettings(power_dbm=s['power_dbm'], noise=s['noise']),
            traffic=TrafficSettings(period_ms=s['period_ms'], payload=usual),
            energy=EnergySettings()))

    def _own_payload(self) -> Payload | None:
        name = self.settings['payload']
        if name in (DATA, SURGE):
            return None
        own = {each.name: each for each in (
            *installed_payloads(), *parse_payloads(self.settings['payloads']))}
        if name not in own:
            raise ConfigError([f'{self.name}: payload = {name!r}: must be {DATA}, {SURGE} or one '
                               f'of your own payloads ({", ".join(own) or "there are none"})'])
        return own[name]

    def check_speed(self) -> None:
        """Check nothing: what does not fit is lost in the mote, as it is in a real one."""

    def pump(self, now_ns: int) -> None:
        """
        Do everything that is due by now; without power the sink does nothing.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        self.live.power(not self.has_fault('reset'))
        super().pump(now_ns)

    def sample(self, time_s: float) -> bytes:
        """Let the network go on, and return what the mote has sent meanwhile."""
        self._frames.clear()
        self.live.advance(round(time_s * NS_PER_S))
        return b''.join(self._frames)

    def handle_command(self, data: bytes) -> None:
        """Hand bytes to the mote; it answers."""
        self._frames.clear()
        self.live.from_host(data)
        self.reply(b''.join(self._frames))

    def _to_host(self, data: bytes, start_ns: int) -> None:
        self._frames.append(data)

    def _position(self) -> tuple[float, float, float]:
        x, y = (0.0, 0.0) if self.world is None else self.world.base.pose[:2]
        return x, y, self.settings['height_m']

    def _people(self) -> Sequence[tuple[float, float]]:
        return () if self.world is None else [(each.x, each.y) for each in self.world.people]


def _protocol(scenario: Scenario, payload: Payload | None) -> RouterFactory:
    """Make what makes the routing of a node; packets of somebody's own have their own AM type."""
    if payload is None:
        return router_factory(scenario)
    am_type, period_ns = payload.am_type, scenario.beacon_period_ns
    if scenario.protocol == CTP:
        return lambda node, root: Ctp(node, root, collect_id=am_type)
    if scenario.protocol == PAPER:
        return lambda node, root: LeastCost(
            node, root, beacon_period_ns=period_ns, data_am_type=am_type)
    if scenario.tinyos == 1:
        return lambda node, root: MultiHopLqi1(node, root, period_ns, data_am_type=am_type)
    return lambda node, root: MultiHopLqi2(node, root, period_ns, collect_id=am_type)

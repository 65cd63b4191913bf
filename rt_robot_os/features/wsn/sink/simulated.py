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
A simulated sink: the mote of a base station, and its whole network.

The nodes are those of the world; the sink is at the position of the robot. Without a world it has
a small default network.
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
# Settings taken from the section of the driver unless the simulated device has its own.
_OF_DRIVER: Final = ('stack', 'platform', 'mode', 'root', 'payloads')
_LONGEST_MS: Final = 3_600_000.0
_PERSON_DB: Final = 4.0
# Far apart for a radio of -25 dBm, so that some need relays to reach the sink at 0, 0.
_DEFAULT_NODES: Final = (
    'hall 3 0 2.2', 'kitchen 9 2 1.4', 'bed 5 -6 0.7 pulse_per_min spo2_percent alarm battery',
    'study 12 -4 1.2', 'cellar 17 1 0.5 temperature water battery')


class _DefaultEnvironment:
    """The environment without a world."""

    def temperature_c(self, x: float, y: float) -> float:
        """Return the temperature at a place."""
        return 21.0

    def light_lux(self, x: float, y: float) -> float:
        """Return the light at a place."""
        return 200.0

    def noticed(self, x: float, y: float) -> bool:
        """Return False: there is no motion."""
        return False


class SimulatedSink(SimulatedDevice):
    """
    A base station on a pty, and its network.

    :ivar live: the network.
    """

    SETTINGS = common_settings(100.0, 1000.0, SINK_FAULTS) + (
        Field('protocol', str, '', 'Routing of the simulated motes: paper (least cost with a '
              'moving sink) or multihoplqi under TinyOS 1.x, ctp or multihoplqi under 2.x; empty: '
              'the first of these.', choices=('', PAPER, MULTIHOP_LQI, CTP)),
        Field('stack', str, TINYOS_1.name, 'Generation of TinyOS, as for the driver.',
              choices=tuple(_OF_STACK)),
        Field('mode', str, _ROOT, 'root or sniffer, as for the driver.',
              choices=(_ROOT, 'sniffer')),
        Field('root', int, 0, 'Address of the sink, as for the driver.', '', 0, 65533),
        Field('platform', str, TELOS, 'Family of the motes, as for the driver.',
              choices=PLATFORMS),
        Field('group', int, -1, 'AM group of the network, as for the driver; -1: the default.',
              '', -1, 255),
        Field('payload', str, DATA, f'Payload of the nodes under TinyOS 1.x: {DATA} (any '
              f'quantity, with its kind and the battery) or {SURGE} (one ADC channel); under 2.x '
              f'{DATA} is MultihopOscilloscope. Or the name of a user-defined payload, sent by '
              'the nodes that measure one of its quantities.'),
        Field('payloads', list, (), 'User-defined payloads, as for the driver.'),
        Field('period_ms', float, 2000.0, 'Time between two packets of a node; it measures its '
              'quantities in turn.', 'ms', 20.0, _LONGEST_MS),
        Field('beacon_period_ms', float, 0.0, 'Time between two beacons; 0: the default '
              'of the protocol, 4 s, for multihoplqi 32 s. Not for ctp.', 'ms', 0.0, _LONGEST_MS),
        Field('power_dbm', float, -25.0, 'Transmit power of the radios; at -25 dBm a house needs '
              'several hops.',
              'dBm', -25.0, 0.0),
        Field('height_m', float, 0.4, 'Height of the sink above the floor, in the middle of the '
              'robot.', 'm', 0.0, 10.0),
        Field('wall_db', float, 6.0, 'Attenuation of each wall.', 'dB', 0.0, 60.0),
        Field('person_db', float, _PERSON_DB, 'Attenuation of each person between two nodes.',
              'dB', 0.0, 60.0),
        Field('noise', str, 'quiet', 'Interference: quiet, or heavy as near busy Wi-Fi.',
              choices=('quiet', 'heavy')),
        Field('battery_times', float, 1.0, 'Factor by which batteries discharge faster.', '',
              0.0, 1e6),
    )
    BAUD = 57600
    KNOWN_FAULTS = SINK_FAULTS

    @classmethod
    def made_for(
        cls, name: str, settings: Mapping[str, Any], place: RobotSite, device: Mapping[str, Any],
    ) -> SimulatedDevice:
        """
        Create the simulated device for a driver; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong, or conflicts with another.
        """
        known = {key: device[key] for key in _OF_DRIVER if key in device}
        groups = [each for each in device.get('groups', ()) if each >= 0]
        if groups:
            known['group'] = groups[0]
        return super().made_for(name, {**known, **settings}, place, device)

    def prepare(self) -> None:
        """
        Create the network; it starts with the first bytes.

        :raises ConfigError: the protocol does not exist for the generation of TinyOS, or the
            platform is not simulated.
        """
        s = self.settings
        scenario = self._scenario()
        payload = self._own_payload()
        world = self.world
        wireless = world.wireless if world is not None and world.wireless.nodes else Wireless(
            survey_of(_DEFAULT_NODES), ())
        if s['platform'] == MICA and s['stack'] == TINYOS_1.name:
            raise ConfigError([f'{self.name}: platform = {MICA!r}: simulated motes are of the '
                               f'family {TELOS}: set it'])
        # The survey may have a position of the sink; here it is that of the robot.
        nodes = [node for node in wireless.nodes if node.surveyed.id != s['root']]
        walls = None
        if world is not None and world.map is not None:
            # Imported late: it needs NumPy, which most simulated devices do not.
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
            environment=_DefaultEnvironment() if world is None else world,
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
                               'of the user-defined payloads '
                               f'({", ".join(own) or "there are none"})'])
        return own[name]

    def check_speed(self) -> None:
        """Check nothing: the mote itself loses packets above the line rate, as a real one does."""

    def pump(self, now_ns: int) -> None:
        """
        Process everything that is due by now; without power the sink does nothing.

        :raises DeviceError: the port cannot be created again after a fault.
        """
        self.live.power(not self.has_fault('reset'))
        super().pump(now_ns)

    def sample(self, time_s: float) -> bytes:
        """Advance the network, and return the bytes that the mote has sent meanwhile."""
        self._frames.clear()
        self.live.advance(round(time_s * NS_PER_S))
        return b''.join(self._frames)

    def handle_command(self, data: bytes) -> None:
        """Pass bytes to the mote, and send its answer."""
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
    """Return the factory of routers; user-defined payloads have their own AM type."""
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

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

"""Are the bytes of another device recognised, and never those of none."""

from __future__ import annotations

import random
from typing import Any

from driver_fakes import bind
from driver_fakes import settings_of
import pytest
from rt_robot_os.base import plugins
from rt_robot_os.devices import signatures as recognise
from rt_robot_os.devices.hokuyo import wire as scip
from rt_robot_os.devices.kobuki import wire as kobuki
from rt_robot_os.devices.maxbotix.wire import reading
from rt_robot_os.devices.nmea import wire as nmea
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.devices.parts import DeviceParts
from rt_robot_os.devices.parts import Signature
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.serial import device as serial_device
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.signatures import SIGNATURES
from rt_robot_os.devices.signatures import SignatureTable
from rt_robot_os.devices.stargazer import wire as stargazer
from rt_robot_os.devices.ublox import wire as ubx
from rt_robot_os.devices.witmotion import wire as witmotion
from rt_robot_os.devices.xsens import wire as xbus
from rt_robot_os.sim.line import at_wrong_speed

identify = SIGNATURES.identify

STREAMS = {
    'nmea': nmea.sentence('GPGSV,1,1,00') * 3,
    'ublox': ubx.message(1, 7, bytes(92)) + nmea.sentence('GPGSV,1,1,00'),
    'xsens': xbus.mtdata2([(0x4020, xbus.reals((0, 0, 9.8)))]) * 2,
    'witmotion': witmotion.acceleration_frame(0, 0, 9.8) * 4,
    'maxbotix': reading(1234) * 5,
    'stargazer': stargazer.multi([stargazer.CeilingMark(48, 1.0, 2.0, 3.0, 200.0)]) * 4,
    'kobuki': kobuki.packet([kobuki.core(kobuki.CoreSensors(*range(12)))]) * 3,
    'hokuyo': scip.scan(scip.scan_command(44, 725), 0, range(1000, 1682))[300:812],
}


@pytest.mark.parametrize('driver', STREAMS)
def test_each_protocol_is_recognised_from_the_middle_of_its_stream(driver: str) -> None:
    stream = STREAMS[driver]
    text = identify(b'\x00' + stream[3:] + stream, 57600)
    assert f'at 57600 baud: set type: {driver}, or swap the ports' in text
    assert driver in DRIVERS.names()
    assert ' at ' not in identify(stream, 0)


@pytest.mark.parametrize('driver', STREAMS)
def test_at_the_wrong_speed_nothing_is_recognised(driver: str) -> None:
    for factor in (0.5, 2.0, 4.0):
        assert identify(at_wrong_speed(STREAMS[driver] * 4, factor)[-512:], 9600) == ''


def test_noise_is_nobody() -> None:
    noise = random.Random(5)
    found = [identify(noise.randbytes(512), 9600) for _ in range(200)]
    assert [text for text in found if text] == []


# --- devices of other packages -------------------------------------------------------------------

def is_sonar(data: bytes) -> bool:
    return data.count(b'$SONAR') > 1


def defective(data: bytes) -> bool:
    raise RuntimeError('of somebody else')


SONAR = DeviceParts('', signatures=(
    Signature('sonar frames', f'{__name__}:is_sonar'),
    Signature('pings of the older sonars', f'{__name__}:is_ping', 'update its firmware')))
DEFECTIVE = DeviceParts('', signatures=(
    Signature('defects', f'{__name__}:defective'), Signature('gaps', f'{__name__}:absent')))


class OldSonar(SerialDevice[Any]):
    """A driver of the entry-point group of the release before."""

    FRAMES = 'frames of an old sonar'

    @classmethod
    def recognises(cls, data: bytes) -> bool:
        return data.count(b'$OLD') > 1


class HalfMoved(OldSonar):
    """A driver of the new group whose recogniser is still in its class."""

    FRAMES = 'frames of a sonar on the move'

    @classmethod
    def recognises(cls, data: bytes) -> bool:
        return data.count(b'$HALF') > 1


HALF_MOVED = DeviceParts(f'{__name__}:HalfMoved')


class Nameless(OldSonar):
    FRAMES = ''


def is_ping(data: bytes) -> bool:
    return b'ping' in data


@pytest.fixture
def foreign(monkeypatch: pytest.MonkeyPatch) -> SignatureTable:
    """Install a package with devices, some of them broken in ways of their own."""
    points = {
        'rt_robot_os.devices': {
            'defective': f'{__name__}:DEFECTIVE', 'absent': f'{__name__}:ABSENT',
            'my_sonar': f'{__name__}:SONAR', 'nmea': f'{__name__}:SONAR',
            'gone': 'no_such_package', 'half_moved': f'{__name__}:HALF_MOVED'},
        'rt_robot_os.drivers': {
            'old_sonar': f'{__name__}:OldSonar', 'nameless': f'{__name__}:Nameless',
            'old_gone': f'{__name__}:Gone'}}
    monkeypatch.setattr(plugins, 'installed', lambda path: points)
    made = SignatureTable()
    monkeypatch.setattr(serial_device, 'SIGNATURES', made)
    return made


def test_the_bytes_of_another_package_are_recognised(foreign: SignatureTable) -> None:
    stream = nmea.sentence('SONAR,1.25') * 3
    assert 'none of a satellite' in identify(stream, 9600)
    assert foreign.identify(stream, 9600) == (
        'these are sonar frames at 9600 baud: set type: my_sonar, or swap the ports')
    assert 'set type: ublox' in foreign.identify(STREAMS['ublox'], 9600)


def test_bytes_that_no_driver_reads_are_named_too(foreign: SignatureTable) -> None:
    assert foreign.identify(b'ping', 9600) == (
        'these are pings of the older sonars: update its firmware')
    assert 'set type: ublox' in foreign.identify(STREAMS['ublox'] + b'ping', 9600)


@pytest.mark.filterwarnings('ignore:type old_sonar')
def test_a_class_of_the_old_group_still_says_it_itself(foreign: SignatureTable) -> None:
    assert foreign.identify(b'$OLD 1 $OLD 2', 9600) == (
        'these are frames of an old sonar at 9600 baud: set type: old_sonar, or swap the ports')
    assert 'set type: half_moved' in foreign.identify(b'$HALF 1 $HALF 2', 9600)


@pytest.mark.filterwarnings('ignore:type old_sonar')
def test_they_are_prepared_before_the_loop_runs(
        foreign: SignatureTable, monkeypatch: pytest.MonkeyPatch) -> None:
    device = NmeaGps('gps', settings_of(NmeaGps, port='/dev/none'))
    bind(device)
    monkeypatch.setattr(recognise, 'all_parts', None)  # nothing is imported in the loop
    device._strange = nmea.sentence('SONAR,1.25') * 3
    assert 'these are sonar frames at 9600 baud: set type: my_sonar' in device.diagnosis()


def test_packets_of_the_bluetooth_models_of_witmotion_get_a_hint() -> None:
    chance = random.Random(6)
    packets = [b'\x55\x61' + chance.randbytes(18) for _ in range(20)]
    for stream in (b''.join(packets), b''.join(packets)[7:], b''.join(packets[:3]) + b'\x55'):
        text = identify(stream, 115200)
        assert "WitMotion's Bluetooth models (55 61)" in text
        assert 'type: witmotion reads the serial models' in text
    assert identify(packets[0] + b'\x00' + packets[1] + packets[2], 115200) == ''


def test_sentences_of_no_receiver_are_not_called_those_of_one() -> None:
    vectornav = nmea.sentence('VNYMR,+100.9,-000.3,+003.5,+1.0,+0.1,+1.9,+00.1,-00.7,-09.8')
    assert 'none of a satellite receiver: choose the driver' in identify(vectornav * 2, 115200)
    assert 'set type: nmea' in identify(vectornav + nmea.sentence('GPGSV,1,1,00'), 9600)

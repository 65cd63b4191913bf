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

"""Recorded and live sensor networks, packet by packet and in sum."""

from __future__ import annotations

from collections import Counter
import gzip
import io
import json
from pathlib import Path
import random
import struct
import subprocess
import sys
from typing import Any

from processes import environment
from pty_motes import Mote
import pytest

from rt_robot_os.features.wsn.cli import line
from rt_robot_os.features.wsn.cli.command import run
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.ieee802154 import AckFrame
from rt_robot_os.features.wsn.packets.ieee802154 import T1Frame
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.surge import SurgeMsg
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.simulator.pcap import PcapWriter

Capture = pytest.CaptureFixture[str]


def surge(origin: int, seq_no: int, hop: int = 0) -> bytes:
    """Make a packet of SurgeTelos."""
    data = MultihopMsg(2, origin, hop, seq_no + 5, 2, SurgeMsg(0, 100, 2, seq_no).pack()).pack()
    return TelosMsg(0x7E, 17, data).pack()


def pulse(origin: int, seq_no: int, per_min: int) -> bytes:
    """Make a data packet with a pulse."""
    data = MultihopMsg(2, origin, 1, seq_no, 2, DataMsg(0, per_min, 2, seq_no, 5, 3900).pack())
    return TelosMsg(0x7E, 17, data.pack()).pack()


def sniffed(capsys: Capture, *arguments: str) -> tuple[int, list[dict[str, Any]], str]:
    """Run the command; give exit code, records and summary."""
    code = run(['sniff', *arguments, '--json'])
    out, err = capsys.readouterr()
    return code, [json.loads(line) for line in out.splitlines()], err


@pytest.fixture
def stream(tmp_path: Path) -> Path:
    """Give a recorded line: two nodes, a loss, a copy, a damaged frame, noise."""
    packets = [surge(5, 0), surge(6, 0), surge(5, 1), surge(5, 1, 9), surge(5, 3), surge(6, 1)]
    damaged = bytearray(frame(0x42, surge(6, 2)))
    damaged[12] ^= 1
    path = tmp_path / 'night.serial.bin'
    path.write_bytes(b'noise' + b''.join(frame(0x42, each) for each in packets) + damaged)
    return path


def test_a_recorded_line_is_shown_packet_by_packet(stream: Path, capsys: Capture) -> None:
    code, records, err = sniffed(capsys, str(stream))
    assert code == 0
    assert [(each['origin'], each['count'], each['duplicate']) for each in records] == [
        (5, 0, False), (6, 0, False), (5, 1, False), (5, 1, True), (5, 3, False), (6, 1, False)]
    first = records[0]
    assert list(first) == [
        'time', 'medium', 'protocol', 'platform', 'kind', 'name', 'am_type', 'group',
        'destination', 'source', 'origin', 'seqno', 'hops', 'parent', 'cost', 'count',
        'duplicate', 'fields', 'readings', 'problem', 'hex']
    assert (first['time'], first['medium'], first['protocol'], first['platform']) == (
        None, 'serial', 'tinyos1', 'telos')
    assert (first['am_type'], first['group'], first['source'], first['seqno'], first['hops'],
            first['parent'], first['cost'], first['problem']) == (17, 0x7D, 2, 5, 2, 2, None, None)
    assert bytes.fromhex(first['hex']) == surge(5, 0)
    assert err == (
        '6 packets, 0 with a problem; 1 frames with a wrong CRC, '
        f'{5 + len(frame(0x42, surge(6, 2)))} bytes rejected\n'
        '  0x11 surge                           6\n'
        '  origin  packets   copies     lost  delivery\n'
        '       5        4        1        1    75.00%\n'
        '       6        2        0        0   100.00%\n')


def test_lines_for_people(stream: Path, capsys: Capture) -> None:
    assert run(['sniff', str(stream)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == (
        'tinyos1 0x11 surge from 2 to 126 origin 5 seqno 5 count 0 hops 2 parent 2 type 0 '
        'reading 100').split()
    assert lines[3].endswith('(again)')
    assert run(['sniff', str(stream), '--quiet']) == 0
    assert capsys.readouterr().out == ''


def test_losses_of_oscilloscope_are_shown_as_bounds(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / 'line.serial.bin'
    path.write_bytes(b''.join(frame(0x45, b'\0' + SerialAm(
        0xFFFF, 0, Oscilloscope.AM_TYPE, Oscilloscope(0, 1024, 7, number, bytes(10)).pack()
        ).pack()[1:]) for number in (0, 1, 2, 2, 4, 5, 7, 8, 9, 9)))
    assert run(['sniff', str(path), '--quiet']) == 0
    rows = [line.split() for line in capsys.readouterr().err.splitlines()]
    assert ['7', '10', '2', '<=2', '>=80.00%'] in rows


def test_a_node_without_a_route_has_no_parent(tmp_path: Path, capsys: Capture) -> None:
    body = MultihopMsg(5, 5, 1, 0, 0xFF, SurgeMsg(0, 100, 0xFFFF, 0).pack()).pack()
    path = tmp_path / 'line'
    path.write_bytes(frame(0x42, TelosMsg(0xFFFF, 17, body).pack()))
    assert run(['sniff', str(path)]) == 0
    assert ' count 0 hops none parent none ' in capsys.readouterr().out


def test_readings_and_problems_are_in_both(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / 'line'
    path.write_bytes(frame(0x42, pulse(4, 7, 72)) + frame(0x42, pulse(4, 8, 71)[:-3])
                     + frame(0x50, b'\x01') + frame(0x40, b'\x26'))
    _, records, err = sniffed(capsys, str(path))
    assert records[0]['readings'] == pytest.approx({'pulse_per_min': 72.0, 'battery': 2.8564},
                                                   abs=1e-4)
    assert records[1]['problem'] == 'its length byte is 24, but the payload has 21 bytes'
    assert records[2]['problem'] == 'its protocol byte 0x50 is not one of TinyOS'
    assert (records[3]['kind'], records[3]['fields']) == ('ack', {'token': 0x26})
    assert err.startswith('4 packets, 2 with a problem')
    run(['sniff', str(path)])
    lines = capsys.readouterr().out.splitlines()
    assert 'pulse_per_min=72 battery=2.8564' in lines[0] and '! its length byte' in lines[1]


def test_payloads_of_ones_own_are_decoded(tmp_path: Path, capsys: Capture) -> None:
    path, declared = tmp_path / 'line', tmp_path / 'own.yaml'
    path.write_bytes(frame(0x45, SerialAm(0, 7, 0x42, bytes.fromhex('0007 00fa 7fc00000')).pack()))
    text = 'soil 0x42 origin:H wet:H[%]=soil_moisture_percent,0.1 air:f'
    _, records, _ = sniffed(capsys, str(path), '--payload', text)
    assert (records[0]['name'], records[0]['origin'], records[0]['readings']) == (
        'soil', 7, {'soil_moisture_percent': 25.0})
    assert records[0]['fields']['air'] is None  # JSON has no NaN
    declared.write_text(f'payloads:\n- {text}\n')
    assert sniffed(capsys, str(path), '--payload', str(declared))[1] == records
    declared.write_text('payloads: soil\n')
    assert run(['sniff', str(path), '--payload', str(declared)]) == 2
    assert 'must be a list' in capsys.readouterr().err
    assert run(['sniff', str(path), '--payload', 'soil 0x42 wet:Z']) == 2
    assert "field 'wet': the code 'Z' must be one of" in capsys.readouterr().err


def test_a_group_of_others_is_named(stream: Path, capsys: Capture) -> None:
    _, records, err = sniffed(capsys, str(stream), '--group', '0x22')
    assert {each['problem'] for each in records} == {'group 0x7d instead of 0x22'}
    assert '  6 of other groups\n' in err


@pytest.mark.parametrize('name', ['chain4_ctp', 'lossy4_multihoplqi'])
def test_recordings_of_real_motes_in_all_their_forms(
        name: str, data_dir: Path, capsys: Capture) -> None:
    folder = data_dir / 'wsn'
    if not folder.is_dir():
        pytest.skip(f'no recordings at {folder}')
    expected = json.loads((folder / 'mspsim_summary.json').read_text())[name]
    code, line, err = sniffed(capsys, str(folder / f'mspsim_{name}.serial.bin'))
    again = sum(each['duplicate'] for each in line)
    assert (code, again) == (0, expected['duplicates_on_serial'])
    delivered = Counter(str(each['origin']) for each in line if each['kind'] == 'data'
                        and each['origin'] and not each['duplicate'])
    assert delivered == expected['delivered']
    _, frames, _ = sniffed(capsys, str(folder / f'mspsim_{name}.frames.csv.gz'))
    assert [{**each, 'time': None} for each in frames] == line
    assert frames[0]['time'] == pytest.approx(4.2, abs=0.2)
    _, air, err = sniffed(capsys, str(folder / f'mspsim_{name}.air.csv.gz'))
    kinds = Counter(each['kind'] for each in air)
    assert kinds == {'data': expected['data_transmissions'], 'beacon': expected['beacons'],
                     'ack': expected['acks']}
    assert 'packets, 0 with a problem' in err


def pcap(order: str, magic: int, link: int, frames: list[bytes], snap: int = 127) -> bytes:
    """Make a pcap file."""
    data = struct.pack(f'{order}IHHiIII', magic, 2, 4, 0, 0, snap, link)
    for at, each in enumerate(frames):
        data += struct.pack(f'{order}IIII', 10 + at, 500, len(each), len(each)) + each
    return data


@pytest.mark.parametrize(('order', 'magic', 'link', 'head', 'tail', 'time_s'), [
    ('<', 0xA1B23C4D, 195, b'', 0, 10.0000005), ('<', 0xA1B2C3D4, 230, b'', 2, 10.0005),
    ('>', 0xA1B2C3D4, 195, b'', 0, 10.0005),
    ('<', 0xA1B2C3D4, 283, b'\0\0\x0c\0' + bytes(8), 0, 10.0005)])
def test_a_pcap_is_read_whatever_its_form(
        order: str, magic: int, link: int, head: bytes, tail: int, time_s: float, tmp_path: Path,
        capsys: Capture) -> None:
    wire = [T1Frame(0, 17, TelosMsg.unpack(surge(5, 1)).payload, dsn=3).pack()[1:],
            AckFrame(3).pack()[1:]]
    path = tmp_path / 'air.pcap'
    path.write_bytes(pcap(order, magic, link,
                          [head + (each[:-tail] if tail else each) for each in wire]))
    code, records, _ = sniffed(capsys, str(path))
    assert (code, [each['kind'] for each in records]) == (0, ['data', 'ack'])
    assert [each['problem'] for each in records] == [None, None]
    assert records[0]['time'] == pytest.approx(time_s, abs=1e-9)
    assert records[1]['fields'] == {'dsn': 3}


@pytest.mark.parametrize('with_fcs', [True, False])
def test_a_pcap_of_the_simulator_is_read(
        with_fcs: bool, tmp_path: Path, capsys: Capture) -> None:
    sent = T1Frame(0, 17, TelosMsg.unpack(surge(5, 1)).payload, dsn=3).pack()
    path = tmp_path / 'air.pcap'
    with path.open('wb') as file:
        PcapWriter(file, with_fcs).write(1_500_000_001, sent[1:])
    _, records, err = sniffed(capsys, str(path))
    assert [(each['origin'], each['problem']) for each in records] == [(5, None)]
    assert records[0]['time'] == pytest.approx(1.500000001, abs=1e-9)
    assert records[0]['hex'] == sent.hex()


@pytest.mark.parametrize(('content', 'code', 'said'), [
    (pcap('<', 0xA1B2C3D4, 1, []), 1, 'is not of 802.15.4 (link type 1)'),
    (pcap('<', 0xA1B2C3D4, 195, [bytes(40)])[:-9], 1, 'is truncated or damaged'),
    (b'\x0a\x0d\x0d\x0a' + bytes(20), 1, 'is a pcapng: convert it'),
    (gzip.compress(frame(0x42, surge(1, 1)) * 9, mtime=0)[:-9], 1, 'cannot be read any further'),
    (gzip.compress(bytes(99), mtime=0)[:12] + b'damaged inside', 1, 'cannot be read any further'),
    (b't_us,frame_hex\n1,zz\nx,4245\n1,4\r5\n\0\n7\n', 1, '5 lines contain no frame'),
    (b'12,4526\n', 1, '1 frames with a wrong CRC'),
    (b'', 1, '0 packets'),
    (random.Random(1).randbytes(3000), 1, "contains no frame of TinyOS' serial line")],
    ids=['ethernet', 'cut', 'pcapng', 'gzip', 'zlib', 'no_hex', 'crc', 'empty', 'noise'])
def test_a_damaged_recording_is_read_as_far_as_it_goes(
        content: bytes, code: int, said: str, tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / 'file'
    path.write_bytes(content)
    found, _, err = sniffed(capsys, str(path))
    assert (found, said in err) == (code, True), err


def test_a_csv_without_a_head_and_air_without_length_bytes(
        tmp_path: Path, capsys: Capture) -> None:
    content = frame(0x42, surge(5, 2))
    path = tmp_path / 'frames.csv'
    path.write_text(f'1500000,{content.hex()}\n2500000,{content.hex()}\n')
    _, records, _ = sniffed(capsys, str(path))
    assert [(each['time'], each['origin']) for each in records] == [(1.5, 5), (2.5, 5)]
    air = tmp_path / 'air.csv'
    air.write_text(f't_us,source,mpdu_hex\n7,3,{AckFrame(1).pack()[1:].hex()}\n')
    assert sniffed(capsys, str(air))[1][0]['kind'] == 'ack'


def test_the_standard_input_is_read(
        stream: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    piped = io.TextIOWrapper(io.BufferedReader(io.BytesIO(stream.read_bytes())))
    monkeypatch.setattr('sys.stdin', piped)
    assert len(sniffed(capsys, '-')[1]) == 6


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(OSError, match='cannot be read: No such file'):
        run(['sniff', str(tmp_path / 'none')])


def test_a_port_is_listened_to_until_the_time_is_over(capsys: Capture) -> None:
    with Mote((frame(0x42, surge(5, 1)), frame(0x41, b'\x07' + surge(6, 1)))) as mote:
        code, records, err = sniffed(capsys, mote.path, '--seconds', '0.3')
    assert code == 0 and {each['origin'] for each in records} == {5, 6}
    assert records[0]['time'] > 1.6e9
    # What wants an acknowledgement gets it.
    assert (0x40, 7, b'') in mote.taken
    assert 'packets, 0 with a problem' in err


def test_a_port_that_goes_away_ends_it_with_the_summary(capsys: Capture) -> None:
    mote = Mote((frame(0x42, surge(5, 1)),))
    with mote:
        code = 0
        seen: list[str] = []

        def write(text: str) -> int:
            seen.append(text)
            if len(seen) == 2:
                mote.unplug()
            return len(text)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr('sys.stdout.write', write)
            code = run(['sniff', mote.path])
    err = capsys.readouterr().err
    assert (code, 'is gone' in err, 'opened again' in err) == (1, True, False)
    assert '0x11 surge' in err


@pytest.mark.parametrize(('sent', 'said'), [
    ((), 'no bytes have arrived: check that the mote runs a base station'),
    ((bytes(range(100)),), 'bytes arrive, but no packets: check --baud (57600 under')])
def test_a_silent_port_is_told_of_once(
        sent: tuple[bytes, ...], said: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
        ) -> None:
    monkeypatch.setattr(line, 'SILENCE_S', 0.05)
    monkeypatch.setattr(line, '_TURN_S', 0.01)
    with Mote(sent) as mote:
        assert run(['sniff', mote.path, '--seconds', '0.3']) == 1
    assert capsys.readouterr().err.count(said) == 1


def test_a_port_that_is_not_there_is_named() -> None:
    with pytest.raises(OSError, match='port /dev/none does not exist'):
        run(['sniff', '/dev/none'])
    with pytest.raises(OSError, match='sf://127.0.0.1:1: Connection refused: check host and port'):
        run(['sniff', 'sf://127.0.0.1:1'])
    assert run(['sniff', 'sf://127.0.0.1:1:2']) == 2


def test_a_reader_that_has_enough_ends_it_in_silence(stream: Path, tmp_path: Path) -> None:
    stream.write_bytes(stream.read_bytes() * 2000)
    process = subprocess.Popen(
        [sys.executable, '-m', 'rt_robot_os.features.wsn.cli.program', 'sniff', str(stream)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(tmp_path))
    assert process.stdout is not None and process.stderr is not None
    assert b'surge' in process.stdout.readline()
    process.stdout.close()
    assert process.stderr.read() == b''
    assert process.wait(60) == 141
    process.stderr.close()

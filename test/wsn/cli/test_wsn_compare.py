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


"""What others gave for the same networks is found in a folder, simulated and compared."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
import shutil

import pytest

from rt_robot_os.features.wsn.cli.command import run
from rt_robot_os.features.wsn.cli.compare_report import Difference
from rt_robot_os.features.wsn.cli.compare_report import lines
from rt_robot_os.features.wsn.cli.references import read_references
from rt_robot_os.features.wsn.cli.references import Skipped


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Give a folder with one reference of TOSSIM: two nodes that hear each other well."""
    (tmp_path / 'tossim_pair.topo.txt').write_text('gain 0 1 -60\ngain 1 0 -60\n')
    (tmp_path / 'noise_still.txt').write_text('-98\n-97\n' * 50)
    write(tmp_path, 38)
    return tmp_path


def write(folder: Path, delivered: int, generated: int = 38) -> None:
    (folder / 'tossim_reference.json').write_text(json.dumps([{
        'variant': 'ctp', 'topology': 'pair', 'noise': 'still', 'seed': seed, 'seconds': 30,
        'generated': generated, 'delivered': delivered, 'duplicates': 0, 'transmissions': 55}
        for seed in (1, 2)]))


def test_a_reference_that_agrees(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(['compare', str(folder), '--jobs', '1', '--json']) == 0
    (name, found), = json.loads(capsys.readouterr().out).items()
    assert name == 'TOSSIM pair still ctp'
    assert [(each['what'], each['ok']) for each in found] == [
        ('delivery', True), ('frames per packet', True)]


@pytest.mark.parametrize('generated, spread_s', [(38, 0.001), (38 + 37, 1.0), (2 * 38, 0.001)])
def test_motes_are_booted_as_far_apart_as_the_reference_says(
        folder: Path, generated: int, spread_s: float) -> None:
    # The first packet is a period after the boot: 38 in 30 s, and 37 of a mote that is late.
    write(folder, 37, generated)
    (reference, ), _ = read_references(folder)
    assert [(one.boot_spread_s, one.traffic.start_ms) for one in reference.scenarios] == [
        (spread_s, 781.25)] * 2


def test_a_reference_that_differs_is_told(
    folder: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    write(folder, 30)
    assert run(['compare', str(folder), '--jobs', '1', '--seeds', '1']) == 1
    assert 'DIFFERS' in capsys.readouterr().out


@pytest.mark.parametrize('file, text, said', [
    ('tossim_reference.json', '[{}]', 'malformed'),
    ('tossim_reference.json', '{', 'malformed'),
    ('noise_still.txt', None, 'noise_still.txt: no such file'),
    ('tossim_reference.json', None, 'has neither')])
def test_references_that_cannot_be_used_are_told(
    folder: Path, file: str, text: str | None, said: str, capsys: pytest.CaptureFixture[str],
) -> None:
    if text is None:
        (folder / file).unlink()
    else:
        (folder / file).write_text(text)
    assert run(['compare', str(folder)]) == 2
    assert said in capsys.readouterr().err


def test_what_matches_nothing_is_an_error_that_lists_what_there_is(
    folder: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(['compare', str(folder), '--only', 'nosuch']) == 2
    said = capsys.readouterr()
    assert not said.out
    assert "--only 'nosuch'" in said.err and 'TOSSIM pair still ctp' in said.err


def test_references_without_a_row_are_no_success(
    folder: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    (folder / 'tossim_reference.json').write_text('[]')
    assert run(['compare', str(folder)]) == 2
    (folder / 'some_decisions.csv').write_text(HEAD)
    assert run(['compare', str(folder)]) == 2
    assert 'no row can be compared' in capsys.readouterr().err


def test_what_lacks_a_file_is_named_and_the_rest_is_compared(
    folder: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    rows = json.loads((folder / 'tossim_reference.json').read_text())
    rows += [{**rows[0], 'noise': 'heavy'}, {**rows[0], 'variant': 'lqi2', 'generated': 0}]
    (folder / 'tossim_reference.json').write_text(json.dumps(rows))
    (folder / 'mspsim_summary.json').write_text('{')
    assert run(['compare', str(folder), '--jobs', '1', '--seeds', '1']) == 0
    said = capsys.readouterr().out
    assert '2 of 2 figures agree, of 1 references; 3 skipped' in said
    said = ' '.join(said.split())
    assert 'skipped: TOSSIM pair heavy ctp: ' in said
    assert 'noise_heavy.txt: no such file' in said
    assert 'skipped: TOSSIM pair still lqi2: ' in said and 'mspsim_summary.json: ' in said


HEAD = 'node,beacon_from,lqi,advertised_cost,branch,hopcount_after,linkcost_after,parentcost_after'
HEARD = ('1,0,106,0,Not a cycle,1,216,0', '1,0,105,0,Not a loop,1,243,0',
         '2,1,106,243,Not a cycle,2,216,243', '2,0,85,0,CYCLE,2,216,243')


@pytest.mark.parametrize('rows, code, said', [
    (HEARD, 0, '1 of 1 figures agree'),
    ((*HEARD, '2,0,100,0,Not a loop,2,216,243'), 1, 'DIFFERS'),
    ((*HEARD, '3,2,106,999,Not a cycle,3,216,999'), 1, 'DIFFERS'),
    (('1,0,x,0,Not a cycle,1,216,0',), 2, 'row 1 is not a row of decisions')])
def test_a_log_of_decisions_is_explained_row_by_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rows, code: int, said: str,
) -> None:
    (tmp_path / 'some_decisions.csv').write_text('\n'.join((HEAD, *rows)))
    assert run(['compare', str(tmp_path)]) == code
    output = capsys.readouterr()
    assert said in output.out + output.err


# Node 1 has a route already, which no row gave it; node 3 keeps a parent that no row names.
MID_RUN = ('1,0,106,0,Not a loop,1,216,0', '2,1,106,216,Not a cycle,2,216,216',
           '3,2,106,432,CYCLE,2,216,216', '3,2,106,432,Not a loop,3,216,432',
           '3,2,105,432,Not a loop,3,243,432', '2,1,106,216,Not a loop,2,216,216')


@pytest.mark.parametrize('rows, code, said', [
    (MID_RUN, 0, 'compared from row 5 on, without 4 rows'),
    ((*MID_RUN, '3,2,105,432,Not a loop,3,216,432'), 1, 'DIFFERS'),
    ((*MID_RUN, '1,2,105,999,CYCLE,1,216,0'), 1, 'DIFFERS'),
    (MID_RUN[:4], 2, 'no row can be compared')])
def test_a_log_that_begins_in_mid_run_is_compared_from_where_the_state_is_known(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rows, code: int, said: str,
) -> None:
    (tmp_path / 'some_decisions.csv').write_text('\n'.join((HEAD, *rows)))
    assert run(['compare', str(tmp_path)]) == code
    output = capsys.readouterr()
    assert said in ' '.join((output.out + output.err).split())


def test_the_end_of_a_real_log_agrees_as_the_whole_does(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    given = data_dir / 'wsn' / 'tossim_multihoplqi_decisions.csv.gz'
    if not given.is_file():
        pytest.skip(f'no log {given}')
    head, *rows = gzip.decompress(given.read_bytes()).decode().splitlines()
    (tmp_path / 'end_decisions.csv').write_text('\n'.join((head, *rows[len(rows) // 2:])))
    assert run(['compare', str(tmp_path)]) == 0
    assert 'the log starts in mid-run' in ' '.join(capsys.readouterr().out.split())


@pytest.mark.parametrize('columns', [80, 120])
def test_no_line_is_wider_than_the_terminal_and_nothing_is_left_out(columns: int) -> None:
    tree = ' '.join(f'{node}:{node // 3}' for node in range(1, 100))
    compared = {'TOSSIM grid16 meyer-heavy lqi32': [
        Difference('delivery', '0.9912', '0.9954', True, '0.06 (2 sigma of ours)'),
        Difference('parents', tree, tree.replace('7:2', '7:-'), False,
                   'at the end in 3, at some time in 5 of 6')]}
    written = list(lines(compared, [Skipped('firmware x ctp', 'no such file ' * 20)], columns))
    assert max(map(len, written)) <= columns
    words = ' '.join(written).split()
    assert words.count('98:32') == 2 and words.count('7:2') == words.count('7:-') == 1


def test_the_firmware_of_a_chain_has_the_same_tree_and_costs(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    name = 'chain4_multihoplqi'
    given = data_dir / 'wsn' / 'mspsim_summary.json'
    if not given.is_file():
        pytest.skip(f'no references {given}')
    for file in ('mspsim_chain4.links.txt', f'mspsim_{name}.air.csv.gz'):
        shutil.copy(given.parent / file, tmp_path)
    (tmp_path / given.name).write_text(json.dumps({name: json.loads(given.read_text())[name]}))
    assert run(['compare', str(tmp_path), '--jobs', '1', '--seeds', '2']) == 0
    said = capsys.readouterr().out
    assert '4 of 4 figures agree' in said
    assert '0:0 1:216/65534 2:432/1331 3:648/1547/65534' in ' '.join(said.split())


@pytest.mark.parametrize('name', ['chain4', 'lossy4'])
def test_emulated_motes_boot_when_they_did_whatever_they_pass_on(
        data_dir: Path, name: str) -> None:
    # The emulator booted the motes alike under both protocols; with CTP node 1 or 2 passes on a
    # packet of node 3 before it sends its own first one.
    if not (data_dir / 'wsn' / 'mspsim_summary.json').is_file():
        pytest.skip(f'no references in {data_dir}')
    references, _ = read_references(data_dir / 'wsn', seeds=1)
    boots = [[float(fault.split()[-1]) for fault in sorted(one.scenarios[0].faults)]
             for one in references if one.name.startswith(f'firmware {name} ')]
    assert len(boots) == 2
    assert boots[0] == pytest.approx(boots[1], abs=0.02)

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

"""How findings are written: text, colours, JSON, the documentation."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from recorded import CHECKS

from rt_robot_os.tools.doctor import finding as make
from rt_robot_os.tools.doctor import text_report
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Line
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.json_report import as_json
from rt_robot_os.tools.doctor.report import Report
from rt_robot_os.tools.doctor.report import Verdict
from rt_robot_os.tools.doctor.style import Progress
from rt_robot_os.tools.doctor.style import Style
from rt_robot_os.tools.doctor.style import style_for
from rt_robot_os.tools.doctor.system import Wanted
from rt_robot_os.tools.doctor.wakeup import KERNEL
from rt_robot_os.tools.doctor.wakeup import MACHINE
from rt_robot_os.tools.doctor.wakeup import StepWatch

DOCUMENT = Path(__file__).resolve().parents[3] / 'docs' / 'doctor.md'
FACTS = {'host': 'h', 'cpu': 'c', 'cpus': 2, 'release': 'r', 'architecture': 'a', 'core_cpu': 1}
GOOD = make.ok('all right')
MEND = Remedy(('sudo mend',), 'now')


def _line(finding, key: str = 'a.b', title: str = 'thing') -> Line:
    return Line('a', Check(key, title, 'it matters', lambda _: ()), finding)


def _report(*findings) -> Report:
    return Report(FACTS, Wanted(), [_line(one, f'a.{n}', f'thing {n}')
                                    for n, one in enumerate(findings)])


def test_the_worst_line_decides() -> None:
    assert _report(GOOD).verdict is Verdict.READY
    assert _report(GOOD, make.unknown('dark'), make.absent('none')).verdict is Verdict.READY
    assert _report(GOOD, make.warn('so so', MEND, weight=1)).verdict is Verdict.USABLE
    assert _report(make.bad('no', MEND, weight=1),
                   make.warn('so so', MEND, weight=100)).verdict is Verdict.NOT_USABLE


def test_the_summary_begins_with_what_is_worth_most() -> None:
    report = _report(make.warn('w', MEND, weight=10), make.warn('w', MEND, weight=90),
                     make.bad('b', MEND, weight=5), make.unknown('dark'))
    told = ' '.join(text_report.summary_lines(report, Style()))
    assert 'not usable: 3 things to fix, the most worthwhile first: thing 2, thing 1, thing 0' \
        in told
    assert '1 could not be determined' in told


def test_late_wakeups_are_told_before_what_may_cause_them() -> None:
    late = make.warn('late', MEND, weight=1)
    report = Report(FACTS, Wanted(), [Line('measured', KERNEL, late)])
    assert 'usable: wake-ups are late; find out what else runs' in ' '.join(
        text_report.summary_lines(report, Style()))


def test_a_long_list_is_cut() -> None:
    report = _report(*[make.warn('w', MEND, weight=1)] * 12)
    assert 'thing 7 and 4 more' in ' '.join(text_report.summary_lines(report, Style()))


def _written(*findings, **options) -> list[str]:
    lines = [_line(one, f'a.{n}', f'thing {n}') for n, one in enumerate(findings)]
    return list(text_report.Writer(Style(), **options).group('group', lines))


def test_a_finding_is_followed_by_why_and_what_mends_it() -> None:
    assert _written(make.warn('so so', MEND, weight=1)) == [
        '', 'group', '  warn     thing 0               so so', '           It matters.',
        '             # now', '             sudo mend']


def test_what_is_fine_takes_one_line_and_what_does_not_apply_none() -> None:
    assert len(_written(make.ok('fine', MEND), make.absent('none'))) == 3
    assert _written(make.absent('none')) == []
    assert len(_written(make.ok('fine', MEND), make.absent('none'), everything=True)) == 8


def test_quiet_leaves_only_problems() -> None:
    assert _written(GOOD, make.unknown('dark'), quiet=True) == []
    assert len(_written(GOOD, make.bad('no', MEND, weight=1), quiet=True)) == 6


def test_one_remedy_for_two_lines_is_told_once() -> None:
    written = _written(*[make.warn('w', MEND, weight=1)] * 2)
    assert written.count('             sudo mend') == 1
    assert written[-1] == '             # as above, for thing 0'


def test_names_that_others_chose_cannot_steer_the_terminal() -> None:
    evil = make.warn('at 90: \033]0;x\007evil\r', Remedy(('kill \033[2J1',)), weight=1)
    written = ''.join(_written(evil))
    assert 'at 90: ?]0;x?evil' in written and 'kill ?[2J1' in written
    assert written.isprintable()


def test_a_long_command_is_broken_where_the_shell_allows_it() -> None:
    command = "echo 'a && b | c' | sudo tee /x && sudo udevadm control --reload"
    assert text_report.shell_lines(command, 40) == [
        "echo 'a && b | c' | sudo tee /x &&", '  sudo udevadm control --reload']
    unbreakable = 'x' * 60
    assert text_report.shell_lines(unbreakable, 40) == [unbreakable]


class _Terminal(io.StringIO):
    encoding = 'utf-8'

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize('environ, coloured', [
    ({'TERM': 'xterm'}, True), ({'TERM': 'xterm', 'NO_COLOR': '1'}, False),
    ({'TERM': 'dumb'}, False), ({}, False)])
def test_colours_are_for_terminals_that_want_them(environ, coloured) -> None:
    assert style_for(_Terminal(), environ).colours is coloured
    assert not style_for(io.StringIO(), environ).colours


def test_bars_are_ascii_where_nothing_else_can_be_written() -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding='ascii')
    assert style_for(stream, {}).full == '#'
    assert style_for(io.TextIOWrapper(io.BytesIO(), encoding='utf-8'), {}).full == '█'


def test_the_progress_bar_leaves_nothing_behind() -> None:
    stream = io.StringIO()
    bar = Progress(stream, Style(), 'measuring')
    bar.clear()
    assert stream.getvalue() == ''
    for part in (0.0, 0.5, 1.0):
        bar.show(part)
    bar.clear()
    lines = stream.getvalue().split('\r')
    assert {len(line) for line in lines[1:-1]} == {len(lines[1])}
    assert lines[-2].strip() == '' and lines[-1] == ''
    assert '100%' in lines[3]


def test_json_has_the_keys_that_are_documented() -> None:
    report = _report(make.warn('w', MEND, weight=3, subject='/dev/x'), GOOD)
    value = json.loads(as_json(report))
    assert value['schema'] == 1
    assert (value['verdict'], value['exit_code']) == ('usable', 1)
    assert value['to_mend'] == ['a.0']
    assert value['findings'][0] == {
        'check': 'a.0', 'group': 'a', 'title': 'thing 0', 'subject': '/dev/x', 'state': 'warn',
        'found': 'w', 'why': 'it matters', 'weight': 3, 'remedy': ['sudo mend'], 'note': 'now'}
    assert value['counts'] == {'ok': 1, 'warn': 1, 'bad': 0, 'unknown': 0, 'absent': 0}
    assert value['wakeup'] is None
    described = DOCUMENT.read_text()
    for key in (*value, *value['findings'][0], *value['wanted'], *value['machine']):
        assert f'`{key}`' in described, key


def test_every_check_is_documented_and_only_those() -> None:
    rows = [line.split('`')[1] for line in DOCUMENT.read_text().splitlines()
            if line.startswith('| `') and '.' in line.split('`')[1]]
    assert rows == [*CHECKS, MACHINE.key, KERNEL.key, StepWatch.check.key]


def test_keys_and_titles_keep_to_their_form() -> None:
    for key, check in CHECKS.items():
        assert key == check.key
        assert len(check.title) <= 20, key
        assert check.why and not check.why.endswith('.'), key
    titles = [check.title for check in CHECKS.values()]
    assert len(set(titles)) == len(titles)

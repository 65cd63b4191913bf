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

"""Each text of server and robot that a page shows has a code, each code its words."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import itertools
import json
from pathlib import Path
import re
from typing import Final

import pytest

import rt_robot_os
from rt_robot_os.features.health.assessment.module import score_text
from rt_robot_os.features.health.assessment.news2 import score
from rt_robot_os.messages.signs import SIGNS
from rt_robot_os.messages.texts.coded import coded
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.texts.coded import TEMPLATES
from rt_robot_os.messages.texts.signals import codes_of_signals
from rt_robot_os.settings.files import default_path

ROOT: Final = Path(rt_robot_os.__file__).parent
MESSAGES: Final = ROOT / 'monitor' / 'page' / 'messages'
HOLE: Final = re.compile(r'\{(\w+)(?::\w+)?\}')
#: What stands in the holes of an f-string, one after the other, until its template is found.
SAMPLES: Final = ('7', 'anna', 'person', 'fall: smoke', '')

#: Where texts for people are made: of which calls which arguments, by their place or name.
SERVER: Final = {
    'refusal': (1, 2), '_refuse': (2, 3), 'AccountError': (0, 1), 'RobotUnavailable': (0, 1),
    'ended': (0,), '_gone': (1,), 'HTTPException': (1,)}
ROBOT: Final = (
    ('features/alarms/alarm_table.py', {'note': ('why',), '_raise': ('why',), 'close': ('why',)}),
    ('features/alarms/escalation.py', {'note': ('why',), '_failed': (2,)}),
    ('features/alarms/command_handler.py', {'ValueError': (0,)}),
    ('features/agent/agent.py', {'_fire': (1,)}),
    ('features/agent/drive.py', {'_fail': (0,)}),
    ('features/navigation/planner/module.py', {'_refuse': (0,), '_wait': (0,), '_tell': (0,)}),
    ('motion/route.py', {'RouteError': (0,)}),
    ('features/navigation/collision_guard/module.py', {'Verdict': (2,)}),
    ('features/navigation/velocity_mux/module.py', {'set': (1,)}),
    ('features/health/assessment/module.py', {'Cause': ('text',)}),
    ('features/alarms/watch.py', {'_put': (5,)}),
    ('features/health/vital_signs/module.py', {'Cause': ('text', 4), 'end': (3,)}),
    ('features/health/fall_detector/module.py', {'_begin': (1,), 'end': (3,)}),
    ('gateway/commands.py', {'Answer': (1,), 'LinkError': (0,)}),
    ('gateway/voice.py', {'_tell': ('why',)}))


def _texts(path: Path, calls: dict[str, tuple[int | str, ...]]) -> Iterator[tuple[int, ast.expr]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call):
            name = getattr(node.func, 'attr', getattr(node.func, 'id', ''))
            given = {**dict(enumerate(node.args)),
                     **{each.arg: each.value for each in node.keywords}}
            for key in calls.get(name, ()):
                for each in _branches(given.get(key)):
                    yield node.lineno, each


def _branches(node: ast.expr | None) -> Iterator[ast.expr]:
    if isinstance(node, ast.IfExp):
        yield from _branches(node.body)
        yield from _branches(node.orelse)
    elif isinstance(node, ast.JoinedStr):
        choice = next((each for each in node.values if isinstance(each, ast.FormattedValue)
                       and isinstance(each.value, ast.IfExp)), None)
        if choice is None:
            yield node
            return
        for part in (choice.value.body, choice.value.orelse):  # type: ignore[attr-defined]
            yield from _branches(ast.JoinedStr([
                part if each is choice and isinstance(part, ast.Constant) else
                ast.FormattedValue(part, -1) if each is choice else each
                for each in node.values]))
    elif isinstance(node, ast.Constant) and node.value:
        yield node


def _is_coded(node: ast.expr) -> bool:
    """Return whether a text has a code for some content of its holes."""
    if isinstance(node, ast.Constant):
        return not isinstance(node.value, str) or coded(node.value) is not None
    assert isinstance(node, ast.JoinedStr)
    holes = sum(isinstance(each, ast.FormattedValue) for each in node.values)
    for samples in itertools.product(SAMPLES, repeat=min(holes, 3)):
        left = [*samples, *'7' * (holes - len(samples))]
        text = ''.join(str(each.value) if isinstance(each, ast.Constant) else left.pop(0)
                       for each in node.values)
        if coded(text) is not None:
            return True
    return False


def _places() -> Iterator[tuple[Path, dict[str, tuple[int | str, ...]]]]:
    for path in sorted((ROOT / 'monitor').rglob('*.py')):
        if 'commands' not in path.parent.parts:  # what the console is told stays there
            yield path, SERVER
    for name, calls in ROBOT:
        yield ROOT / name, calls


def test_each_text_of_server_and_robot_has_a_code() -> None:
    found = [(path, *each) for path, calls in _places() for each in _texts(path, calls)]
    assert len(found) > 150
    missing = [f'{path.relative_to(ROOT)}:{line}: {ast.unparse(node)}'
               for path, line, node in found if not _is_coded(node)]
    assert not missing, '\n'.join(missing)


def test_what_there_is_none_of_has_a_code() -> None:
    source = '\n'.join(path.read_text() for path in (ROOT / 'monitor').rglob('*.py'))
    found = set(re.findall(r"unknown\('([^']+)'\)", source))
    assert len(found) > 4
    assert [each for each in found if coded(f'there is no such {each}') is None] == []


@pytest.mark.parametrize('language', sorted(each.name for each in MESSAGES.iterdir()))
def test_each_code_has_words_with_no_other_arguments(language: str) -> None:
    words = json.loads((MESSAGES / language / 'said.json').read_text())
    assert sorted(words) == sorted(f'said.{code}' for code in TEMPLATES)
    for code, template in TEMPLATES.items():
        assert set(HOLE.findall(words[f'said.{code}'])) <= set(HOLE.findall(template)), code


def test_each_action_of_the_audit_has_words() -> None:
    words = json.loads((MESSAGES / 'en' / 'audit.json').read_text())
    source = '\n'.join(path.read_text() for path in (ROOT / 'monitor').rglob('*.py'))
    actions = set(re.findall(r"(?:note|note_soon|read)\(\s*[^'()]*(?:\(\))?, '([a-z_]+\.[a-z_]+)'",
                             source))
    assert len(actions) > 20
    actions |= {f'{what}.{do}' for what in ('command', 'answer') for do in _commands()}
    assert sorted(each for each in actions
                  if f'audit.do_{each.replace(".", "_")}' not in words) == []


def _commands() -> list[str]:
    pytest.importorskip('fastapi')
    from rt_robot_os.monitor.api.commands import NEEDS
    return list(NEEDS)


@pytest.mark.parametrize(('text', 'code', 'args'), [
    ('idle', 'idle', {}),
    ('approach anna: fall, help, at wrist', 'agent_approach', {'person': 'anna', 'what': {
        'text': 'fall, help, at wrist', 'code': 'emergency_at',
        'args': {'kinds': ['fall', 'help'], 'node': 'wrist'}}}),
    ('stopped: cancelled', 'stopped', {'why': {
        'text': 'cancelled', 'code': 'cancelled', 'args': {}}}),
    ('planned: 3.20 m', 'planned', {'metres': 3.2}),
    ('waiting: my own words', 'waiting', {'why': {'text': 'my own words'}}),
    ('scan: obstacle 0.21 m before the robot, at -12 degrees', 'obstacle',
     {'sensor': 'scan', 'metres': 0.21, 'degrees': -12}),
    ('Smoke at kitchen', 'smoke', {'node': 'kitchen'}),
    ('mail.example.org took it', 'mail_taken', {'server': 'mail.example.org'}),
    ('operator: no report', 'about', {'about': 'operator', 'why': {
        'text': 'no report', 'code': 'no_report', 'args': {}}})])
def test_a_text_is_its_code_with_arguments(text: str, code: str, args: object) -> None:
    assert coded(text) == {'code': code, 'args': args}


def test_a_nested_text_has_a_code_of_its_own() -> None:
    found = coded('give_up anna: fall, at wrist: blocked: no way to the goal is wide enough '
                  '(3 places tried)')
    assert found is not None and found['code'] == 'agent_give_up_why'
    blocked = found['args']['why']
    assert (blocked['code'], blocked['args']['why']['code']) == (
        'blocked', 'places_tried')
    assert blocked['args']['why']['args']['why']['code'] == 'too_narrow'


@pytest.mark.parametrize('held', [None, {'spo2_percent': 3}])
@pytest.mark.parametrize('values', [
    {}, {'pulse_per_min': 150.0}, {name: 100.0 for name in SIGNS if name != 'consciousness'}
    | {'consciousness': 0.0, 'oxygen_l_per_min': 0.0, 'respiration_per_min': 15.0}])
def test_each_score_has_a_code(values: dict[str, float], held: dict[str, int] | None) -> None:
    text = score_text('anna', score(values, 1), held)
    found = coded(text)
    assert found is not None and found['code'].startswith('news2'), text
    assert all(each.get('code') for name in ('points', 'missing', 'before')
               for each in found['args'].get(name, ())), text


def test_the_texts_of_the_shipped_rules_have_codes() -> None:
    yaml = pytest.importorskip('yaml')
    settings = yaml.safe_load(default_path('assisted_living.yaml').read_text())
    robot = settings['/**/robot']['ros__parameters']
    texts = [each['text'] for each in robot.values() if isinstance(each, dict)
             and each.get('type') == 'rule' and each.get('text')]
    assert len(texts) > 5
    assert [each for each in texts if coded(each.replace('{name}', 'kitchen').replace(
        '{value}', '51.5')) is None] == []


def test_what_a_robot_of_another_release_says_of_its_texts_counts() -> None:
    new = {'code': 'of_tomorrow', 'args': {}}
    assert codes_of({'text': 'idle', 'why': 'it was a test', 'codes': {'text': new}},
                    ('text', 'why')) == {'text': new, 'why': {'code': 'was_test', 'args': {}}}
    assert codes_of({'text': 'my own words'}, ('text',)) == {}
    assert codes_of({'text': 'x' * 501}, ('text',)) == {}


@pytest.mark.parametrize('text', [
    'stopped: no progress for 1e999 s', f'after {"9" * 400} s', 'worse: ' * 60,
    f'robot is there, {"picture, " * 50}picture', 'x: NEWS2 1 (' + '; missing: ' * 40,
    ': '.join(['a'] * 100), '\0', '{name}', 'e-stop\nnobody'])
def test_a_text_that_a_robot_makes_up_breaks_nothing(text: str) -> None:
    found = json.dumps(coded(text), allow_nan=False)
    assert len(found) < 20 * len(text) + 1000


def test_a_signal_that_is_a_text_has_its_code_beside_it() -> None:
    assert codes_of_signals({'agent/state': [7, 'idle'], 'pose': [7, {'x': 1.0}],
                             'stop_reason': [7, 'own words'], 'codes/steering': [7, None],
                             'steering': [7, 'nobody']}) == {
        'codes/agent/state': [7, {'code': 'idle', 'args': {}}], 'codes/stop_reason': [7, None]}

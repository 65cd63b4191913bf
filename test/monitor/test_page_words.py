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


"""The words of the page: each language says all that is asked for, and nothing else."""

from __future__ import annotations

import json
from pathlib import Path
import re
from typing import Final

import pytest

from rt_robot_os import monitor

PAGE: Final = Path(monitor.__file__).parent / 'page'
MESSAGES: Final = PAGE / 'messages'
LANGUAGES: Final = sorted(each.name for each in MESSAGES.iterdir())
FILES: Final = sorted(each.stem for each in (MESSAGES / 'en').glob('*.json'))
# t('view.key') and its kin; t(`view.key_${what}`) uses all that begin so. A key that is chosen
# between, or handed on, stands in quotes by itself.
KEY: Final = re.compile(r"""['"]([a-z0-9_]+\.[a-z0-9_]+)['"]""")
BEGINNING: Final = re.compile(r'`([a-z0-9_]+\.[a-z0-9_]*)\$\{')
FAMILY: Final = re.compile(r"\bt\.(?:word|has)\(\s*'([a-z0-9_]+)'")
FILE_ENDS: Final = ('.js', '.css', '.json', '.jsonl', '.csv', '.svg')
HOLE: Final = re.compile(r'\{(\w+)\}')


def _read(language: str, name: str) -> dict[str, object]:
    found: dict[str, object] = json.loads((MESSAGES / language / f'{name}.json').read_text())
    return found


def _all() -> dict[str, object]:
    return {key: value for name in FILES for key, value in _read('en', name).items()}


def _code() -> str:
    return '\n'.join(each.read_text() for each in sorted(PAGE.rglob('*.js'))
                     if 'vendor' not in each.parts)


def _holes(message: object) -> set[str]:
    texts = message.values() if isinstance(message, dict) else [message]
    return {hole for text in texts for hole in HOLE.findall(str(text))}


@pytest.mark.parametrize('name', FILES)
@pytest.mark.parametrize('language', LANGUAGES)
def test_each_language_has_the_same_messages(language: str, name: str) -> None:
    english, other = _read('en', name), _read(language, name)
    assert set(other) == set(english)
    for key, message in other.items():
        assert key.startswith(f'{name}.'), key
        assert isinstance(message, dict) == isinstance(english[key], dict), key
        # A plural may leave its number out, nothing may ask for what is not given.
        assert _holes(message) | {'n'} == _holes(english[key]) | {'n'}, key
        texts = message.values() if isinstance(message, dict) else [message]
        assert all(isinstance(text, str) and text.strip() == text != '' for text in texts), key


def test_no_message_is_missing_and_none_is_left_over() -> None:
    code, known = _code(), _all()
    views = {each.stem for each in (PAGE / 'views').glob('*.js')} | set(FILES)
    used = {key for key in KEY.findall(code)
            if key in known or key.partition('.')[0] in views and not key.endswith(FILE_ENDS)}
    beginnings = {f'words.{family}.' for family in FAMILY.findall(code)}
    beginnings |= {each for each in BEGINNING.findall(code) if each.partition('.')[0] in views}
    assert sorted(used - set(known)) == []
    assert sorted(each for each in beginnings
                  if not any(key.startswith(each) for key in known)) == []
    assert sorted(key for key in known if key not in used
                  and not key.startswith(tuple(beginnings))) == []

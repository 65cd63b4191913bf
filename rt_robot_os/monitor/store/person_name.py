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
Find the name of a person in any text, in any spelling, and replace it.

Case, the Unicode form of accents and the separators between parts of a name are ignored.
``anna_bed`` and ``Annas`` name Anna, ``Hanna`` does not.
"""

from __future__ import annotations

import json
import re
from typing import Any
from typing import Final
import unicodedata

#: Replacement for a name.
ERASED: Final = '(erased)'


def key_of(name: str) -> str:
    """Return a name in the form that is compared."""
    return ' '.join(unicodedata.normalize('NFKC', name).casefold().replace('_', ' ').split())


class PersonName:
    """The name of one person."""

    def __init__(self, name: str) -> None:
        self.key = key_of(name)
        forms = {unicodedata.normalize(how, form) for how in ('NFC', 'NFD', 'NFKC')
                 for form in (name, name.casefold(), name.upper())}
        words = '|'.join(sorted((r'[\s_]+'.join(map(re.escape, each.replace('_', ' ').split()))
                                 for each in forms), key=len, reverse=True))
        self._word = re.compile(rf'(?<![^\W_])(?:{words})s?(?![^\W_])', re.IGNORECASE)
        # Truncated JSON cannot be parsed: each occurrence counts there, also with escapes.
        self._anywhere = re.compile('|'.join(sorted(map(_escaped, forms), key=len, reverse=True)),
                                    re.IGNORECASE)

    def is_of(self, name: str) -> bool:
        """Return whether a name is that of the person."""
        return key_of(name) == self.key

    def is_in(self, text: str) -> bool:
        """Return whether a text names the person; JSON is searched inside."""
        return self.without(text) != text

    def without(self, text: str) -> str:
        """Return a text without the name; JSON stays valid, members with that name are removed."""
        if text[:1] in ('{', '['):
            try:
                found = json.loads(text)
            except (ValueError, RecursionError):
                return self._anywhere.sub(ERASED, text)
            left = self.within(found)
            return text if left == found else json.dumps(
                left, ensure_ascii=False, separators=(',', ':'))
        return self._word.sub(ERASED, text)

    def within(self, found: Any) -> Any:
        """Return a JSON value without the name."""
        if isinstance(found, str):
            return self._word.sub(ERASED, found)
        if isinstance(found, dict):
            return {self._word.sub(ERASED, name): self.within(value)
                    for name, value in found.items() if not (name and self.is_of(name))}
        if isinstance(found, list):
            return [self.within(each) for each in found]
        return found


def _escaped(name: str) -> str:
    """Return a pattern for a name in which any character may be a JSON escape."""
    found = []
    for each in name.replace('_', ' '):
        cases = {each, each.upper(), each.lower()}
        found.append(r'(?:[\s_]|\\u0020)+' if each == ' ' else '(?:{})'.format('|'.join(sorted(
            {re.escape(case) for case in cases}
            | {re.escape(json.dumps(case)[1:-1]) for case in cases}))))
    return ''.join(found)

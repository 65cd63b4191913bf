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
The most common words in long passwords, alone or followed by digits.

A list of all leaked passwords would be larger than this package. At the required length the common
ones are these, rows of the keyboard, and a word followed by digits.
"""

from __future__ import annotations

from typing import Final

_WORDS: Final = (
    'password passwort passw0rd p@ssword p@ssw0rd kennwort geheim secret welcome willkommen hello '
    'hallo letmein iloveyou ichliebedich qwerty qwertz qwertyuiop qwertzuiop asdfghjkl azerty '
    'admin administrator root user guest gast test testtest default changeme monkey dragon '
    'football fussball baseball basketball superman batman princess sunshine shadow master '
    'michael jennifer jordan charlie abcdef abcdefgh abcdefghijkl robot roboter monitor '
    'rt_robot_os rtrobotos carer pflege hospital krankenhaus nurse summer winter spring autumn '
    'sommer herbst computer internet schatz trustno1 whatever starwars pokemon google facebook')
_LONG: Final = (
    '123456789012 1234567890123 12345678901234 0123456789 012345678901 123456654321 111111111111 '
    '000000000000 121212121212 123123123123 112233445566 987654321098 qwertyuiopas '
    'qwertyuiopasdf qwertyuiop123 1qaz2wsx3edc 1q2w3e4r5t6y 1q2w3e4r5t6y7u zaq12wsxcde3 '
    'asdfghjkl123 passwordpassword passwortpasswort password1234 correcthorsebatterystaple '
    'thisisapassword iloveyouforever letmeinplease qazwsxedcrfv abcdefghijklm abcd1234abcd '
    'abc123abc123 mypassword123 adminadmin12 adminadminadmin testtesttest hellohellohello '
    'asdfasdfasdf qwerqwerqwer qwertyqwerty 123qweasdzxc q1w2e3r4t5y6 1234qwerasdf '
    'football1234 changemenow1')
COMMON: Final = frozenset((*_WORDS.split(), *_LONG.split()))

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

"""What the gateway needs of libraries that not everybody has, and how they are installed."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from rt_robot_os.errors import StartError


def check() -> None:
    """
    Load what the gateway needs.

    :raises StartError: it is missing; the message says how it is installed.
    """
    try:
        import_module('websockets')
    except ImportError as error:
        raise StartError('the gateway needs websockets: pip install websockets') from error


def why_no_voice() -> str:
    """Return what keeps this machine from calls; empty when nothing does."""
    if find_spec('aiortc') is None:  # found, not loaded: that takes a second, in every gateway
        return 'voice needs aiortc: pip install aiortc sounddevice'
    return ''

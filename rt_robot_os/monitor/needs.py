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

"""What the server needs of libraries that not everybody has, and how they are installed."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from rt_robot_os.errors import StartError

_REMEDY: Final = ('pip install fastapi uvicorn websockets sqlalchemy alembic argon2-cffi '
                  'cryptography')


def check() -> None:
    """
    Load what the server needs.

    :raises StartError: something is missing; the message says how it is installed.
    """
    try:
        import_module('alembic')
        import_module('argon2')
        import_module('cryptography')
        import_module('fastapi')
        import_module('sqlalchemy')
        import_module('uvicorn')
    except ImportError as error:
        raise StartError(f'the monitor needs {error.name}: {_REMEDY}') from error


def check_postgres() -> None:
    """
    Load what a PostgreSQL database needs.

    :raises StartError: it is missing; the message says how it is installed.
    """
    try:
        import_module('psycopg')
    except ImportError as error:
        raise StartError('a PostgreSQL database needs psycopg: pip install "psycopg[binary]"'
                         ) from error

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
Arrays in one file, NumPy's ``.npz`` with a version and a checksum: complete or rejected.

Input is not trusted: its size is bounded before it is unpacked, and nothing in it is executed.
"""

from __future__ import annotations

from collections.abc import Mapping
import hashlib
import io
import os
from pathlib import Path
import stat
from typing import Any
from typing import Final
import zipfile
import zlib

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import ConfigError

Arrays = dict[str, npt.NDArray[Any]]

_CHECKSUM: Final = 'sha256'
_SUFFIX: Final = '.npy'
_KINDS: Final = 'biuf'
_MEMBERS_MOST: Final = 64
#: Size of a file, and of its unpacked content: ten thousand keyframes are some 25 MB.
FILE_MOST: Final = 1 << 28
_UNPACKED_MOST: Final = 1 << 30


def pack(arrays: Mapping[str, npt.NDArray[Any]], level: int = 6) -> bytes:
    """
    Return arrays as the bytes of a file.

    :param level: of zlib: 1 takes a third of the time of 6, and the file is a fifth longer.
    """
    members = {name: _member(array) for name, array in arrays.items()}
    members[_CHECKSUM] = _member(np.frombuffer(_digest(members), np.uint8))
    file = io.BytesIO()
    with zipfile.ZipFile(file, 'w', zipfile.ZIP_DEFLATED, compresslevel=level) as archive:
        for name, data in members.items():
            # A fixed date: equal maps give equal files.
            archive.writestr(_info(name), data, compresslevel=level)
    return file.getvalue()


def _info(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name + _SUFFIX)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    return info


def _member(array: npt.NDArray[Any]) -> bytes:
    file = io.BytesIO()
    # NumPy's own writer, in the version that every reader supports.
    np.lib.format.write_array(file, np.ascontiguousarray(array), (1, 0), allow_pickle=False)
    return file.getvalue()


def _digest(members: Mapping[str, bytes]) -> bytes:
    found = hashlib.sha256()
    for name in sorted(members):
        found.update(f'{name} {len(members[name])}\n'.encode())
        found.update(members[name])
    return found.digest()


def unpack(data: bytes) -> Arrays:
    """
    Return the arrays of a file.

    :raises ValueError: it is malformed, damaged or too large.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = _members(archive)
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError,
            RuntimeError, UnicodeDecodeError, ValueError) as error:
        # RuntimeError: a flipped bit may mean "encrypted".
        raise ValueError(f'is damaged: {error}') from None
    arrays = {name: _array(member) for name, member in members.items()}
    checksum = arrays.pop(_CHECKSUM, None)
    members.pop(_CHECKSUM, None)
    if checksum is None or checksum.tobytes() != _digest(members):
        raise ValueError('is damaged: its checksum is wrong')
    return arrays


def _members(archive: zipfile.ZipFile) -> dict[str, bytes]:
    about = archive.infolist()
    size = sum(each.file_size for each in about)
    if len(about) > _MEMBERS_MOST or size > _UNPACKED_MOST:
        raise ValueError(f'{len(about)} arrays of {size} bytes are more than {_MEMBERS_MOST} of '
                         f'{_UNPACKED_MOST}')
    members: dict[str, bytes] = {}
    for each in about:
        with archive.open(each) as file:
            data = file.read(each.file_size + 1)
        name = each.filename.removesuffix(_SUFFIX)
        if len(data) != each.file_size or name in members:
            raise ValueError(f'{name} differs from the directory of the file')
        members[name] = data
    return members


def _array(member: bytes) -> npt.NDArray[Any]:
    """Return an array; one whose header asks for more bytes than there are is rejected."""
    file = io.BytesIO(member)
    try:
        if np.lib.format.read_magic(file) != (1, 0):
            raise ValueError("another version of NumPy's format")
        shape, fortran, kind = np.lib.format.read_array_header_1_0(file)
    except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError) as error:
        raise ValueError(f'is damaged: an array has no header: {error}') from None
    rest = member[file.tell():]
    count = 1
    for each in shape:
        count *= each
    if (kind.kind not in _KINDS or fortran or min(shape, default=0) < 0
            or count * kind.itemsize != len(rest)):
        raise ValueError(f'is damaged: an array of {kind} of shape {shape} has {len(rest)} bytes')
    return np.frombuffer(rest, kind).reshape(shape)


# ---- files --------------------------------------------------------------------------------------

def bytes_of(path: Path, most: int = FILE_MOST) -> bytes:
    """
    Read a file of unknown kind without blocking.

    :raises ConfigError: it cannot be read, is not a regular file, or is too long.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
        with open(handle, 'rb') as file:
            about = os.fstat(handle)
            if not stat.S_ISREG(about.st_mode):
                raise ConfigError([f'{path}: is not a file'])
            if about.st_size > most:
                raise ConfigError([f'{path}: {about.st_size} bytes are more than {most}'])
            return file.read(most)
    except (OSError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        said = getattr(error, 'strerror', None) or error
        raise ConfigError([f'{path}: cannot be read: {said}']) from None


def write_whole(path: Path, data: bytes) -> None:
    """
    Write a new file and sync it to the disk; an old one of that name is replaced.

    It is incomplete while it is written, so give it a temporary name and rename it afterwards.
    """
    path.unlink(missing_ok=True)  # a link at this path is not followed
    with path.open('xb') as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Sync the entries of a folder to the disk."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)

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

"""The errors of an I2C bus: their meaning and their remedy."""

from __future__ import annotations

import errno
import os
import re
from typing import Final

from rt_robot_os.base.errors import DeviceError

_BUS_NUMBER: Final = re.compile(r'/dev/i2c-(\d+)').fullmatch
_NO_ANSWER: Final = (errno.ENXIO, errno.EREMOTEIO)
# Errors after which the open file is unusable.
_GONE: Final = (errno.ENODEV, errno.EBADF, errno.EPIPE, errno.ECONNRESET, errno.ESHUTDOWN)


def is_gone(error: OSError) -> bool:
    """Return whether the open bus is unusable after this error."""
    return error.errno in _GONE


def open_error(path: str, error: OSError) -> DeviceError:
    """Return why a bus cannot be opened."""
    if isinstance(error, DeviceError):
        return error
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeviceError(
            f'I2C bus {path} may not be opened: add the user to the group i2c '
            '(sudo usermod -aG i2c $USER; on some systems it is dialout) and log in again')
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR):
        return DeviceError(
            f'I2C bus {path} does not exist: ls /dev/i2c-* lists the buses; when there are none, '
            'enable I2C (sudo modprobe i2c-dev; on a Raspberry Pi also dtparam=i2c_arm=on)')
    if error.errno == errno.ENOTTY:
        return DeviceError(f'{path} is not an I2C bus: check the port (ls /dev/i2c-* lists them)')
    return DeviceError(f'I2C bus {path} cannot be opened ({_cause(error)}): check the path')


def transfer_error(path: str, address: int, error: OSError) -> DeviceError:
    """Return why a transaction failed."""
    if isinstance(error, DeviceError):
        return error
    return DeviceError(f'{place(path, address)}: {_remedy(path, address, error)}')


def _remedy(path: str, address: int, error: OSError) -> str:
    number = error.errno
    if number in _NO_ANSWER:
        match = _BUS_NUMBER(path)
        who = f' (i2cdetect -y {match[1]} lists the devices)' if match else ''
        return (f'no device answers: check its power, SDA, SCL and pull-up resistors, and the '
                f'address{who}')
    if number in _GONE:
        return f'the bus is gone ({_cause(error)}): check the adapter; it will be opened again'
    if number == errno.ETIMEDOUT:
        return ('the transfer timed out, a device holds SDA or SCL low: switch the power of the '
                'devices off and on, check the wiring and the pull-up resistors')
    if number == errno.EBUSY:
        return (f'busy ({error.strerror}): the Linux driver of the device must be unloaded or '
                f'removed from the device tree (/sys/bus/i2c/devices/*-{address:04x}/driver)')
    if number == errno.EAGAIN:
        return 'arbitration was lost: another master is on the bus, or noise; shorten the wires'
    if number in (errno.EOPNOTSUPP, errno.EINVAL):
        return f'the adapter does not support this transfer ({_cause(error)}): use another adapter'
    return f'the transfer failed ({_cause(error)}): check the wiring and the pull-up resistors'


def place(path: str, address: int) -> str:
    """Name a device on a bus."""
    return f'I2C bus {path}, address 0x{address:02x}'


def _cause(error: OSError) -> str:
    if error.errno is None:
        return str(error)
    return f'{errno.errorcode.get(error.errno, error.errno)}: {os.strerror(error.errno)}'

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
A private certificate authority, for a server in a network without public DNS names.

The authority is installed once on each tablet; the server's certificate is renewed without that.
To limit the harm of a stolen key, the authority is constrained to private addresses, local names,
and the names that it was created with.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from datetime import timedelta
from datetime import timezone
from ipaddress import ip_address
from ipaddress import ip_network
from ipaddress import IPv4Address
from ipaddress import IPv6Address
import os
from pathlib import Path
import re
import secrets
from typing import Final

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID
from cryptography.x509.oid import NameOID
from rt_robot_os.base.errors import StartError

CA_DAYS: Final = 3650
#: Longest validity that Apple devices accept.
SERVER_DAYS: Final = 397
#: Remaining validity at which a renewal is due.
RENEW_DAYS: Final = 30
CA_FILE: Final = 'ca.pem'
CA_KEY_FILE: Final = 'ca.key'
SERVER_FILE: Final = 'server.pem'
SERVER_KEY_FILE: Final = 'server.key'
#: The clock of a tablet may be behind by this much.
_EARLIER: Final = timedelta(hours=24)
_NAME: Final = re.compile(r'(?=.{1,253}$)([a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?)'
                          r'(\.[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?)*', re.ASCII)
_LOCAL_NAMES: Final = ('localhost', 'local', 'lan', 'internal', 'home.arpa')
_LOCAL_NETWORKS: Final = ('127.0.0.0/8', '10.0.0.0/8', '172.16.0.0/12', '192.168.0.0/16',
                          '169.254.0.0/16', '::1/128', 'fc00::/7', 'fe80::/10')
_PRIVATE: Final = 0o600
_PUBLIC: Final = 0o644

_Key = ec.EllipticCurvePrivateKey


@dataclass(frozen=True)
class Certificate:
    """
    The created certificates.

    :ivar names: names and addresses in the server's certificate.
    :ivar is_new_authority: the authority is new and must be installed on the tablets.
    """

    authority: Path
    certificate: Path
    key: Path
    names: tuple[str, ...]
    fingerprint: str
    ends: datetime
    is_new_authority: bool


def make(folder: Path, names: Sequence[str], *, days: int = SERVER_DAYS,
         renew_authority: bool = False, now: datetime | None = None) -> Certificate:
    """
    Create or renew the server's certificate, and create the authority if there is none.

    :param names: host names and addresses of the server; those of this machine are added.
    :param days: validity; at most that of the authority.
    :param renew_authority: create a new authority as well, which each tablet must install.
    :raises StartError: a name is not valid or not allowed for the authority, the authority has
        expired, or the folder is not writable.
    """
    now = now or datetime.now(timezone.utc)
    entries = _entries([*names, 'localhost', '127.0.0.1', '::1'])
    if not 1 <= days <= SERVER_DAYS:
        raise StartError(f'--days {days}: 1 to {SERVER_DAYS}; tablets accept no longer validity')
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        is_new = renew_authority or not (folder / CA_FILE).exists()
        if is_new:
            _make_authority(folder, entries, now)
        authority, authority_key = _read_authority(folder, now)
        _check_may_vouch(authority, entries)
        key = ec.generate_private_key(ec.SECP256R1())
        ends = min(now + timedelta(days=days), authority.not_valid_after_utc)
        certificate = _server(authority, authority_key, key, entries, now, ends)
        _write(folder / SERVER_KEY_FILE, _key_bytes(key), _PRIVATE)
        _write(folder / SERVER_FILE, _pem(certificate) + _pem(authority), _PUBLIC)
    except OSError as error:
        if isinstance(error, StartError):
            raise
        raise StartError(f'{folder}: {error.strerror}; give another with --folder') from error
    return Certificate(folder / CA_FILE, folder / SERVER_FILE, folder / SERVER_KEY_FILE,
                       tuple(_shown(each) for each in entries), fingerprint(authority), ends,
                       is_new)


def days_left(path: Path, now: datetime | None = None) -> float:
    """
    Return the days until a certificate expires; negative when it has expired.

    :raises StartError: the file cannot be read or is none.
    """
    found = _read(path)
    now = now or datetime.now(timezone.utc)
    return (found.not_valid_after_utc - now).total_seconds() / 86400


def names_of(path: Path) -> list[str]:
    """
    Return the names and addresses in a certificate.

    :raises StartError: the file cannot be read or is none.
    """
    try:
        found = _read(path).extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except x509.ExtensionNotFound:
        return []
    return [_shown(each) for each in found.value]


def fingerprint(certificate: x509.Certificate) -> str:
    """Return its SHA-256 fingerprint as pairs of hexadecimal digits."""
    return certificate.fingerprint(hashes.SHA256()).hex(':').upper()


def _entries(names: Iterable[str]) -> list[x509.GeneralName]:
    found: list[x509.GeneralName] = []
    for name in names:
        entry = _entry(name.strip().lower().rstrip('.'))
        if entry not in found:
            found.append(entry)
    return found


def _entry(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(name.strip('[]')))
    except ValueError:
        pass
    if not _NAME.fullmatch(name) or name.replace('.', '').isdecimal():
        raise StartError(f'{name[:80]!a} is neither a host name nor an address')
    return x509.DNSName(name)


def _make_authority(folder: Path, entries: Sequence[x509.GeneralName], now: datetime) -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.ORGANIZATION_NAME, 'rt_robot_os monitor'),
                      # Distinguishes two authorities in the list of a tablet.
                      x509.NameAttribute(NameOID.COMMON_NAME, 'rt_robot_os monitor CA '
                                         f'{now:%Y-%m-%d} {secrets.token_hex(3)}')])
    public = key.public_key()
    builder = _builder(name, name, public, now, now + timedelta(days=CA_DAYS))
    certificate = builder.add_extension(
        x509.BasicConstraints(ca=True, path_length=0), critical=True).add_extension(
        _usage(is_authority=True), critical=True).add_extension(
        x509.SubjectKeyIdentifier.from_public_key(public), critical=False).add_extension(
        x509.NameConstraints(_vouches_for(entries), None), critical=True).sign(
        key, hashes.SHA256())
    _write(folder / CA_KEY_FILE, _key_bytes(key), _PRIVATE)
    _write(folder / CA_FILE, _pem(certificate), _PUBLIC)


def _vouches_for(entries: Sequence[x509.GeneralName]) -> list[x509.GeneralName]:
    found: list[x509.GeneralName] = [x509.DNSName(name) for name in _LOCAL_NAMES]
    found += [x509.IPAddress(ip_network(each)) for each in _LOCAL_NETWORKS]
    for entry in entries:
        if isinstance(entry, x509.DNSName):
            more: x509.GeneralName = entry
        else:
            more = x509.IPAddress(ip_network(entry.value))
        if not _is_within(entry, found):
            found.append(more)
    return found


def _is_within(entry: x509.GeneralName, allowed: Iterable[x509.GeneralName]) -> bool:
    for each in allowed:
        if isinstance(entry, x509.DNSName) and isinstance(each, x509.DNSName):
            if entry.value == each.value or entry.value.endswith('.' + each.value):
                return True
        elif (isinstance(entry, x509.IPAddress) and isinstance(each, x509.IPAddress)
                and isinstance(entry.value, (IPv4Address, IPv6Address))
                and not isinstance(each.value, (IPv4Address, IPv6Address))
                and entry.value.version == each.value.version and entry.value in each.value):
            return True
    return False


def _check_may_vouch(authority: x509.Certificate, entries: Sequence[x509.GeneralName]) -> None:
    try:
        limits = authority.extensions.get_extension_for_class(x509.NameConstraints).value
    except x509.ExtensionNotFound:
        return
    wrong = [_shown(each) for each in entries
             if not _is_within(each, limits.permitted_subtrees or ())]
    if wrong:
        raise StartError(f'the authority may not certify {", ".join(wrong)}: with '
                         '--renew-authority a new one is created, which each tablet must install')


def _read_authority(folder: Path, now: datetime) -> tuple[x509.Certificate, _Key]:
    authority = _read(folder / CA_FILE)
    try:
        key = serialization.load_pem_private_key((folder / CA_KEY_FILE).read_bytes(), None)
    except (ValueError, TypeError) as error:
        raise StartError(f'{folder / CA_KEY_FILE} is not a private key: {error}') from error
    if not isinstance(key, _Key) or key.public_key() != authority.public_key():
        raise StartError(f'{folder / CA_KEY_FILE} is not the key of {folder / CA_FILE}')
    if authority.not_valid_after_utc <= now:
        raise StartError(f'{folder / CA_FILE} has expired: with --renew-authority a new one is '
                         'created, which each tablet must install')
    return authority, key


def _server(authority: x509.Certificate, authority_key: _Key, key: _Key,
            entries: Sequence[x509.GeneralName], now: datetime, ends: datetime
            ) -> x509.Certificate:
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, _shown(entries[0])[:64])])
    identifier = authority.extensions.get_extension_for_class(x509.SubjectKeyIdentifier).value
    found = _builder(name, authority.subject, key.public_key(), now, ends).add_extension(
        x509.BasicConstraints(ca=False, path_length=None), critical=True).add_extension(
        _usage(is_authority=False), critical=True).add_extension(
        x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False).add_extension(
        x509.SubjectAlternativeName(entries), critical=False).add_extension(
        x509.SubjectKeyIdentifier.from_public_key(key.public_key()),
        critical=False).add_extension(
        x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(identifier),
        critical=False).sign(authority_key, hashes.SHA256())
    try:
        found.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError) as error:
        raise StartError(f'the authority is incomplete: {error}; --renew-authority creates a new '
                         'one') from error
    return found


def _builder(subject: x509.Name, issuer: x509.Name, public: ec.EllipticCurvePublicKey,
             now: datetime, ends: datetime) -> x509.CertificateBuilder:
    return x509.CertificateBuilder().subject_name(subject).issuer_name(issuer).public_key(
        public).serial_number(x509.random_serial_number()).not_valid_before(
        now - _EARLIER).not_valid_after(ends)


def _usage(is_authority: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not is_authority, content_commitment=False, key_encipherment=False,
        data_encipherment=False, key_agreement=False, key_cert_sign=is_authority,
        crl_sign=is_authority, encipher_only=False, decipher_only=False)


def _read(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except OSError as error:
        raise StartError(f'{path}: {error.strerror}') from error
    except ValueError as error:
        raise StartError(f'{path} is not a certificate: {error}') from error


def _pem(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(serialization.Encoding.PEM)


def _key_bytes(key: _Key) -> bytes:
    return key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8,
                             serialization.NoEncryption())


def _shown(entry: x509.GeneralName) -> str:
    return str(entry.value)


def _write(path: Path, content: bytes, mode: int) -> None:
    """Write a file atomically, with its mode from the beginning."""
    fresh = path.with_name(f'.{path.name}.{secrets.token_hex(4)}')
    try:
        with open(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, mode),
                  'wb') as file:
            os.fchmod(file.fileno(), mode)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)

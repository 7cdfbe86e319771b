"""The seal: what is hidden is fixed before the first diagnosis, and nobody but the holder of the
key can read it until then.

For each case a random salt is drawn; ``SHA-256(salt + canonical JSON of the truth)`` is its
commitment, and the root, SHA-256 over all commitments by name, is printed before any diagnosis
starts. Truth and salt lie encrypted (Fernet: AES-128-CBC with HMAC-SHA-256) in the truth folder.
Opening decrypts, hashes again and compares: a truth that was changed, exchanged or removed does not
open.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from cryptography.fernet import Fernet, InvalidToken

from ankle_interfaces.errors import UserError

KEY_FILE = "key"
SALT_BYTES = 32


class SealError(UserError, RuntimeError):
    """Reports a truth that is missing, cannot be decrypted, or is not the one that was committed
    to.
    """


def canonical(truth: dict[str, Any]) -> bytes:
    """Return the one byte string for a truth: sorted keys, no spaces, shortest exact floats."""
    return json.dumps(truth, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def commitment(salt: bytes, truth: dict[str, Any]) -> str:
    """Return salted hash of a truth, hexadecimal."""
    return hashlib.sha256(salt + canonical(truth)).hexdigest()


def root(commitments: dict[str, str]) -> str:
    """Return one hash over the commitments of all cases, hexadecimal."""
    return hashlib.sha256(
        "".join(f"{name}:{commitments[name]}\n" for name in sorted(commitments)).encode()
    ).hexdigest()


class Seal:
    """Holds the sealed truths of a study.

    Parameters
    ----------
    folder
        Where they lie, encrypted; created where needed.
    store_key
        Keep the key in the folder, readable by its owner only, so that an interrupted study can go
        on. Only right where the diagnosis cannot read the folder; otherwise the key lives in this
        object and nowhere else.

    Raises
    ------
    SealError
        Truths are there from before, but no key to them.
    """

    def __init__(self, folder: Path, store_key: bool) -> None:
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        file = self.folder / KEY_FILE
        if file.exists():
            key = file.read_bytes()
        else:
            if any(self.folder.glob("*.sealed")):
                raise SealError(
                    f"{self.folder} holds sealed truths, but their key is gone with the process "
                    "that made them; begin in a new folder"
                )
            key = Fernet.generate_key()
            if store_key:
                with os.fdopen(
                    os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb"
                ) as stream:
                    stream.write(key)
        self._cipher = Fernet(key)

    def _file(self, name: str) -> Path:
        return self.folder / f"{name}.sealed"

    def close(self, name: str, truth: dict[str, Any]) -> str:
        """Seal the truth about one case and return its commitment.

        Raises
        ------
        SealError
            The case is sealed already.
        """
        if self._file(name).exists():
            raise SealError(f"{name} is sealed already")
        salt = os.urandom(SALT_BYTES)
        content = json.dumps({"salt": salt.hex(), "truth": truth}, allow_nan=False).encode()
        half = self._file(name).with_suffix(".half")
        half.write_bytes(self._cipher.encrypt(content))
        # A case counts as sealed only when its file is complete.
        half.replace(self._file(name))
        return commitment(salt, truth)

    def _content(self, name: str) -> tuple[bytes, dict[str, Any]]:
        try:
            content = json.loads(self._cipher.decrypt(self._file(name).read_bytes()))
        except FileNotFoundError:
            raise SealError(f"the truth about {name} is missing in {self.folder}") from None
        except InvalidToken:
            raise SealError(
                f"the truth about {name} was changed or sealed with another key"
            ) from None
        return bytes.fromhex(content["salt"]), content["truth"]

    def sealed(self) -> dict[str, str]:
        """Return commitments of all cases that are sealed, by name."""
        names = sorted(file.stem for file in self.folder.glob("*.sealed"))
        return {name: commitment(*self._content(name)) for name in names}

    def open(self, name: str, committed: str) -> tuple[bytes, dict[str, Any]]:
        """Return salt and truth of a case.

        Raises
        ------
        SealError
            Missing, changed, or not what was committed to.
        """
        salt, truth = self._content(name)
        found = commitment(salt, truth)
        if found != committed:
            raise SealError(
                f"the truth about {name} hashes to {found}, but {committed} was announced"
            )
        return salt, truth

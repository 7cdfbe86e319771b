"""Run a command that cannot read some folders: Linux Landlock, enforced by the kernel, without
privileges.

Run as a script, ``python concealment.py --hide FOLDER ... -- COMMAND ...`` confines itself and then
becomes the command. Landlock only knows what is allowed, so everything beside the way down to a
hidden folder is allowed. The confined process and all of its children can neither read nor write
there, nor look into the memory of processes outside (Landlock denies ptrace towards them). It
cannot list the folders on the way down, nor create files directly in them.

This file imports the standard library only: it runs before the confined command, wherever that
lives.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

from ankle_interfaces.errors import UserError

# include/uapi/linux/landlock.h; the system calls have the same numbers on every architecture.
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION_FLAG = 1
_RULE_PATH_BENEATH = 1
_NO_NEW_PRIVILEGES = 38
# Rights to files that exist from each version of the interface on, as the number of bits.
_RIGHTS = {1: 13, 2: 14, 3: 15, 4: 15, 5: 16}
# Rights that a rule on a file (not a folder) may carry: execute, write, read, truncate, ioctl on
# devices.
_FILE_RIGHTS = 0b111 | 1 << 14 | 1 << 15


class ConcealmentError(UserError, RuntimeError):
    """Reports that the kernel refused to confine this process."""


class _RulesetAttributes(ctypes.Structure):
    _fields_ = [("handled_access_fs", ctypes.c_uint64)]


class _PathBeneath(ctypes.Structure):
    _pack_ = 1
    _fields_ = [("allowed_access", ctypes.c_uint64), ("parent_fd", ctypes.c_int32)]


def interface_version() -> int:
    """Return the version of Landlock in this kernel; 0 where there is none."""
    if not sys.platform.startswith("linux"):
        return 0
    return max(
        int(ctypes.CDLL(None, use_errno=True).syscall(_CREATE_RULESET, None, 0, _VERSION_FLAG)), 0
    )


def allowed_beside(hidden: list[Path]) -> list[Path]:
    """Return every path that is not on the way down to a hidden folder, as few as possible."""
    hidden = [path.resolve() for path in hidden]
    way = {parent for path in hidden for parent in path.parents}
    allowed: list[Path] = []
    for folder in sorted(way):
        if any(folder == path or path in folder.parents for path in hidden):
            continue
        allowed += [
            child
            for child in folder.iterdir()
            if child not in way and child not in hidden and not child.is_symlink()
        ]
    return allowed


def conceal(hidden: list[Path]) -> None:
    """Take away this process's right to read or write the hidden folders, for good and for all its
    children.

    Raises
    ------
    ConcealmentError
        This kernel has no Landlock, or it refused.
    """
    version = interface_version()
    if version < 1:
        raise ConcealmentError("this kernel has no Landlock")
    libc = ctypes.CDLL(None, use_errno=True)
    rights = (1 << _RIGHTS[min(version, max(_RIGHTS))]) - 1
    attributes = _RulesetAttributes(rights)
    ruleset = libc.syscall(_CREATE_RULESET, ctypes.byref(attributes), ctypes.sizeof(attributes), 0)
    if ruleset < 0:
        raise ConcealmentError(f"Landlock refused the rules: {os.strerror(ctypes.get_errno())}")
    for path in allowed_beside(hidden):
        try:
            descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
        except OSError:
            continue
        rule = _PathBeneath(rights if path.is_dir() else rights & _FILE_RIGHTS, descriptor)
        # Pseudo-files that cannot carry a rule stay forbidden, which hides more, not less.
        libc.syscall(_ADD_RULE, ruleset, _RULE_PATH_BENEATH, ctypes.byref(rule), 0)
        os.close(descriptor)
    if libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0) or libc.syscall(_RESTRICT_SELF, ruleset, 0):
        raise ConcealmentError(f"Landlock refused to confine: {os.strerror(ctypes.get_errno())}")
    os.close(ruleset)


def concealed(command: list[str], hidden: list[Path]) -> list[str]:
    """Return the command line that runs `command` without sight of the hidden folders."""
    flags = [part for path in hidden for part in ("--hide", str(Path(path).resolve()))]
    return [sys.executable, "-I", str(Path(__file__).resolve()), *flags, "--", *command]


def works(hidden: list[Path], environment: dict[str, str] | None = None) -> bool:
    """Try whether a concealed process really cannot see the hidden folders."""
    attempt = (
        "import os, sys\n"
        "for folder in sys.argv[1:]:\n"
        "    try:\n"
        "        os.listdir(folder)\n"
        "    except PermissionError:\n"
        "        continue\n"
        "    sys.exit('seen')\n"
    )
    # The launcher lies in a folder that may itself be hidden; it is read before the curtain falls.
    probe = concealed(
        [sys.executable, "-I", "-c", attempt, *(str(path.resolve()) for path in hidden)], hidden
    )
    return (
        subprocess.run(
            probe, capture_output=True, timeout=60, env=environment, check=False
        ).returncode
        == 0
    )


def main(arguments: list[str]) -> None:
    """Confine, then become the command."""
    split = arguments.index("--")
    hidden = [Path(path) for path in arguments[1:split:2]]
    command = arguments[split + 1 :]
    try:
        conceal(hidden)
    except ConcealmentError as error:
        sys.exit(f"concealment: {error}")
    os.execvp(command[0], command)


if __name__ == "__main__":
    main(sys.argv[1:])

"""The process that holds a port, as Linux states it under /proc."""

from __future__ import annotations

from pathlib import Path


def holder_of(protocol: str, port: int) -> str:
    """Return which process holds a port, as words to append to "address in use".

    The text is empty where nobody holds it or the system does not say.

    Parameters
    ----------
    protocol
        ``udp`` or ``tcp``.
    port
        Number of the port on this computer.
    """
    inodes = {
        fields[9]
        for table in (f"/proc/net/{protocol}", f"/proc/net/{protocol}6")
        for fields in _rows(Path(table))
        if int(fields[1].rpartition(":")[2], 16) == port and fields[9] != "0"
    }
    links = {f"socket:[{inode}]" for inode in inodes}
    for process in Path("/proc").glob("[0-9]*") if links else ():
        if _holds(process, links):
            return f"; port {port} is held by process {process.name} ({_command(process)})"
    return ""


def _rows(table: Path) -> list[list[str]]:
    try:
        return [line.split() for line in table.read_text().splitlines()[1:]]
    except OSError:
        return []


def _holds(process: Path, links: set[str]) -> bool:
    try:
        return any(str(entry.readlink()) in links for entry in (process / "fd").iterdir())
    except OSError:  # another user's process, or one that has ended meanwhile
        return False


def _command(process: Path) -> str:
    try:
        words = (process / "cmdline").read_bytes().split(b"\0")
    except OSError:
        return "ended"
    return " ".join(word.decode(errors="replace") for word in words).strip()[:120]

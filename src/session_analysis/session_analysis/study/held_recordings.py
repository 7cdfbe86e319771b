"""Whether a study holds a recording already, told by the content of its data files."""

from __future__ import annotations

from pathlib import Path

from session_analysis.errors import AnalysisError
from session_analysis.study.layout import Study
from session_recorder.importing.source_of_bag import sha256_of
from session_recorder.importing.tables import READERS


def require_new(study: Study, recording: Path) -> None:
    """Refuse a recording of which the study holds a data file already, under whatever name.

    Parameters
    ----------
    study
        The study that it is to be added to.
    recording
        A bag, or a file of another system.

    Raises
    ------
    AnalysisError
        A file of the study has the same content; the message names it.
    """
    new = [file for file in _data_files(recording) if file.stat().st_size]
    sizes = {file.stat().st_size for file in new}
    sums: dict[str, Path] | None = None
    for source in sorted(study.folder.glob("sub-*/ses-*/sub-*")):
        for held in _data_files(source):
            if held.stat().st_size not in sizes:
                continue
            if sums is None:
                sums = {sha256_of(file): file for file in new}
            digest = sha256_of(held)
            if digest in sums:
                raise AnalysisError(
                    f"{recording} is in the study already, as {source}: {sums[digest].name} and "
                    f"{held.name} have the same content (SHA-256 {digest}); nothing is copied"
                )


def _data_files(recording: Path) -> list[Path]:
    """Return the files of a recording that hold its samples; none where it is something else."""
    if recording.is_dir():
        return sorted(file for file in recording.glob("*.mcap") if file.is_file())
    is_data = recording.is_file() and recording.suffix.lower() in READERS
    return [recording] if is_data else []

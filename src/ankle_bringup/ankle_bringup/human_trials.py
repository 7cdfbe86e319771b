"""Public recordings of human ankles: fetched once, checked, imported as bags."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ankle_bringup.errors import RunError

TRIAL = "trial_{}"
"""Name of the bag of a trial; trials are counted from 1 in the order of the file."""


@dataclass(frozen=True)
class Recording:
    """Describes a public file of recordings.

    Attributes
    ----------
    url
        Where it is.
    sha256
        Checksum of the file, in hexadecimal digits.
    name
        What the file is called in the cache.
    """

    url: str
    sha256: str
    name: str


# Five trials of one healthy ankle under small random steps, 60 s at 1000 Hz each, by the
# REKLAB group of McGill University (GPL-2). The commit makes sure that it is always the same file.
MCGILL = Recording(
    "https://raw.githubusercontent.com/reklab/reklab_public/"
    "61d423f9bf48f695c218a7f2c2996308bc5bde9b/stiffnessID/experimental_data.mat",
    "c8f08330ae256b8984052c0a8f907c7e077e6062547c21d154999a0fb130114d",
    "reklab_experimental_data.mat",
)
RATE = 1000.0  # Hz; the file itself does not state it in a readable place


def cache_folder() -> Path:
    """Return the user's folder for fetched recordings."""
    import pooch

    return Path(pooch.os_cache("ankle"))


def fetch(recording: Recording, folder: Path, show_progress: bool = True) -> Path:
    """Bring a public file to this computer, unless it is there already.

    Parameters
    ----------
    recording
        The recording to fetch.
    folder
        Where to keep it.
    show_progress
        Whether to draw a progress bar on stderr.

    Returns
    -------
    Path
        The file, with the stated checksum.

    Raises
    ------
    RunError
        There is no connection, or the file is not the one that was published.
    """
    import pooch
    import requests

    pooch.get_logger().setLevel("WARNING")
    try:
        path = pooch.retrieve(
            recording.url,
            f"sha256:{recording.sha256}",
            fname=recording.name,
            path=folder,
            downloader=pooch.HTTPDownloader(progressbar=show_progress, timeout=30),
        )
    except requests.exceptions.RequestException as error:
        raise RunError(
            f"{recording.url} cannot be fetched ({type(error).__name__}): is this computer "
            f"connected to the internet? A copy fetched elsewhere is used when it lies at "
            f"{folder / recording.name}"
        ) from None
    except ValueError:
        raise RunError(
            f"{recording.url} is not the published file: its SHA-256 is not {recording.sha256}"
        ) from None
    return Path(path)


def import_trials(
    file: Path, folder: Path, progress: Callable[[float], None] | None = None
) -> list[Path]:
    """Import each trial of the file as a bag of its own.

    Parameters
    ----------
    file
        A MAT file with one object of the NLID toolbox for each trial, of two columns: position
        [rad] and torque [N.m] with the subject's sign.
    folder
        Where the bags ``trial_1``, ``trial_2``, ... are written. Bags that are there stay.
    progress
        Called with the done share, from 0 to 1.

    Returns
    -------
    list[Path]
        The bags. A trial whose samples are all the same is no recording and is left out.

    Raises
    ------
    ImportRefused
        The file is not of this kind.
    """
    from session_recorder.importing import import_recording, read_table

    table = read_table(file)
    objects = [name.partition(":")[0] for name in table.columns if name.endswith(":2")]
    bags = []
    for number, name in enumerate(objects, start=1):
        bag = folder / TRIAL.format(number)
        if np.ptp(table.columns[f"{name}:1"]) > 0.0:
            if not bag.exists():
                columns = {"position[rad]": f"{name}:1", "torque[N.m]": f"{name}:2"}
                import_recording(table, bag, columns, torque_sign="subject", rate=RATE)
            bags.append(bag)
        if progress is not None:
            progress(number / len(objects))
    return bags

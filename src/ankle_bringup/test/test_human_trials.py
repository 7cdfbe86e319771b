"""The public trials: fetched from a server, checked, imported; every failure in one sentence."""

import functools
import hashlib
import http.server
import json
import shutil
import threading
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ankle_bringup.command_line import app
from ankle_bringup.errors import RunError
from ankle_bringup.human_trials import Recording, fetch
from session_recorder.bag_reader import BagReader

REDUCED_FILE = Path(__file__).parents[4] / "shared" / "recordings" / "experimental_data_reduced.mat"


@pytest.fixture
def server(tmp_path):
    """A web server with the reduced copy of the public file; gives its address."""
    if not REDUCED_FILE.exists():
        pytest.skip(f"the reduced copy of the public recordings is not at {REDUCED_FILE}")
    folder = tmp_path / "served"
    folder.mkdir()
    shutil.copy(REDUCED_FILE, folder / "trials.mat")

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    handler = functools.partial(Quiet, directory=str(folder))
    served = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=served.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{served.server_address[1]}/trials.mat"
    served.shutdown()
    served.server_close()


def checksum():
    return hashlib.sha256(REDUCED_FILE.read_bytes()).hexdigest()


def test_the_trials_become_bags_with_the_torque_that_moves_the_ankle(server, tmp_path):
    arguments = ["fetch-trials", "--url", server, "--sha256", checksum(), "--json"]
    result = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    bags = json.loads(result.stdout)["bags"]
    # The reduced copy keeps the first trials and has zeros in the others.
    assert [Path(bag).name for bag in bags] == ["trial_1", "trial_2"]
    columns, data = BagReader(bags[0]).signal("/ankle/samples")
    published = np.load(REDUCED_FILE.with_name("mcgill_1.npz"))
    assert len(data) == 60000
    np.testing.assert_allclose(data[:, columns.index("position[rad]")], published["position"])
    np.testing.assert_allclose(data[:, columns.index("torque[N.m]")], -published["torque"])


def test_another_file_is_refused(server, tmp_path):
    with pytest.raises(RunError, match="is not the published file"):
        fetch(Recording(server, "0" * 64, "trials.mat"), tmp_path, show_progress=False)


def test_without_a_connection_a_sentence_says_what_to_do(tmp_path):
    nobody = Recording("http://127.0.0.1:9/trials.mat", "0" * 64, "trials.mat")
    with pytest.raises(RunError, match="is this computer connected to the internet"):
        fetch(nobody, tmp_path, show_progress=False)

"""Nothing that the command makes of an imported file holds the file's name, maybe a person's."""

import numpy as np
from typer.testing import CliRunner

from ankle_bringup.command_line import app

RATE = 1000
SECONDS = 30
SAID = ("-c", "t[s]=time", "-c", "position[rad]=angle", "-c", "torque[N.m]=moment")


def ankle(*arguments):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, (result.output, result.exception)
    return result.output


def test_no_bag_table_or_report_holds_the_name_of_the_imported_file(tmp_path, monkeypatch):
    source, work = tmp_path / "files" / "S07_Jansen.csv", tmp_path / "work"
    source.parent.mkdir()
    work.mkdir()
    random = np.random.default_rng(1)
    n = SECONDS * RATE
    steps = np.repeat(random.uniform(-0.02, 0.02, n // 200), 200)
    position = np.convolve(steps, np.hanning(20) / np.hanning(20).sum(), "same")
    velocity = np.gradient(position) * RATE
    torque = 0.0137 * np.gradient(velocity) * RATE + 0.6 * velocity + 90 * position
    torque += 0.02 * torque.std() * random.standard_normal(n)
    rows = np.column_stack([np.arange(n) / RATE, position, torque])
    np.savetxt(source, rows, delimiter=",", header="time,angle,moment", comments="")
    monkeypatch.chdir(work)
    ankle("import", source, *SAID, "--torque-sign", "rig")
    (bag,) = work.iterdir()
    ankle("export", bag, "--out", "table")
    ankle("estimate", bag, "--out", "estimates")
    ankle("open", bag, "--estimates", "estimates", "--out", "page.html", "--no-browser")
    written = [path for path in work.rglob("*") if path.is_file()]
    assert {".html", ".csv", ".mcap", ".png"} <= {path.suffix for path in written}
    for path in written:
        content = f"{path}".encode() + path.read_bytes()
        assert b"jansen" not in content.lower(), path

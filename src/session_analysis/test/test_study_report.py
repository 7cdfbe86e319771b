"""The report of a study: whose recordings it names, what it leaves out, what it compares."""

import json
from html import escape

import numpy as np
import pytest
from study_recordings import ankle

from session_analysis.study.conditions import About, difference, legs_apart, read_about
from session_analysis.study.recording_results import Row, process
from session_analysis.study.study_report import write_study_report

VALUES = {"K[N.m/rad]": 90.0, "G[N.m.s/rad]": 8.0, "B[N.m.s/rad]": 0.6, "I[kg.m^2]": 0.0137}


def rows_of(subject, visit, run=1, doubt=0.1, **other):
    values = {**VALUES, **{key: value for key, value in VALUES.items() if key not in other}}
    values = {key: other.get(key[0], value) for key, value in values.items()}
    rows = [Row(subject, visit, run, key, value, 0.1, doubt) for key, value in values.items()]
    quality = {"valid[%]": 98.0, "missing_samples[1]": 0.0, "held_out_vaf[%]": 97.0,
               "mean_torque[N.m]": -3.0, "K_of_mvc[%/rad]": 110.0,
               "K_by_mass[N.m/rad/kg]": 1.25}  # fmt: skip
    return rows + [Row(subject, visit, run, key, value, np.nan, doubt)
                   for key, value in quality.items()]  # fmt: skip


def study_rows(**of_last):
    """Four subjects with three visits; the last visit of S04 as asked for."""
    rows = []
    for number in (1, 2, 3, 4):
        for visit in (1, 2, 3):
            shift = 0.001 * (number + (visit * number) % 3)
            other = of_last if (number, visit) == (4, 3) else {}
            rows += rows_of(f"S0{number}", visit, **{"B": 0.6 + shift, **other})
    return rows


def report(rows, path, subject="", about=None, failures=()):
    return write_study_report(
        rows, dict(failures), path / "r.html", "T", subject, about
    ).read_text()


def text_after(text, mark, end):
    return text.partition(mark)[2].partition(end)[0]


def test_the_report_of_one_subject_names_no_recording_of_another(tmp_path):
    failures = {"sub-S04_ses-01_run-01": "no samples", "sub-S02_ses-02_run-01": "too short"}
    rows = study_rows(doubt=1.0)
    own = report(rows, tmp_path, "S02", failures=failures.items())
    assert "sub-S02_ses-02_run-01: too short" in own
    body = own.rpartition("</script>")[0] + own.partition("<h1>")[2]
    assert "S04" not in body
    assert "1 of other subjects" in own
    assert "sub-S04_ses-01_run-01: no samples" in report(rows, tmp_path, failures=failures.items())


def test_a_doubtful_recording_enters_neither_reliability_nor_the_comparison_with_the_paper(
    tmp_path,
):
    text = report(study_rows(doubt=1.0, B=5.0), tmp_path)
    cells = text_after(text, "<td>B [N·m·s/rad]</td>", "</tr>").split("</td>")
    error, of_error, change, of_change = (one.partition(">")[2] for one in cells[1:5])
    assert float(error) < 0.01
    assert float(change) < 0.1
    assert of_error == "3 subject(s), 3 visits"
    assert of_change == "4 subject(s), 11 values"
    sentence = "Left out: 1 recording(s) of which 50 % or more of the estimates are doubtful: "
    assert text.count(f"{sentence}sub-S04_ses-03_run-01.") == 2
    paper = text.partition("Beside the paper")[2]
    assert "5.0" not in text_after(paper, "<td>B [N·m·s/rad]</td>", "</td>")
    sure = report(study_rows(B=5.0), tmp_path)
    assert "Left out" not in sure
    assert "4 subject(s), 3 visits" in sure


def test_doubtful_values_do_not_widen_the_detectable_change_of_others(tmp_path):
    def limit(**of_last):
        text = report(study_rows(**of_last), tmp_path, "S02")
        return float(text_after(text, "minimal detectable change of ", " "))

    assert limit(doubt=1.0, K=900.0) == 0.0
    assert limit(K=900.0) > 100.0


def about_visits(**of_last):
    usual = {"side": "right", "posture": "sitting", "knee_angle[deg]": 30.0, "body_mass[kg]": 71.5}
    return {
        f"sub-S04_ses-{visit:02d}_run-01": About({**usual, **(of_last if visit == 3 else {})})
        for visit in (1, 2, 3)
    }


def test_visits_that_were_not_measured_alike_are_said_to_be_so_beside_the_change(tmp_path):
    other = about_visits(posture="lying", **{"knee_angle[deg]": 90.0})
    text = report(study_rows(K=120.0), tmp_path, about=other)
    change = text_after(text, "K changed by +30 N·m/rad", "</li>")
    assert "not alike" in change
    assert "posture (sitting; then lying), knee angle [deg] (30; then 90)" in change
    assert "differ between visits of 1 subject(s): S04" in text
    assert "<td>3, 1</td><td>right</td><td>lying</td><td>90</td><td>71.5</td>" in text
    alike = report(study_rows(K=120.0), tmp_path, about=about_visits())
    assert "not alike" not in alike
    assert "differ between visits" not in alike
    assert difference(study_rows()[-10:], 3, 3, {}) == ""


def test_left_and_right_leg_are_neither_averaged_nor_compared(tmp_path):
    rows = study_rows() + rows_of("S04", 1, run=2, K=200.0)
    about = about_visits()
    about["sub-S04_ses-01_run-02"] = About({"side": "left"})
    assert {row.subject for row in legs_apart(rows, about)} == {
        "S01", "S02", "S03", "S04, left leg", "S04, right leg",
    }  # fmt: skip
    text = report(rows, tmp_path, "S04", about)
    assert "1 subject(s), 3 visit(s), 4 recording(s). Left and right leg" in text
    right = text_after(text, "Subject S04, right leg", "</ul>")
    assert "K changed by +0 N·m/rad from visit 1 to visit 3" in right
    assert "One visit: no change to state." in text_after(text, "Subject S04, left leg", "Subject")
    # A side that only some recordings state takes nothing apart.
    assert legs_apart(study_rows(), {"sub-S04_ses-01_run-01": About({"side": "left"})}) == (
        study_rows()
    )


def test_the_report_tells_the_diagnosis_and_links_to_the_pages_of_a_recording(study):
    entry = study.next_entry("S07", 1)
    study.add(entry, {"posture": "sitting"})
    entry.source.mkdir()
    folder = study.derived(entry)
    (folder / "diagnosis").mkdir(parents=True)
    (folder / "report.html").write_text("estimates")
    (folder / "diagnosis" / "report.html").write_text("diagnosis")
    (folder / "diagnosis" / "verdict.json").write_text(json.dumps({"verdict": "explained"}))
    (folder / "results.json").write_text("cut o")
    rows = rows_of("S07", 1)
    found = {"effect:tendon_backlash[1]": 0.72, "diagnosis_augmented_vaf_holdout[%]": 96.2}
    rows += [Row("S07", 1, 1, key, value, np.nan, np.nan) for key, value in found.items()]
    about = read_about(study)
    assert about[entry.name].stated["posture"] == "sitting"
    text = report(rows, study.folder / "derivatives", about=about)
    assert "Physics is missing from the basic model, and it was found" in text
    assert "tendon backlash (probability 0.72)" in text
    assert "predicts 96.2 % of new torque" in text
    for page in ("report.html", "diagnosis/report.html"):
        assert f"href='{entry.name}/{page}'" in text


def test_what_an_import_assumed_stands_in_the_report(study):
    entry = study.next_entry("S07", 1)
    study.add(entry, {})
    source = entry.source.with_name(f"{entry.name}.csv")
    time, position, torque = ankle()
    table = np.column_stack([time, position, torque])
    np.savetxt(source, table, delimiter=",", header="Time (s),Ankle Angle,Torque", comments="")
    (held,) = study.entries()
    rows = process(study.folder, held, False)
    about = read_about(study)
    assumed = about[entry.name].assumed
    assert len(assumed) > 1, assumed
    text = report(rows, study.folder, about=about)
    assert "assumed: the columns are " in text
    assert "--positive" not in text
    assert any('add "positive": "plantarflexion" to ' in sentence for sentence in assumed)
    assert all(escape(sentence) in text for sentence in assumed)
    stated = {"columns": {"t[s]": "Time (s)", "position[rad]": "Ankle Angle",
                          "torque[N.m]": "Torque"}, "torque_sign": "rig"}  # fmt: skip
    held.sidecar.write_text(json.dumps(stated))
    process(study.folder, held, False)
    assert list(read_about(study)[entry.name].assumed) == []


SCREENS = (1920, 1366, 820, 390)
"""[px] Widths of a large screen, a notebook, a tablet and a phone."""
PAPER = 690
"""[px] Width of A4 within margins of 14 mm, at 96 px an inch."""


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.untimed
def test_no_table_is_cut_on_a_screen_or_on_paper(browser, tmp_path):
    about = about_visits(posture="lying", recorded="2026-11-03T09:15:00", remarks="none")
    report(study_rows(doubt=1.0), tmp_path, about=about)
    for width, media in (*((one, "screen") for one in SCREENS), (PAPER, "print")):
        page = browser.new_page(viewport={"width": width, "height": 900})
        page.emulate_media(media=media)
        page.goto((tmp_path / "r.html").as_uri())
        try:
            boxes = page.evaluate(
                "[...document.querySelectorAll('.wide')].map(box => [box.clientWidth,"
                " box.scrollWidth, box.getBoundingClientRect().right])"
            )
            head = page.evaluate(
                "[...document.querySelectorAll('th')].filter(cell => cell.textContent =="
                " 'doubtful').map(cell => cell.getBoundingClientRect().right)"
            )
        finally:
            page.close()
        assert len(boxes) > 4 * 3
        assert all(right <= width for _, _, right in boxes), (width, media)
        assert max(head) < width, (width, media)
        if media == "print" or width > 1000:
            assert all(shown >= whole for shown, whole, _ in boxes), (width, media, boxes)

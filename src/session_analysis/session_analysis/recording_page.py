"""A recording as one local page to scroll through: signals, estimates, events, diagnosis, losses.

The page holds the samples themselves as 16-bit numbers. What is on the screen is drawn as the
smallest and largest value of each pixel's samples, anew after each zoom, so that no peak is lost.
"""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from ankle_interfaces.block import MESSAGE_TYPE
from ankle_interfaces.continuity import sampling_rate
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    EMG_SAMPLES,
    IMPEDANCE_ESTIMATE,
    PERTURBATION_REFERENCE,
    SESSION_EVENT,
)
from ankle_interfaces.value_text import with_unit
from ankle_node.session_event import SessionEventError, parse
from impedance_estimator.offline.recorded_estimates import DOUBTS_KEY, NOT_VALID_KEY
from session_analysis.colours import COLOURS
from session_analysis.html_page import bullets, heading, page, paragraph
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError
from session_recorder.loss import MIN_SAMPLED_BLOCK, LossAccount, account_of_bag
from session_recorder.message_definitions import typestore

SHOWN_TOPICS = tuple(
    topic.name for topic in (ANKLE_SAMPLES, PERTURBATION_REFERENCE, EMG_SAMPLES, IMPEDANCE_ESTIMATE)
)
"""Ends of the names of the topics that are drawn."""
HIDDEN_PREFIXES = ("se_", "t[", "acceleration[")
MAX_VALUES = 12_000_000
"""Largest number of values on a page, 32 MB of text; beyond, pairs of smallest and largest values
stand for groups of samples."""
STEPS = 65_000
"""Number of steps of a 16-bit number that a signal's range is divided into; finer than any sensor's
noise."""
GAP = -32768
"""The number that stands for a missing sample."""
MAX_GRID = 50_000_000
"""Largest number of samples of a grid; a recording whose times spread further is drawn by its first
part."""


VERDICT_SENTENCES = {
    "no_mismatch": "The model holds: this recording shows nothing that is missing from it",
    "explained": "Physics is missing from the basic model, and it was found",
    "unexplained": "Physics is missing from the basic model, and no known effect explains it",
    "bad_recording": "The recording cannot be judged",
}


@dataclass(frozen=True)
class Track:
    """Holds one line of the page: evenly spaced values.

    Attributes
    ----------
    name
        Topic and column.
    start
        Time of the first value [s].
    step
        Time between values [s].
    values
        Shape (n,), NaN where there is none.
    """

    name: str
    start: float
    step: float
    values: np.ndarray


def write_recording_page(
    bag_path: Path, out: Path, diagnosis: Path | None = None, estimates: Path | None = None
) -> Path:
    """Write the page.

    Parameters
    ----------
    bag_path
        The recording.
    out
        The file to write.
    diagnosis
        Folder that `ankle diagnose` wrote for it.
    estimates
        Bag that `ankle estimate` wrote for it; its estimates are drawn below the signals.

    Raises
    ------
    BagError
        The bag cannot be read or holds nothing to draw.
    """
    bag = BagReader(bag_path)
    losses = account_of_bag(bag)
    tracks = read_tracks(bag, losses)
    if not tracks:
        raise BagError(f"{bag_path} holds nothing to draw; it has {', '.join(bag.topics)}")
    estimated = None if estimates is None else BagReader(estimates)
    if estimated is not None:
        tracks += read_tracks(estimated, losses)
    total = sum(len(track.values) for track in tracks)
    group = max(1, -(-2 * total // MAX_VALUES)) if total > MAX_VALUES else 1
    events = _events(bag, losses.origin)
    content = {
        "tracks": [_encoded(coarsened(track, group), losses.origin) for track in tracks],
        "events": events,
    }
    parts = [
        paragraph(
            "Drag to zoom, double-click for all of it; all signals move together. Dotted lines are "
            "events."
        ),
        "<div id='recording'></div>",
        f"<script>const RECORDING={json.dumps(content)};{_SCRIPT}</script>",
        heading("What the recording lacks"),
        bullets(losses.sentences(), "loss", "Nothing is missing."),
        heading("Events"),
        bullets([f"{at:.3f} s: {name}" for at, name in events], nothing="None."),
        heading("Estimates"),
        *_estimates(estimated, any(IMPEDANCE_ESTIMATE.name in track.name for track in tracks)),
        heading("Diagnosis"),
        *_diagnosis(diagnosis),
    ]
    out.write_text(page(bag_path.name, parts), encoding="utf-8")
    return out


def read_tracks(bag: BagReader, losses: LossAccount) -> list[Track]:
    """Read every column that is worth a line, on an even grid with NaN in gaps."""
    tracks = []
    for topic in sorted(bag.topics, key=_order):
        if _order(topic) == len(SHOWN_TOPICS) or bag.topics[topic].type != MESSAGE_TYPE:
            continue
        parts = [block for block in bag.blocks(topic, lambda _: None) if len(block.data)]
        if not parts:
            continue
        columns = parts[0].columns
        data = np.concatenate([block.data for block in parts if block.columns == columns])
        data = data[np.isfinite(data[:, 0])]
        if len(data) < MIN_SAMPLED_BLOCK:
            continue
        try:
            step = 1.0 / sampling_rate(np.sort(data[:, 0]))
        except ValueError:
            continue
        start = float(data[:, 0].min())
        place = np.round((data[:, 0] - start) / step)
        keep = place < MAX_GRID
        place = place[keep].astype(int)
        valid = columns.index("valid[1]") if "valid[1]" in columns else None
        for index, column in enumerate(columns):
            if column.startswith(HIDDEN_PREFIXES):
                continue
            values = np.full(int(place.max()) + 1, np.nan, dtype=np.float32)
            own = data[keep, index]
            if valid is not None and index != valid:
                own = np.where(data[keep, valid] > 0, own, np.nan)
            values[place] = own
            tracks.append(Track(f"{topic} {column}", start, step, values))
    return tracks


def _order(topic: str) -> int:
    return next((k for k, end in enumerate(SHOWN_TOPICS) if topic.endswith(end)), len(SHOWN_TOPICS))


def coarsened(track: Track, group: int) -> Track:
    """Return pairs of the smallest and the largest of every `group` values.

    For a group of 1 the track itself is returned.

    Parameters
    ----------
    track
        Times and values.
    group
        Values that one pair stands for.
    """
    if group <= 1:
        return track
    padded = np.pad(track.values, (0, -len(track.values) % group), constant_values=np.nan)
    pieces = padded.reshape(-1, group)
    known = np.isfinite(pieces).any(axis=1)
    low = np.full(len(pieces), np.nan, dtype=np.float32)
    high = low.copy()
    low[known] = np.nanmin(pieces[known], axis=1)
    high[known] = np.nanmax(pieces[known], axis=1)
    values = np.column_stack([low, high]).reshape(-1)
    return Track(track.name, track.start, track.step * group / 2, values)


def label(name: str) -> str:
    """Return what the page calls a line.

    Parameters
    ----------
    name
        Topic and column of a track.
    """
    topic, _, column = name.rpartition(" ")
    commanded = "commanded " if topic.endswith(PERTURBATION_REFERENCE.name) else ""
    return commanded + with_unit(column)


def _encoded(track: Track, origin: float) -> dict[str, object]:
    finite = np.isfinite(track.values)
    low = float(track.values[finite].min()) if finite.any() else 0.0
    high = float(track.values[finite].max()) if finite.any() else 0.0
    scale = (high - low) / STEPS or 1.0
    numbers = np.full(len(track.values), GAP, dtype="<i2")
    numbers[finite] = np.round((track.values[finite] - low) / scale) - STEPS // 2
    return {
        "name": track.name,
        "label": label(track.name),
        "start": track.start - origin,
        "step": track.step,
        "low": low,
        "scale": scale,
        "half": STEPS // 2,
        "data": base64.b64encode(numbers.tobytes()).decode(),
    }


def _events(bag: BagReader, origin: float) -> list[tuple[float, str]]:
    store = typestore()
    found = []
    for topic, about in bag.topics.items():
        if not topic.endswith(SESSION_EVENT.name) or about.type != SESSION_EVENT.message:
            continue
        for _, log_time, message in bag.messages([topic]):
            text = str(store.deserialize_cdr(message, about.type).data)  # type: ignore[attr-defined]
            try:
                event = parse(text)
                found.append((event.time - origin, event.event))
            except SessionEventError:
                found.append((log_time * 1e-9 - origin, text))
    return found


def _estimates(bag: BagReader | None, drawn: bool) -> list[str]:
    """Return why estimates are doubtful or not valid, as the bag of estimates says it."""
    if bag is None:
        return [
            paragraph("Those of the running laboratory, above.")
            if drawn
            else paragraph("None beside the recording; make them with 'ankle estimate'.")
        ]
    reasons = [
        f"{word} {reason}"
        for key, word in ((DOUBTS_KEY, "doubtful for"), (NOT_VALID_KEY, "not valid for"))
        for reason in bag.custom_data.get(key, "").split("; ")
        if reason
    ]
    return [
        paragraph(
            f"Drawn above, from {bag.path.name}. Where nothing is drawn, they are not valid."
        ),
        bullets(reasons, nothing="All of them are valid and without doubt."),
    ]


def _diagnosis(folder: Path | None) -> list[str]:
    if folder is None or not (folder / "verdict.json").exists():
        return [paragraph("None beside the recording; make one with 'ankle diagnose'.")]
    verdict = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
    sentences = [str(effect.get("sentence", "")) for effect in verdict.get("effects", [])]
    word = str(verdict.get("verdict", "unknown"))
    report = (folder / "report.html").resolve()
    link = f" <a href='{escape(report.as_uri())}'>All of it</a>" if report.exists() else ""
    return [
        paragraph(f"{VERDICT_SENTENCES.get(word, word)}.", "answer"),
        f"<p>{link}</p>",
        bullets([*sentences, *map(str, verdict.get("reasons", []))]),
    ]


_SCRIPT = (
    """
const GAP=-32768,POINTS=1500,COLOURS="""
    + json.dumps(COLOURS)
    + """;
for(const t of RECORDING.tracks){const b=atob(t.data),u=new Uint8Array(b.length);
for(let i=0;i<b.length;i++)u[i]=b.charCodeAt(i);t.values=new Int16Array(u.buffer);delete t.data}
function part(t,from,to){const n=t.values.length;
let a=Math.max(0,Math.floor((from-t.start)/t.step)),z=Math.min(n,Math.ceil((to-t.start)/t.step)+1);
const x=[],y=[],k=Math.max(1,Math.ceil((z-a)/POINTS));
const real=v=>v===GAP?null:t.low+(v+t.half)*t.scale;
for(let i=a;i<z;i+=k){let lo=GAP,hi=GAP,il=i,ih=i,gap=false;
for(let j=i;j<Math.min(i+k,z);j++){const v=t.values[j];if(v===GAP){gap=true;continue}
if(lo===GAP||v<lo){lo=v;il=j}if(hi===GAP||v>hi){hi=v;ih=j}}
const at=j=>t.start+j*t.step;
if(lo===GAP){x.push(at(i));y.push(null);continue}
if(k===1){x.push(at(i));y.push(real(lo));continue}
const first=il<ih?[il,lo]:[ih,hi],second=il<ih?[ih,hi]:[il,lo];
x.push(at(first[0]),at(second[0]));y.push(real(first[1]),real(second[1]));
if(gap){x.push(at(second[0]));y.push(null)}}
return[x,y]}
const end=Math.max(...RECORDING.tracks.map(t=>t.start+t.step*t.values.length)),
start=Math.min(...RECORDING.tracks.map(t=>t.start)),rows=RECORDING.tracks.length;
const layout={height:Math.max(400,130*rows),template:'plotly_white',showlegend:false,
margin:{l:90,r:20,t:20,b:40},grid:{rows:rows,columns:1},
xaxis:{range:[start,end],title:{text:'time in the recording [s]'},anchor:'y'+(rows>1?rows:'')},
shapes:RECORDING.events.map(e=>({type:'line',x0:e[0],x1:e[0],y0:0,y1:1,yref:'paper',
line:{dash:'dot',color:'#888',width:1}})),annotations:[]};
RECORDING.tracks.forEach((t,i)=>{const axis='yaxis'+(i?i+1:'');
layout[axis]={domain:[1-(i+0.92)/rows,1-i/rows],fixedrange:true,title:{
text:t.label.replace(' [','<br>['),standoff:8,font:{size:11}}}});
const traces=RECORDING.tracks.map((t,i)=>{const[x,y]=part(t,start,end);
return{x,y,type:'scattergl',mode:'lines',line:{width:1,color:COLOURS[i%COLOURS.length]},
xaxis:'x',yaxis:'y'+(i?i+1:''),name:t.name,connectgaps:false}});
const shown=document.getElementById('recording');
Plotly.newPlot(shown,traces,layout,{scrollZoom:true,responsive:true});
let waiting=null;
shown.on('plotly_relayout',()=>{clearTimeout(waiting);waiting=setTimeout(()=>{
const[a,z]=shown.layout.xaxis.range,parts=RECORDING.tracks.map(t=>part(t,a,z));
Plotly.restyle(shown,{x:parts.map(p=>p[0]),y:parts.map(p=>p[1])})},150)});
"""
)

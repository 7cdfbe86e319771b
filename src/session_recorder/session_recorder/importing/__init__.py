"""Recordings of other systems into bags: files into tables, tables into columns with a meaning."""

from session_recorder.importing.mapping import propose
from session_recorder.importing.proposal import Proposal
from session_recorder.importing.recording_import import ImportReport, import_recording
from session_recorder.importing.table import Table
from session_recorder.importing.tables import read_table

__all__ = ["ImportReport", "Proposal", "Table", "import_recording", "propose", "read_table"]

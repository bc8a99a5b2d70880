"""What a run found, as the JSON document and as text for a terminal."""

from attest.report.calibration import text_of_calibration
from attest.report.gains import text_of_observer
from attest.report.info import describe, text_of_info
from attest.report.plot import plot
from attest.report.ranking import rank, text_of_ranking
from attest.report.summary import sha256, summarise
from attest.report.table import text_of_run

__all__ = [
    "describe",
    "plot",
    "rank",
    "sha256",
    "summarise",
    "text_of_calibration",
    "text_of_info",
    "text_of_observer",
    "text_of_ranking",
    "text_of_run",
]

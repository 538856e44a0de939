"""The report: one self-contained HTML file."""

from ._report import write_report as write_report

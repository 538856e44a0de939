"""The report: one self-contained HTML file, and what of it other outputs share."""

from typing import TYPE_CHECKING

from .._lazy import attach

if TYPE_CHECKING:
    from ._batch_page import batch_sentence as batch_sentence
    from ._batch_page import write_batch_report as write_batch_report
    from ._bokehjs import document_of as document_of
    from ._compensation_page import compensation_figures as compensation_figures
    from ._compensation_page import compensation_sentence as compensation_sentence
    from ._compensation_page import compensation_warnings as compensation_warnings
    from ._description import describe as describe
    from ._description import shown_by as shown_by
    from ._description import shown_rows as shown_rows
    from ._effect_picture import draw_effect as draw_effect
    from ._linked import Curve as Curve
    from ._linked import link as link
    from ._linked import linked_plots as linked_plots
    from ._posterior_page import posterior_row as posterior_row
    from ._recording_picture import draw_recordings as draw_recordings
    from ._report import Reported as Reported
    from ._report import write_report as write_report
    from ._strips import strips as strips
    from ._text import crosscheck_figures as crosscheck_figures
    from ._text import crosscheck_sentence as crosscheck_sentence
    from ._text import diagnosis_figures as diagnosis_figures
    from ._text import file_name as file_name
    from ._text import fit_sentence as fit_sentence
    from ._text import frequency_figures as frequency_figures
    from ._text import frequency_sentence as frequency_sentence
    from ._text import key_figures as key_figures
    from ._text import noise_of as noise_of
    from ._text import parameter_rows as parameter_rows

__getattr__, __dir__ = attach(__name__)
